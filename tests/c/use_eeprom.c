/* EEPROM tasks and reset runs, from C. */
#include <string.h>

#include "program.h"

enum { kBytes = 889, kRange = 40 };

/* The bus of a plain bus or of an axis, polled. */
typedef struct polled {
  tm485_bus* bus;
  tm485_axis* axis; /* NULL: a plain bus */
} polled;

static tm485_time poll_it(const polled* it, tm485_time now) {
  return it->axis != NULL ? tm485_axis_poll(it->axis, now) : tm485_bus_poll(it->bus, now);
}

static void finish(tm485_eeprom* eeprom, const polled* it, const test_line* line, tm485_time* now) {
  const tm485_time limit = *now + TM485_MS(20000);
  while (tm485_eeprom_active(eeprom) && *now < limit) {
    const tm485_time due = poll_it(it, *now);
    const tm485_time asked = tm485_eeprom_drive(eeprom, it->bus, *now);
    *now = next_time(line, *now, due < asked ? due : asked);
  }
}

int use_eeprom(const test_line* line, const char* preset, bool knows, bool in_axis) {
  static tm485_profile profile;
  static tm485_bus bus;
  static tm485_axis axis;
  static tm485_eeprom eeprom;
  static uint8_t value[kBytes];
  static bool known[kBytes];
  tm485_axis_setup setup;
  tm485_eeprom_outcome outcome;
  tm485_eeprom_progress progress;
  tm485_eeprom_doubt doubt;
  polled it = {&bus, NULL};
  uint8_t written[kRange];
  uint8_t read[kRange];
  uint32_t first = 0;
  tm485_time now = 0;
  size_t bytes;
  int i;

  CHECK(tm485_profile_init(&profile, preset) == TM485_OK);
  tm485_axis_setup_default(&setup);
  tm485_bus_config_cycle(&setup.bus, TM485_ID_EVERYTHING, TM485_US(250));
  setup.bus.eeprom_may_hold = 1;
  if (in_axis) {
    CHECK(tm485_axis_init(&axis, &line->port, &profile, &setup) == TM485_OK);
    CHECK(tm485_axis_start(&axis, now, NULL) == TM485_OK);
    it.axis = &axis;
    it.bus = tm485_axis_bus(&axis);
  } else {
    CHECK(tm485_bus_init(&bus, &line->port, &profile, &setup.bus) == TM485_OK);
    CHECK(tm485_bus_start(&bus, now, NULL) == TM485_OK);
  }
  while (tm485_bus_get_state(it.bus) != TM485_STATE_RUNNING && now < TM485_MS(1000))
    now = next_time(line, now, poll_it(&it, now));

  memset(known, 0, sizeof known);
  CHECK(tm485_eeprom_init(&eeprom, &profile, NULL, NULL, 0) == TM485_OK);
  bytes = tm485_eeprom_bytes(&eeprom);
  CHECK(bytes == 889 || bytes == 762);
  if (knows) {
    CHECK(tm485_eeprom_init(&eeprom, &profile, value, known, bytes) == TM485_OK);
  }
  CHECK(tm485_eeprom_linear(&eeprom, 2, 110, &first) == TM485_OK && first == 2 * 127 + 110);
  CHECK(tm485_eeprom_linear(&eeprom, 2, 127, &first) == TM485_ERR_BAD_ARGUMENT);
  CHECK(!tm485_eeprom_get_outcome(&eeprom, &outcome));

  for (i = 0; i < kRange; ++i) written[i] = (uint8_t)(3 + 5 * i);
  CHECK(tm485_eeprom_start_write(&eeprom, first, written, kRange) == TM485_OK);
  CHECK(tm485_eeprom_start_read(&eeprom, first, read, kRange) == TM485_ERR_BUSY);
  CHECK(tm485_eeprom_time_left(&eeprom) > TM485_MS(300));
  for (i = 0; i < 100000 && !tm485_eeprom_in_doubt(&eeprom, &doubt); ++i) {
    const tm485_time due = poll_it(&it, now);
    const tm485_time asked = tm485_eeprom_drive(&eeprom, it.bus, now);
    now = next_time(line, now, due < asked ? due : asked);
  }
  CHECK(i < 100000 && doubt.page == 2 && doubt.address == 110);
  finish(&eeprom, &it, line, &now);
  CHECK(tm485_eeprom_get_outcome(&eeprom, &outcome));
  CHECK(outcome.code == TM485_OK && !tm485_eeprom_in_doubt(&eeprom, &doubt));
  tm485_eeprom_get_progress(&eeprom, &progress);
  CHECK(progress.done == kRange && progress.total == kRange && progress.writes == kRange);
  CHECK(progress.page_selects >= 1 && progress.unconfirmed_pages == 0);
  if (knows) {
    CHECK(known[first] && value[first] == written[0] && known[first + kRange - 1] && !known[first + kRange]);
  }

  memset(read, 0, sizeof read);
  CHECK(tm485_eeprom_start_read(&eeprom, first, read, kRange) == TM485_OK);
  finish(&eeprom, &it, line, &now);
  CHECK(tm485_eeprom_get_outcome(&eeprom, &outcome) && outcome.code == TM485_OK);
  CHECK(memcmp(read, written, kRange) == 0);

  written[20] ^= 0x40U; /* linear 384: page 3, address 3 */
  CHECK(tm485_eeprom_start_verify(&eeprom, first, written, kRange) == TM485_OK);
  finish(&eeprom, &it, line, &now);
  CHECK(tm485_eeprom_get_outcome(&eeprom, &outcome) && outcome.code == TM485_ERR_EEPROM_MISMATCH);
  CHECK(outcome.page == 3 && outcome.address == 3);
  CHECK(outcome.wanted == written[20] && outcome.found == read[20]);

  CHECK(tm485_eeprom_start_read(&eeprom, 0, read, kRange) == TM485_OK);
  tm485_eeprom_cancel(&eeprom);
  finish(&eeprom, &it, line, &now);
  CHECK(tm485_eeprom_get_outcome(&eeprom, &outcome) && outcome.code == TM485_ERR_ABANDONED);
  return 0;
}

