// One run of `tm485 servo-demo`: a 16 kHz position cascade on a simulated motor, over the whole stack.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "problem.hpp"
#include "servo_cascade.hpp"
#include "servo_plant.hpp"
#include "tm485/bus/statistics.hpp"
#include "tm485/linux/realtime_thread.hpp"
#include "tm485/motion/estimator_gains.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/sim/sim_options.hpp"

namespace tm485::cli {

/// What the cascade is closed with.
enum class Feedback : std::uint8_t {
  raw,        ///< the newest sample, and the difference of the last two
  estimator,  ///< both estimated at the control instant
};
[[nodiscard]] constexpr std::string_view name(Feedback feedback) {
  return feedback == Feedback::raw ? "raw" : "estimator";
}

/// The period of the servo loop, by its own clock.
inline constexpr Time kServoPeriod{62'500};

using Reference = std::variant<servo::Swing, servo::Moves>;
[[nodiscard]] inline servo::Setpoint reference_at(const Reference& reference, double seconds) noexcept {
  return std::visit([seconds](const auto& motion) { return motion.at(seconds); }, reference);
}

struct ServoSettings {
  sim::SimOptions encoder;
  CompiledProfile profile;
  DataId id;
  bool virtual_time = false;
  std::optional<int> priority =
      std::nullopt;  ///< of both threads in real time, as in RealtimeOptions; none: see run_servo
  Time duration;
  Time servo_period = kServoPeriod;  ///< by the clock of the bus: with drift
  Reference reference;
  servo::CascadeConfig cascade;
  sim::MotorConfig motor;
  double load_newton_m = 0.0;
  EstimatorGains gains;
  Time hold;
  Time outage{0};  ///< no reply reaches the host for this long, from the middle of the run; 0: none
};

/// Periods of the servo loop by what it was told.
struct PeriodCounts {
  std::uint64_t waiting = 0;  ///< before the axis could first be switched on
  std::uint64_t fresh = 0;
  std::uint64_t extrapolated = 0;
  std::uint64_t invalid = 0;  ///< torque off
  std::uint64_t latched = 0;  ///< of these: with a good sample, waiting for the command
};

struct ServoRun {
  Feedback feedback;
  PlantFindings plant;
  PeriodCounts periods;
  std::uint32_t torque_offs = 0;  ///< times that the axis became invalid
  std::uint32_t recoveries = 0;   ///< and was switched on again, by command
  Time lead{0};                   ///< latch to control instant, nominally
  Statistics statistics;
  std::uint64_t t1_violations = 0;  ///< by the encoder model's count
  Time smallest_t1_margin = kNever;
  Time measured{0};
  // Real time only.
  TimeStatistic lateness;       ///< of the control instants
  std::uint64_t skipped = 0;    ///< control instants that were missed
  std::uint64_t overflows = 0;  ///< commands that the plant did not take in time
  std::vector<linux_hal::RealtimeWarning> warnings;
};

/// Real time: bus and servo loop spin in a thread each. Without a given priority a thread gets an isolated core and
/// SCHED_FIFO if there is such a core for it, otherwise ordinary scheduling: on a core with other work the kernel
/// stops a real-time thread that never sleeps for 50 ms of every second.
/// Runs until the duration has passed or Ctrl-C. Problems: the pattern is refused, start-up fails, no thread.
[[nodiscard]] std::expected<ServoRun, Problem> run_servo(const ServoSettings& settings, Feedback feedback);

}  // namespace tm485::cli
