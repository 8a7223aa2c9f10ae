#include "node.h"

#include "board.h"
#include "clock.h"
#include "core_interrupts.h"
#include "cortex_m.h"
#include "encoder_port.h"

/* Everything that the library needs, in storage of ours. Nothing is allocated. */
static tm485_profile profile;
static tm485_axis axis;
static tm485_eeprom eeprom;
static encoder_port line;
static tm485_port port;

/* A third-order estimator of a bandwidth of 0.075 / period: 1.2 kHz at 62.5 us, 15 Hz at 5 ms. Printed by a host's program:
   tm485::design::solve_for_bandwidth. Its numbers are in periods, so they hold for any. */
static tm485_estimator_gains gains = {
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

/* Between the contexts: one writes each, and all are of one word or less. */
typedef enum eeprom_step { EEPROM_IDLE, EEPROM_WANTED, EEPROM_READING, EEPROM_DONE } eeprom_step;
static volatile eeprom_step eeprom_at;
static volatile bool resume_wanted;
static bool running;

static node_shown shown; /* control writes it, main copies it with interrupts off */
static uint8_t eeprom_bytes[NODE_EEPROM_BYTES];
static tm485_time control_every;
static tm485_time next_control;

/* In a drive: the pin that enables the torque, off at once and here. These boards have no motor. */
static void torque_off(void* context, tm485_time now) {
  (void)context;
  (void)now;
}

tm485_errc node_start(tm485_time period, tm485_time allowance, tm485_refusal* refusal) {
  tm485_axis_setup setup;
  tm485_errc error;
  refusal->nearest = 0;
  if (running) return TM485_ERR_BUSY;
  error = encoder_port_start(&line, &port, allowance);
  if (error == TM485_OK) error = tm485_profile_init(&profile, "tm485_17");
  if (error != TM485_OK) return error;
  gains.period = period;
  tm485_axis_setup_default(&setup);
  tm485_bus_config_cycle(&setup.bus, TM485_ID_EVERYTHING, period);
  setup.bus.max_hold = 16 * period + 2 * allowance;
  setup.bus.eeprom_may_hold = 1; /* a page select takes 18 ms of the line */
  setup.gains = &gains;
  setup.on_invalid = torque_off;
  error = tm485_axis_init(&axis, &port, &profile, &setup);
  if (error == TM485_OK) error = tm485_eeprom_init(&eeprom, &profile, NULL, NULL, 0);
  if (error == TM485_OK) error = tm485_axis_start(&axis, clock_now(), refusal);
  if (error != TM485_OK) return error;

  static const unsigned kInterrupts[] = {BOARD_ENCODER_INTERRUPTS};
  running = true;
  control_every = period;
  next_control = clock_now();
  core_interrupts_start();
  for (size_t i = 0; i < sizeof kInterrupts / sizeof kInterrupts[0]; ++i)
    interrupt_on(kInterrupts[i], PRIORITY_BUS);
  bus_timer_in(0);
  return TM485_OK;
}

/* ---- The bus's context ---- */

static tm485_time earlier(tm485_time a, tm485_time b) { return a < b ? a : b; }

/* Answers when to call again at the latest. */
static tm485_time bus_step(tm485_time now) {
  tm485_time due;
  if (eeprom_at == EEPROM_WANTED) {
    const tm485_errc begun = tm485_eeprom_start_read(&eeprom, 0, eeprom_bytes, sizeof eeprom_bytes);
    eeprom_at = begun == TM485_OK ? EEPROM_READING : EEPROM_DONE;
  }
  due = tm485_axis_poll(&axis, now);
  due = earlier(due, tm485_eeprom_drive(&eeprom, tm485_axis_bus(&axis), now));
  if (eeprom_at == EEPROM_READING && !tm485_eeprom_active(&eeprom)) eeprom_at = EEPROM_DONE;
  return earlier(due, encoder_port_due(&line, now));
}

/* A call without cause is harmless, so both interrupts do the same. */
static void bus_context(void) {
  const tm485_time now = clock_now();
  encoder_port_interrupt(&line, now);
  if (now >= next_control) {
    control_now(); /* preempts this */
    while (next_control <= now) next_control += control_every;
  }
  bus_timer_in(earlier(bus_step(now), next_control) - clock_now());
}

void on_bus_timer(void) { bus_context(); }
void on_encoder_uart(void) { bus_context(); }

/* ---- The control loop's context ---- */

void on_control(void) {
  const tm485_time now = clock_now();
  tm485_command_result result;
  shown.validity = tm485_loop_read(&axis, now, &shown.sample);
  tm485_loop_estimate_at(&axis, now, &shown.shaft); /* at this instant, not at that of the sample */
  tm485_loop_get_view(&axis, &shown.view);
  ++shown.ticks;
  if (shown.validity == TM485_VALIDITY_FRESH) ++shown.fresh;
  /* A drive goes on here: the position loop with shown.shaft, torque only while it is not TM485_VALIDITY_INVALID. */

  if (resume_wanted && tm485_loop_post(&axis, TM485_COMMAND_RESUME, NULL, NULL) == TM485_OK)
    resume_wanted = false;
  while (tm485_loop_poll_completion(&axis, &result)) {
  }
}

/* ---- Main ---- */

bool node_running(void) { return running; }

void node_get_shown(node_shown* to) {
  const uint32_t state = interrupts_off();
  *to = shown;
  interrupts_back(state);
}

bool node_statistics(tm485_statistics* statistics) { return tm485_loop_statistics(&axis, statistics); }

void node_resume(void) { resume_wanted = true; }

bool node_read_eeprom(void) {
  if (eeprom_at != EEPROM_IDLE) return false;
  eeprom_at = EEPROM_WANTED;
  return true;
}

bool node_take_eeprom(tm485_eeprom_outcome* outcome, const uint8_t** bytes) {
  if (eeprom_at != EEPROM_DONE) return false;
  if (!tm485_eeprom_get_outcome(&eeprom, outcome)) outcome->code = TM485_ERR_BAD_ARGUMENT;
  *bytes = eeprom_bytes;
  eeprom_at = EEPROM_IDLE;
  return true;
}