int use_reset(const test_line* line, tm485_reset_kind kind, tm485_reset_outcome* outcome) {
  static tm485_profile profile;
  static tm485_bus bus;
  static tm485_reset reset;
  tm485_reset_config config;
  tm485_bus_config bus_config;
  tm485_time now = 0;
  tm485_time limit;
  CHECK(tm485_profile_init(&profile, "tm485_17") == TM485_OK);
  tm485_bus_config_default(&bus_config);
  CHECK(tm485_bus_init(&bus, &line->port, &profile, &bus_config) == TM485_OK);
  CHECK(tm485_bus_start(&bus, now, NULL) == TM485_OK);
  while (tm485_bus_get_state(&bus) != TM485_STATE_RUNNING && now < TM485_MS(1000))
    now = next_time(line, now, tm485_bus_poll(&bus, now));
  limit = now + TM485_MS(5);
  while (now < limit) now = next_time(line, now, tm485_bus_poll(&bus, now));

  tm485_reset_config_default(&config);
  CHECK(config.window == TM485_MS(50) && config.most_runs == 5 && config.max_speed_rpm == 6000);
  config.max_speed_rpm = 0; /* as somebody who knows nothing of it leaves it */
  CHECK(tm485_reset_init(&reset, &profile, &config) == TM485_OK);
  CHECK(!tm485_reset_get_outcome(&reset, outcome));
  CHECK(tm485_reset_start(&reset, kind) == TM485_OK);
  CHECK(tm485_reset_start(&reset, kind) == TM485_ERR_BUSY);
  limit = now + TM485_MS(20000);
  while (tm485_reset_active(&reset) && now < limit) {
    const tm485_time due = tm485_bus_poll(&bus, now);
    const tm485_time asked = tm485_reset_drive(&reset, &bus, now);
    now = next_time(line, now, due < asked ? due : asked);
  }
  CHECK(tm485_reset_get_outcome(&reset, outcome));
  return 0;
}
