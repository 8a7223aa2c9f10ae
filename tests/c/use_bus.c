/* The bus, from C. */
#include <string.h>

#include "program.h"

tm485_time next_time(const test_line* line, tm485_time now, tm485_time due) {
  const tm485_time event = line->next_event(line->context);
  tm485_time next = now + TM485_MS(1);
  if (due < next) next = due;
  if (event > now && event < next) next = event;
  return next > now ? next : now;
}

int use_bus(const test_line* line, const char* preset, tm485_data_id id, tm485_time slot, size_t samples,
            collected* to) {
  static tm485_profile profile;
  static tm485_bus bus;
  tm485_bus_config config;
  tm485_feasibility feasibility;
  tm485_refusal refusal;
  tm485_sample sample;
  tm485_time now = 0;
  uint32_t seen;

  CHECK(tm485_profile_init(&profile, preset) == TM485_OK);
  tm485_bus_config_default(&config);
  tm485_bus_config_cycle(&config, id, slot);
  CHECK(tm485_bus_init(&bus, &line->port, &profile, &config) == TM485_OK);
  CHECK(tm485_bus_get_state(&bus) == TM485_STATE_STOPPED);
  CHECK(tm485_bus_check(&bus, &feasibility, &refusal) == TM485_OK);
  CHECK(feasibility.slot == slot && feasibility.length == slot);
  CHECK(tm485_bus_poll(&bus, now) == TM485_NEVER); /* nothing before the start */
  CHECK(tm485_bus_start(&bus, now, &refusal) == TM485_OK);
  CHECK(tm485_bus_get_state(&bus) == TM485_STATE_STARTUP);
  CHECK(tm485_bus_startup_stage(&bus) == TM485_STAGE_QUIET);

  to->count = 0;
  tm485_bus_latest(&bus, &sample);
  CHECK(sample.quality == TM485_QUALITY_INVALID);
  seen = sample.sequence;
  while (to->count < samples && now < TM485_MS(10000)) {
    now = next_time(line, now, tm485_bus_poll(&bus, now));
    tm485_bus_latest(&bus, &sample);
    if (sample.sequence == seen) continue;
    seen = sample.sequence;
    to->samples[to->count++] = sample;
    if (sample.quality == TM485_QUALITY_FRESH) {
      CHECK(tm485_bus_fresh_until(&bus) > now);
      CHECK(tm485_bus_valid_until(&bus) >= tm485_bus_fresh_until(&bus));
      CHECK(tm485_sample_age(&sample, now) > 0);
    }
  }
  CHECK(to->count == samples);
  CHECK(tm485_bus_get_state(&bus) == TM485_STATE_RUNNING);
  CHECK(tm485_bus_startup_stage(&bus) == TM485_STAGE_DONE);
  tm485_bus_statistics(&bus, &to->statistics);
  CHECK(tm485_bus_last_record(&bus, &to->record) > samples / 2);
  CHECK(tm485_bus_error_count(&bus, TM485_ERR_TIMEOUT) == to->statistics.errors[TM485_ERR_TIMEOUT]);
  CHECK(tm485_bus_error_count(&bus, 999) == 0);
  {
    tm485_link_health link;
    tm485_alarms alarms;
    tm485_bus_link(&bus, &link);
    CHECK(link.state == TM485_LINK_GOOD || link.state == TM485_LINK_DEGRADED);
    CHECK(link.measured && link.host == 0);
    CHECK((uint32_t)link.silence + link.damage + link.implausible <= to->statistics.failed);
    tm485_bus_alarms(&bus, &alarms);
    CHECK(alarms.live == alarms.latched && alarms.live_level == alarms.latched_level);
  }
  tm485_bus_stop(&bus);
  CHECK(tm485_bus_get_state(&bus) == TM485_STATE_STOPPED);
  return 0;
}

