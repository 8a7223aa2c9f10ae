/* Reads an encoder every 5 ms, tells position and speed at the loop's own instants, and reads its EEPROM meanwhile.
   In C alone; integrations/examples/servo_loop is the whole loop in C++.

     c_axis /dev/ttyUSB0        or, with a simulated encoder, run.sh */
#define _POSIX_C_SOURCE 200809L
#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#include "posix_port.h"
#include "tm485/c/tm485.h"

#define PERIOD TM485_MS(5)

/* Printed by a host's program: tm485::design::solve_for_bandwidth({.order = 3, .period = 5ms}, 15.0 Hz).
   A firmware keeps this in flash. */
static const tm485_estimator_gains kGains = {
    .period = PERIOD,
    .order = 3,
    .longest_gap = 32,
    .gain_position = 0.434364766F,
    .gain_velocity = 0.122919776F,
    .gain_acceleration = 0.0173923783F,
    .covariance_pp = 0.0361970626F,
    .covariance_pv = 0.0102433152F,
    .covariance_pa = 0.00144936482F,
    .covariance_vv = 0.00482595898F,
    .covariance_va = 0.000959232741F,
    .covariance_aa = 0.0002926827F,
    .process_noise = 4.45656478e-05F,
    .measurement_variance = 0.0833333358F,
};

/* Everything that the library needs, in storage of ours. Nothing is allocated. */
static tm485_profile profile;
static tm485_axis axis;
static tm485_eeprom eeprom;

static tm485_time clock_now(void) {
  struct timespec now;
  (void)clock_gettime(CLOCK_MONOTONIC, &now);
  return (tm485_time)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void sleep_until(tm485_time target) {
  const tm485_time left = target - clock_now();
  struct timespec span;
  if (left <= 0) return;
  span.tv_sec = 0;
  span.tv_nsec = (long)(left < TM485_US(200) ? left : TM485_US(200)); /* a reply may come at any time */
  (void)nanosleep(&span, NULL);
}

/* Called in the bus's context when the data are lost. In a drive: torque off, here and at once. */
static void on_invalid(void* context, tm485_time now) {
  (void)context;
  printf("%8.1f ms  invalid: torque off\n", (double)now * 1e-6);
}

/* What the bus's context does: a timer interrupt, or a real-time thread. Answers when it wants to be called again. */
static tm485_time bus_context(tm485_time now) {
  const tm485_time due = tm485_axis_poll(&axis, now);
  const tm485_time asked = tm485_eeprom_drive(&eeprom, tm485_axis_bus(&axis), now);
  return due < asked ? due : asked;
}

/* Data that were lost stay invalid until a command. In a drive that is the operator's; nothing is at stake here. */
static void commands(tm485_time now) {
  static bool under_way;
  tm485_command_result result;
  tm485_loop_view view;
  while (tm485_loop_poll_completion(&axis, &result)) {
    under_way = false;
    if (result.error == TM485_OK) printf("%8.1f ms  resumed\n", (double)now * 1e-6);
  }
  tm485_loop_get_view(&axis, &view);
  if (view.latched && !under_way)
    under_way = tm485_loop_post(&axis, TM485_COMMAND_RESUME, NULL, NULL) == TM485_OK;
}

/* What the servo loop does, in a context of its own. True if there was a fresh sample. */
static bool loop_context(tm485_time now, unsigned tick) {
  tm485_sample sample;
  tm485_estimate shaft;
  const tm485_validity validity = tm485_loop_read(&axis, now, &sample);
  tm485_loop_estimate_at(&axis, now, &shaft); /* at this instant, not at that of the sample */
  commands(now);
  if (validity == TM485_VALIDITY_INVALID || !tm485_estimate_valid(&shaft)) return false;
  if (tick % 20 == 0) {
    printf("%8.1f ms  %s  position %8lld counts, turn %d, %7.1f rpm\n", (double)now * 1e-6,
           validity == TM485_VALIDITY_FRESH ? "fresh       " : "extrapolated", (long long)shaft.position,
           (int)sample.turns, (double)shaft.velocity / 131072.0 * 60.0);
  }
  return validity == TM485_VALIDITY_FRESH;
}

static int start(const tm485_port* port) {
  tm485_axis_setup setup;
  tm485_refusal refusal;
  if (tm485_profile_init(&profile, "tm485_17") != TM485_OK) return -1;
  tm485_axis_setup_default(&setup);
  tm485_bus_config_cycle(&setup.bus, TM485_ID_EVERYTHING, PERIOD);
  setup.bus.max_hold = TM485_MS(100);
  setup.gains = &kGains;
  setup.on_invalid = on_invalid;
  if (tm485_axis_init(&axis, port, &profile, &setup) != TM485_OK) return -1;
  if (tm485_eeprom_init(&eeprom, &profile, NULL, NULL, 0) != TM485_OK) return -1;
  if (tm485_axis_start(&axis, 0, &refusal) != TM485_OK) {
    fprintf(stderr, "refused: %s; nearest possible: %lld ns\n", tm485_errc_cause(refusal.code),
            (long long)refusal.nearest);
    return -1;
  }
  return 0;
}

int main(int count, char** arguments) {
  posix_port line;
  tm485_port port;
  tm485_statistics statistics;
  tm485_eeprom_outcome outcome;
  uint8_t bytes[16];
  tm485_time begun;
  tm485_time tick = PERIOD;
  unsigned ticks = 0;
  unsigned fresh = 0;
  bool asked = false;

  if (count != 2) {
    fprintf(stderr, "usage: c_axis DEVICE\n");
    return 2;
  }
  if (tm485_abi() != TM485_ABI) {
    fprintf(stderr, "the library is of another version: %s\n", tm485_version(NULL, NULL, NULL));
    return 1;
  }
  if (posix_port_open(&line, &port, arguments[1]) != 0) {
    fprintf(stderr, "%s: %s\n", arguments[1], strerror(errno));
    return 1;
  }
  if (start(&port) != 0) return 1;

  /* Until 200 fresh samples are there and the EEPROM task is over, for 20 s at most. */
  begun = clock_now();
  while ((fresh < 200 || !asked || tm485_eeprom_active(&eeprom)) && tick < TM485_MS(20000)) {
    tm485_time now = clock_now() - begun;
    tm485_time due;
    if (now >= tick) {
      if (loop_context(now, ticks++)) ++fresh;
      while (tick <= now) tick += PERIOD;
    }
    if (!asked && fresh > 20) asked = tm485_eeprom_start_read(&eeprom, 0, bytes, sizeof bytes) == TM485_OK;
    due = bus_context(now);
    sleep_until(begun + (due < tick ? due : tick));
  }

  if (tm485_eeprom_get_outcome(&eeprom, &outcome)) {
    printf("EEPROM 0..15: %s", tm485_errc_name(outcome.code));
    for (size_t i = 0; i < sizeof bytes && outcome.code == TM485_OK; ++i) printf(" %02X", bytes[i]);
    printf("\n");
  }
  tm485_bus_statistics(tm485_axis_bus(&axis), &statistics);
  printf("%u cycles, %u failed, %u skipped\n", (unsigned)statistics.cycles, (unsigned)statistics.failed,
         (unsigned)statistics.skipped);
  if (fresh == 0) {
    const tm485_errc why = tm485_bus_startup_error(tm485_axis_bus(&axis), NULL);
    fprintf(stderr, "no sample: %s; %s\n", tm485_errc_cause(why), tm485_errc_remedy(why));
  }
  posix_port_close(&line);
  return fresh >= 200 && asked && outcome.code == TM485_OK ? 0 : 1;
}
