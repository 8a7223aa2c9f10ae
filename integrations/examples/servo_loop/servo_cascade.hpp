// A position cascade as servo drives have it: P on the position, PI on the velocity, both with feed-forward, and a
// current command within a limit. And two smooth references to try it with.
//
// Plain numbers in revolutions, seconds and amperes: no heap, no clock, no I/O, and nothing of tm485.
#pragma once

#include <algorithm>
#include <cmath>
#include <numbers>

namespace servo {

/// Where the shaft should be at an instant. The position is double: a float has too few digits for a 23-bit encoder.
struct Setpoint {
  double rev = 0.0;
  float rev_per_s = 0.0F;
  float rev_per_s2 = 0.0F;
};

struct CascadeConfig {
  float period_s = 62.5e-6F;
  float position_gain = 0.0F;  ///< rev/s for one rev of error
  float velocity_gain = 0.0F;  ///< A for one rev/s of error
  float integral_time_s = 0.0F;
  float acceleration_gain = 0.0F;  ///< A for one rev/s²: the feed-forward
  float current_limit_amperes = 0.0F;

  /// For a rigid axis: crossover of the velocity loop at `velocity_hz`, of the position loop at a fifth of it. The
  /// current loop, the estimator and one period of dead time must be fast against it: 200 Hz at 16 kHz is cautious.
  static CascadeConfig rigid_axis(float inertia_kg_m2, float torque_constant, float current_limit_amperes,
                                  float velocity_hz, float period_s) noexcept {
    constexpr float kTurn = 2.0F * std::numbers::pi_v<float>;
    CascadeConfig config;
    config.period_s = period_s;
    config.acceleration_gain = inertia_kg_m2 * kTurn / torque_constant;
    config.velocity_gain = config.acceleration_gain * kTurn * velocity_hz;
    config.integral_time_s = 4.0F / (kTurn * velocity_hz);
    config.position_gain = kTurn * velocity_hz / 5.0F;
    config.current_limit_amperes = current_limit_amperes;
    return config;
  }
};

/// One axis, one context. Every function: constant time.
class ServoCascade {
 public:
  explicit ServoCascade(const CascadeConfig& config) noexcept : config_(config) {}

  /// Once a period: from the position error (reference less measured), the measured velocity and the reference to the
  /// current command in A.
  float step(float position_error_rev, float rev_per_s, const Setpoint& reference) noexcept {
    const float velocity_error = reference.rev_per_s + config_.position_gain * position_error_rev - rev_per_s;
    const float proportional =
        config_.velocity_gain * velocity_error + config_.acceleration_gain * reference.rev_per_s2;
    const float step = config_.velocity_gain * velocity_error * config_.period_s / config_.integral_time_s;
    const float limit = config_.current_limit_amperes;
    const float wanted = proportional + integral_ + step;
    const float command = std::clamp(wanted, -limit, limit);
    // Anti-windup: at the limit the integral goes towards the inside only.
    if (command == wanted || (wanted > 0.0F) != (step > 0.0F)) integral_ += step;
    return command;
  }

  /// Before the axis is switched on (again).
  void reset() noexcept { integral_ = 0.0F; }

 private:
  CascadeConfig config_;
  float integral_ = 0.0F;
};

/// To and fro without end: amplitude × (1 - cos), so that it starts at rest at 0 and turns back at twice the amplitude.
class Swing {
 public:
  Swing(double amplitude_rev, double frequency_hz) noexcept
      : amplitude_(amplitude_rev), rate_(2.0 * std::numbers::pi * frequency_hz) {}

  [[nodiscard]] Setpoint at(double seconds) const noexcept {
    const double sine = std::sin(rate_ * seconds);
    const double cosine = std::cos(rate_ * seconds);
    return {amplitude_ * (1.0 - cosine), static_cast<float>(amplitude_ * rate_ * sine),
            static_cast<float>(amplitude_ * rate_ * rate_ * cosine)};
  }

 private:
  double amplitude_;
  double rate_;
};

/// From point to point and back without end, with a rest at each: a polynomial of fifth order, so that velocity and
/// acceleration begin and end at 0.
class Moves {
 public:
  /// `distance_rev` may be negative; `top_rev_per_s` > 0 is reached half-way; `rest_s` >= 0.
  Moves(double distance_rev, double top_rev_per_s, double rest_s) noexcept
      : distance_(distance_rev), move_s_(1.875 * std::abs(distance_rev) / top_rev_per_s), rest_s_(rest_s) {}

  [[nodiscard]] Setpoint at(double seconds) const noexcept {
    const double leg = move_s_ + rest_s_;
    if (!(move_s_ > 0.0)) return {};
    const double legs = std::floor(seconds / leg);
    const bool back = std::fmod(legs, 2.0) != 0.0;
    const double s = std::min((seconds - legs * leg) / move_s_, 1.0);
    const double way = s * s * s * (10.0 + s * (6.0 * s - 15.0));
    const double slope = 30.0 * s * s * (1.0 - s) * (1.0 - s) / move_s_;
    const double bend = 60.0 * s * (1.0 - s) * (1.0 - 2.0 * s) / (move_s_ * move_s_);
    const double sign = back ? -1.0 : 1.0;
    return {distance_ * (back ? 1.0 - way : way), static_cast<float>(sign * distance_ * slope),
            static_cast<float>(sign * distance_ * bend)};
  }

 private:
  double distance_;
  double move_s_;
  double rest_s_;
};

}  // namespace servo