int use_patterns(const test_line* line) {
  static tm485_profile profile;
  static tm485_bus bus;
  tm485_bus_config config;
  tm485_feasibility feasibility;
  tm485_refusal refusal;
  tm485_completion completion;
  tm485_request request;
  tm485_sample sample;
  tm485_statistics statistics;
  tm485_time now = 0;

  CHECK(tm485_profile_init(&profile, "tm485_17") == TM485_OK);
  tm485_bus_config_default(&config);
  tm485_bus_config_cycle(&config, TM485_ID_EVERYTHING, TM485_US(50)); /* T1 is 62.5 us */
  CHECK(tm485_bus_init(&bus, &line->port, &profile, &config) == TM485_OK);
  CHECK(tm485_bus_start(&bus, now, &refusal) == TM485_ERR_PERIOD_BELOW_T1);
  CHECK(refusal.code == TM485_ERR_PERIOD_BELOW_T1 && refusal.nearest == 62500 && refusal.step == 0);
  CHECK(tm485_bus_start(&bus, now, NULL) == TM485_ERR_PERIOD_BELOW_T1);

  /* ID0 in six slots of 40 us, ID3 in two, locked to a servo clock that ticks once a pattern. */
  config.slot = TM485_US(40);
  config.step_count = 0;
  tm485_bus_config_add(&config, TM485_ID_SINGLE_TURN, 6, 1);
  tm485_bus_config_add(&config, TM485_ID_EVERYTHING, 1, 4);
  config.phase = TM485_PHASE_SERVO;
  config.servo_period = TM485_US(400);
  config.servo_lead = TM485_US(60);
  CHECK(config.step_count == 7);
  CHECK(tm485_bus_init(&bus, &line->port, &profile, &config) == TM485_OK);
  CHECK(tm485_bus_check(&bus, &feasibility, NULL) == TM485_OK);
  CHECK(feasibility.length == TM485_US(400) && feasibility.gap >= TM485_US(62) && !feasibility.free_running);
  CHECK(tm485_bus_start(&bus, now, NULL) == TM485_OK);
  CHECK(tm485_request_make(&request, TM485_ID_MULTI_TURN) == TM485_OK);
  CHECK(tm485_bus_offer(&bus, &request, 1) == TM485_ERR_BAD_STATE);
  {
    tm485_time tick = TM485_US(400);
    bool offered = false;
    bool done = false;
    while (now < TM485_MS(300)) {
      tm485_time due;
      if (now >= tick) {
        tm485_bus_on_servo_tick(&bus, tick);
        tick += TM485_US(400);
      }
      due = tm485_bus_poll(&bus, now);
      if (!offered && tm485_bus_get_state(&bus) == TM485_STATE_RUNNING) {
        tm485_request broken = request;
        broken.bytes[0] ^= 1U;
        CHECK(tm485_bus_offer(&bus, &broken, 6) == TM485_ERR_BAD_ARGUMENT);
        CHECK(tm485_bus_offer(&bus, &request, 7) == TM485_OK);
        CHECK(tm485_bus_offer(&bus, &request, 8) == TM485_ERR_BUSY);
        offered = true;
        continue;
      }
      if (tm485_bus_take_completion(&bus, &completion)) {
        CHECK(!done);
        done = true;
        CHECK(completion.ticket == 7 && completion.error == TM485_OK && completion.has_reply);
        CHECK(completion.request.id == TM485_ID_MULTI_TURN && completion.reply.id == TM485_ID_MULTI_TURN);
        CHECK(completion.reply.has_abm && completion.reply.turns >= 1 && !completion.reply.has_abs);
      }
      now = next_time(line, now, due < tick ? due : tick);
    }
    CHECK(done);
  }
  CHECK(tm485_bus_reply_expected(&bus) > 0);
  tm485_bus_statistics(&bus, &statistics);
  CHECK(statistics.servo_ticks > 500 && statistics.servo_locks == 1 && statistics.failed == 0);
  CHECK(statistics.background == 1 && statistics.t1.count > 1000 && statistics.t1.minimum >= TM485_US(40));

  /* Homed, then the encoder is restarted: start-up again, and no longer homed. */
  tm485_bus_latest(&bus, &sample);
  CHECK(!sample.referenced);
  tm485_bus_set_referenced(&bus, true);
  while (!sample.referenced && now < TM485_MS(400)) {
    now = next_time(line, now, tm485_bus_poll(&bus, now));
    tm485_bus_latest(&bus, &sample);
  }
  CHECK(sample.referenced);
  tm485_bus_on_restart(&bus, now);
  CHECK(tm485_bus_get_state(&bus) == TM485_STATE_STARTUP);
  return 0;
}

int use_dead_line(const test_line* line) {
  static tm485_profile profile;
  static tm485_bus bus;
  tm485_bus_config config;
  tm485_startup_stage stage = TM485_STAGE_DONE;
  tm485_time now = 0;
  CHECK(tm485_profile_init(&profile, "tm485_17") == TM485_OK);
  tm485_bus_config_default(&config);
  CHECK(tm485_bus_init(&bus, &line->port, &profile, &config) == TM485_OK);
  CHECK(tm485_bus_start(&bus, now, NULL) == TM485_OK);
  CHECK(tm485_bus_startup_error(&bus, &stage) == TM485_OK && stage == TM485_STAGE_DONE);
  while (now < TM485_MS(1500)) now = next_time(line, now, tm485_bus_poll(&bus, now));
  CHECK(tm485_bus_startup_error(&bus, &stage) == TM485_ERR_TIMEOUT && stage == TM485_STAGE_ANSWER);
  return 0;
}

/* A port that promises nothing and answers what no port may answer. */
static void bad_capability(void* context, tm485_port_capability* capability) {
  (void)context;
  capability->timing = 77;
}
static tm485_errc bad_send(void* context, const uint8_t* request, size_t count, tm485_time now,
                           tm485_time* start) {
  (void)request;
  (void)count;
  *start = now;
  return *(const int*)context == 1 ? 4711 : TM485_OK;
}
static tm485_transmission_state bad_transmission(void* context, tm485_time now, tm485_errc* fault) {
  (void)now;
  *fault = 4711;
  return *(const int*)context == 2 ? 99 : TM485_TRANSMISSION_SENT;
}
static void bad_receive(void* context, uint8_t* buffer, size_t size, tm485_time now,
                        tm485_reception* reception) {
  (void)buffer;
  (void)now;
  if (*(const int*)context == 3) reception->count = (uint32_t)size + 1;
  if (*(const int*)context == 4) reception->fault = 4711;
}

int use_bad_port(void) {
  static tm485_profile profile;
  static tm485_bus bus;
  tm485_bus_config config;
  int kind;
  CHECK(tm485_profile_init(&profile, "tm485_17") == TM485_OK);
  tm485_bus_config_default(&config);
  for (kind = 1; kind <= 4; ++kind) {
    tm485_port port;
    tm485_time now = 0;
    memset(&port, 0, sizeof port);
    port.context = &kind;
    port.capability = bad_capability;
    port.try_send = bad_send;
    port.transmission = bad_transmission;
    port.try_receive = bad_receive;
    CHECK(tm485_bus_init(&bus, &port, &profile, &config) == TM485_OK);
    CHECK(tm485_bus_start(&bus, 0, NULL) == TM485_OK);
    for (now = 0; now < TM485_MS(3000); now += TM485_US(20)) tm485_bus_poll(&bus, now);
    if (tm485_bus_error_count(&bus, TM485_ERR_PORT_GONE) == 0) return 1000 + kind;
  }
  return 0;
}
