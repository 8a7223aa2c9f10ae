#include "tm485/sim/motor_model.hpp"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace tm485::sim {
namespace {

constexpr double kTurn = 2.0 * std::numbers::pi;

constexpr double seconds_of(Time span) noexcept { return static_cast<double>(span.count()) * 1e-9; }

double decay_over(double seconds, double lag_s) noexcept {
  return lag_s > 0.0 ? std::exp(-seconds / lag_s) : 0.0;
}

}  // namespace

MotorModel::MotorModel(const MotorConfig& config, Time start) noexcept
    : config_{config},
      lag_s_{seconds_of(config.current_lag)},
      decay_{decay_over(seconds_of(kSubStep), lag_s_)},
      time_{start},
      angle_{config.start_rev * kTurn} {}

void MotorModel::step(Time until, double command_amperes) noexcept {
  const double target =
      std::clamp(command_amperes, -config_.current_limit_amperes, config_.current_limit_amperes);
  for (; until - time_ >= kSubStep; time_ += kSubStep) sub_step(seconds_of(kSubStep), target, decay_);
  if (until <= time_) return;
  const double rest = seconds_of(until - time_);
  sub_step(rest, target, decay_over(rest, lag_s_));
  time_ = until;
}

/// The current relaxes towards its target by an exponential; what turns the shaft is its exact mean.
void MotorModel::sub_step(double seconds, double target_amperes, double decay) noexcept {
  const double mean = target_amperes + (current_ - target_amperes) * (1.0 - decay) * lag_s_ / seconds;
  current_ = target_amperes + (current_ - target_amperes) * decay;
  turn(seconds, config_.torque_constant * mean - load_);
}

/// Coulomb friction against the movement; at rest against the drive, and never more than that.
double MotorModel::friction(double drive_newton_m) const noexcept {
  if (speed_ != 0.0) return std::copysign(config_.coulomb_newton_m, speed_);
  return std::clamp(drive_newton_m, -config_.coulomb_newton_m, config_.coulomb_newton_m);
}

/// Trapezoidal rule, cut where the speed passes zero: there the friction changes sides, or holds the shaft.
void MotorModel::turn(double seconds, double drive_newton_m) noexcept {
  const double damping = 0.5 * seconds * config_.viscous_newton_m_s / config_.inertia_kg_m2;
  const double gain = seconds * (drive_newton_m - friction(drive_newton_m)) / config_.inertia_kg_m2;
  const double speed = (speed_ * (1.0 - damping) + gain) / (1.0 + damping);
  if (speed_ * speed < 0.0) {
    const double before_zero = seconds * speed_ / (speed_ - speed);
    angle_ += 0.5 * before_zero * speed_;
    speed_ = 0.0;
    turn(seconds - before_zero, drive_newton_m);  // from rest there is no second zero
    return;
  }
  angle_ += 0.5 * seconds * (speed_ + speed);
  speed_ = speed;
}

double MotorModel::rev() const noexcept { return angle_ / kTurn; }
double MotorModel::rev_per_s() const noexcept { return speed_ / kTurn; }

double MotorModel::rev_per_s2() const noexcept {
  const double drive = torque_newton_m() - load_;
  return (drive - friction(drive) - config_.viscous_newton_m_s * speed_) / config_.inertia_kg_m2 / kTurn;
}

}  // namespace tm485::sim
