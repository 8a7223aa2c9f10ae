/* An axis and its servo loop, from C. Both contexts take turns here. */
#include <string.h>

#include "program.h"

typedef struct torque {
  unsigned raised;
  tm485_time at;
} torque;

static void torque_off(void* context, tm485_time now) {
  torque* const self = (torque*)context;
  ++self->raised;
  self->at = now;
}

static void set_up(tm485_axis_setup* setup, torque* off) {
  tm485_axis_setup_default(setup);
  tm485_bus_config_cycle(&setup->bus, TM485_ID_SINGLE_TURN, 62500);
  setup->bus.phase = TM485_PHASE_SERVO;
  setup->bus.servo_period = 62500;
  setup->bus.servo_lead = TM485_US(35);
  setup->bus.max_hold = TM485_MS(1);
  setup->gains = &kGains;
  setup->on_invalid = torque_off;
  setup->on_invalid_context = off;
}

int use_axis(const test_line* line, tm485_time cut, tm485_time mended, double counts_per_second,
             loop_account* account) {
  static tm485_profile profile;
  static tm485_axis axis;
  tm485_axis_setup setup;
  tm485_feasibility feasibility;
  tm485_loop_view view;
  tm485_sample sample;
  tm485_estimate estimate;
  torque off = {0, 0};
  tm485_time tick = 62500;
  tm485_time now = 0;
  bool posted = false;
  uint32_t ticket = 0;
  memset(account, 0, sizeof *account);

  CHECK(tm485_profile_init(&profile, "tm485_17") == TM485_OK);
  set_up(&setup, &off);
  CHECK(tm485_axis_init(&axis, &line->port, &profile, &setup) == TM485_OK);
  CHECK(tm485_axis_check(&axis, &feasibility, NULL) == TM485_OK && feasibility.slot == 62500);
  CHECK(tm485_axis_start(&axis, now, NULL) == TM485_OK);
  CHECK(tm485_loop_read(&axis, now, &sample) == TM485_VALIDITY_INVALID);
  tm485_loop_estimate_at(&axis, now, &estimate);
  CHECK(!tm485_estimate_valid(&estimate));

  while (now < mended + TM485_MS(400)) {
    tm485_time due;
    if (now >= tick) { /* the servo loop's context */
      tm485_command_result result;
      const tm485_validity validity = tm485_loop_read(&axis, now, &sample);
      tm485_loop_servo_tick(&axis, tick);
      tick += 62500;
      tm485_loop_get_view(&axis, &view);
      while (tm485_loop_poll_completion(&axis, &result)) {
        CHECK(result.command == TM485_COMMAND_RESUME && result.error == TM485_OK && result.ticket == ticket);
        CHECK(!result.has_reply);
        account->resumed_at = now;
      }
      if (validity == TM485_VALIDITY_FRESH) {
        ++account->fresh;
        CHECK(sample.quality == TM485_QUALITY_FRESH && view.valid && view.state == TM485_STATE_RUNNING);
        tm485_loop_estimate_at(&axis, now, &estimate);
        CHECK(estimate.time == now);
        if (account->fresh > 200 && tm485_estimate_valid(&estimate)) {
          /* The shaft turns at one speed, so what the estimate adds to the sample is known. */
          const double wanted = counts_per_second * (double)tm485_sample_age(&sample, now) * 1e-9;
          double error = (double)tm485_estimate_from(&estimate, sample.position) - wanted;
          if (error < 0) error = -error;
          if (now < cut && error > account->largest_error) account->largest_error = error;
        }
      } else if (validity == TM485_VALIDITY_EXTRAPOLATED) {
        ++account->extrapolated;
      } else {
        ++account->invalid;
        if (view.latched && !posted && now > mended + TM485_MS(300)) {
          CHECK(tm485_loop_post(&axis, TM485_COMMAND_RESUME, NULL, &ticket) == TM485_OK);
          posted = true;
        }
      }
    }
    due = tm485_axis_poll(&axis, now); /* the bus's */
    now = next_time(line, now, due < tick ? due : tick);
  }
  account->raised = off.raised;
  account->raised_at = off.at;
  CHECK(tm485_loop_statistics(&axis, &account->statistics));
  tm485_axis_stop(&axis, now);
  CHECK(tm485_loop_read(&axis, now, NULL) == TM485_VALIDITY_INVALID);
  return 0;
}

