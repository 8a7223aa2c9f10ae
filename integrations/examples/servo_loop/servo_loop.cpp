// Closes a 16 kHz position loop on a simulated motor and encoder, in virtual time. The cable is off for 10 ms.
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "servo_cascade.hpp"
#include "tm485/bus/axis.hpp"
#include "tm485/design/estimator_design.hpp"
#include "tm485/sim/motor_model.hpp"
#include "tm485/sim/simulated_encoder.hpp"

using namespace std::chrono_literals;
using tm485::Time;

constexpr Time kPeriod = 62500ns;
constexpr float kCountsPerRev = 131072.0F;
constexpr double kDegPerCount = 360.0 / 131072.0;

// The servo loop. In a drive it runs in an interrupt or thread of its own; all that it touches is the client.
struct ServoLoop {
  tm485::AxisClient& client;
  servo::ServoCascade cascade{servo::CascadeConfig::rigid_axis(5e-5F, 0.5F, 8.0F, 200.0F, 62.5e-6F)};
  servo::Swing swing{0.25, 2.0};
  Time holding_since = tm485::kNever;  // kNever: torque off
  unsigned fresh = 0, extrapolated = 0, off = 0;
  float largest_error = 0.0F;
  bool resume_wanted = false;  // the operator's button

  // The current command in A for the period that begins now.
  float control(Time now) {
    client.servo_tick(now);  // the bus keeps its phase to these
    while (const auto done = client.poll_completion())
      std::printf("%6.1f ms  command %u: %s\n", ms(now), static_cast<unsigned>(done->ticket),
                  done->error == tm485::Errc::ok ? "ok" : "refused");

    const tm485::LoopState state = client.read(now);
    const tm485::Estimate shaft = client.estimate_at(now);  // at this instant, not at that of the sample
    if (!state.usable() || !shaft.valid()) {
      if (holding_since != tm485::kNever) std::printf("%6.1f ms  invalid: torque off\n", ms(now));
      holding_since = tm485::kNever;  // and stays: what was lost does not come back by itself
      ++off;
      if (resume_wanted && client.post(tm485::Command::of(tm485::Command::Kind::resume)))
        resume_wanted = false;
      return 0.0F;
    }
    ++(state.validity == tm485::SampleValidity::fresh ? fresh : extrapolated);
    if (holding_since == tm485::kNever) {  // take hold where the shaft is: no jump
      std::printf("%6.1f ms  torque on at %.0f deg\n", ms(now),
                  kDegPerCount * static_cast<double>(shaft.position));
      holding_since = now;
      origin = shaft.position;
      cascade.reset();
    }
    const servo::Setpoint setpoint = swing.at(ms(now - holding_since) * 1e-3);
    const auto wanted = static_cast<float>(setpoint.rev) * kCountsPerRev;
    const float error = wanted - shaft.position_from(origin);
    largest_error = std::max(largest_error, std::abs(error));
    return cascade.step(error / kCountsPerRev, shaft.velocity / kCountsPerRev, setpoint);
  }

  static double ms(Time time) { return static_cast<double>(time.count()) * 1e-6; }
  std::int64_t origin = 0;
};

// The cable is off from 300 to 310 ms: no reply gets through.
struct Unplugged : tm485::sim::FaultHook {
  bool on_burst(tm485::sim::Burst& burst) noexcept override {
    const bool lost =
        burst.talker == tm485::sim::Talker::encoder && burst.start > 300ms && burst.start < 310ms;
    if (lost) burst.count = 0;
    return lost;
  }
};

int main() {
  const auto profile = tm485::CompiledProfile::compile(*tm485::find_profile("tm485_17"));
  tm485::sim::SimulatedEncoder encoder;
  tm485::sim::MotorModel motor;
  Unplugged unplugged;
  encoder.line().set_fault_hook(&unplugged);

  // Configure. Each position is latched 35 us before the loop's tick, so that it is there by then.
  const auto design = tm485::design::solve_for_bandwidth({.order = 3, .period = kPeriod}, 1000.0);
  tm485::AxisSetup setup;
  setup.bus.cycle = tm485::Cycle{.id = tm485::DataId::single_turn, .period = kPeriod};
  setup.bus.phase = tm485::Phase::locked_to({.period = kPeriod, .lead = 35us});
  setup.bus.max_hold = 1ms;  // so long the loop goes on by the estimate alone
  setup.gains = &design->gains;
  bool enabled = true;  // the hardware's torque enable: off at once, whatever the loop is doing
  setup.on_invalid = {[](void* enable, Time) { *static_cast<bool*>(enable) = false; }, &enabled};

  // Start. The axis belongs to the bus's context, a thread or a timer interrupt; its client to the servo loop.
  tm485::Axis axis(encoder.port(), *profile, setup);
  // A pattern that cannot be kept is refused: why, and what could.
  if (const auto started = axis.start(Time{0}); !started) {
    const auto& why = tm485::describe(started.error().code);
    std::printf("refused: %s; nearest possible: %lld ns\n", why.cause.data(),
                static_cast<long long>(started.error().nearest.count()));
    return 1;
  }
  ServoLoop loop{axis.client()};

  Time tick = kPeriod;
  float current = 0.0F;
  for (Time now{0}; now < 600ms;) {
    if (now >= tick) {  // the servo loop's context
      loop.resume_wanted |= tick == 350ms;
      current = loop.control(now);
      enabled |= loop.holding_since == now;
      tick += kPeriod;
    }
    motor.step(now, enabled ? static_cast<double>(current) : 0.0);
    encoder.model().set_motion(motor.motion());
    const Time due = axis.poll(now);  // the bus's context
    const Time event = encoder.line().next_event();
    now = std::max(now, std::min({due, tick, event > now ? event : tick}));
  }
  std::printf("%u fresh, %u extrapolated, %u off; largest error %.0f counts; T1 violations %llu\n",
              loop.fresh, loop.extrapolated, loop.off, static_cast<double>(loop.largest_error),
              static_cast<unsigned long long>(encoder.model().t1().violations()));
  return encoder.model().t1().violations() == 0 ? 0 : 1;
}