int use_axis_commands(const test_line* line) {
  static tm485_profile profile;
  static tm485_axis axis;
  tm485_axis_setup setup;
  tm485_request request;
  tm485_request broken;
  tm485_command_result result;
  tm485_time now = 0;
  torque off = {0, 0};
  uint32_t ticket = 0;
  uint32_t exchange = 0;
  uint32_t referenced = 0;
  unsigned done = 0;
  unsigned i;
  tm485_sample sample;

  CHECK(tm485_profile_init(&profile, "tm485_17") == TM485_OK);
  set_up(&setup, &off);
  setup.bus.phase = TM485_PHASE_ANY;
  tm485_bus_config_cycle(&setup.bus, TM485_ID_SINGLE_TURN, TM485_US(125));
  CHECK(tm485_axis_init(&axis, &line->port, &profile, &setup) == TM485_OK);
  CHECK(tm485_axis_start(&axis, now, NULL) == TM485_OK);
  while (tm485_bus_get_state(tm485_axis_bus(&axis)) != TM485_STATE_RUNNING && now < TM485_MS(1000))
    now = next_time(line, now, tm485_axis_poll(&axis, now));
  CHECK(tm485_request_make(&request, TM485_ID_EVERYTHING) == TM485_OK);
  broken = request;
  broken.length = 9;
  CHECK(tm485_loop_post(&axis, TM485_COMMAND_EXCHANGE, &broken, &ticket) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_loop_post(&axis, TM485_COMMAND_EXCHANGE, NULL, &ticket) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_loop_post(&axis, TM485_COMMAND_RESTART + 1, NULL, &ticket) == TM485_ERR_BAD_ARGUMENT);
  CHECK(tm485_loop_post(&axis, TM485_COMMAND_EXCHANGE, &request, &exchange) == TM485_OK);
  CHECK(tm485_loop_post(&axis, TM485_COMMAND_SET_REFERENCED, NULL, &referenced) == TM485_OK);
  for (i = 0; i < TM485_AXIS_COMMANDS - 2; ++i)
    CHECK(tm485_loop_post(&axis, TM485_COMMAND_EXCHANGE, &request, NULL) == TM485_OK);
  CHECK(tm485_loop_post(&axis, TM485_COMMAND_EXCHANGE, &request, &ticket) == TM485_ERR_BUSY);
  while (done < TM485_AXIS_COMMANDS && now < TM485_MS(1000)) {
    now = next_time(line, now, tm485_axis_poll(&axis, now));
    while (tm485_loop_poll_completion(&axis, &result)) {
      ++done;
      CHECK(result.error == TM485_OK);
      CHECK((result.command == TM485_COMMAND_SET_REFERENCED) == (result.ticket == referenced));
      CHECK(result.has_reply == (result.command == TM485_COMMAND_EXCHANGE));
      if (result.has_reply) {
        CHECK(result.request.id == TM485_ID_EVERYTHING && result.reply.has_almc && result.reply.turns >= 1);
      }
    }
  }
  CHECK(done == TM485_AXIS_COMMANDS);
  CHECK(exchange != 0 && tm485_loop_read(&axis, now, &sample) != TM485_VALIDITY_INVALID && sample.referenced);

  /* The encoder is restarted. */
  CHECK(tm485_loop_post(&axis, TM485_COMMAND_RESTART, NULL, NULL) == TM485_OK);
  tm485_axis_poll(&axis, now);
  CHECK(tm485_loop_poll_completion(&axis, &result) && result.command == TM485_COMMAND_RESTART);
  CHECK(tm485_bus_get_state(tm485_axis_bus(&axis)) == TM485_STATE_STARTUP);
  CHECK(tm485_loop_read(&axis, now, &sample) == TM485_VALIDITY_INVALID && off.raised == 1);
  return 0;
}
