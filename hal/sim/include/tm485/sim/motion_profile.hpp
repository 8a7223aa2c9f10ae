// What the simulated shaft does: its angle as a function of time.
#pragma once

#include <cstdint>

#include "tm485/time.hpp"

namespace tm485::sim {

/// A shaft movement, unwrapped: revolutions since angle zero, positive = counter-clockwise seen from the
/// output shaft. A value type; every function is pure. Double precision resolves one count of a 23-bit
/// encoder up to 10^9 revolutions.
class MotionProfile {
 public:
  /// At rest at angle zero.
  constexpr MotionProfile() noexcept = default;

  /// Constant speed in revolutions a minute, from the angle `start_rev` at time 0.
  [[nodiscard]] static MotionProfile constant(double rpm, double start_rev = 0.0) noexcept;

  /// start_rev + amplitude_rev * sin(2 pi frequency_hz t).
  [[nodiscard]] static MotionProfile sine(double amplitude_rev, double frequency_hz,
                                          double start_rev = 0.0) noexcept;

  /// Back and forth for ever: accelerates at `accel_rpm_per_s` to `max_rpm`, holds it for `cruise_s`, brakes
  /// to rest, and returns to `start_rev` the same way. `max_rpm` may be negative (clockwise first);
  /// `accel_rpm_per_s` > 0, `cruise_s` >= 0.
  [[nodiscard]] static MotionProfile trapezoid(double max_rpm, double accel_rpm_per_s, double cruise_s,
                                               double start_rev = 0.0) noexcept;

  /// A piece of a movement that something else works out, for example a motor: at the instant `from` at the
  /// angle `rev`, with this speed and a constant acceleration. It goes on like that before and after; steer
  /// the shaft by setting the next piece (EncoderModel::set_motion) before it has drifted away.
  [[nodiscard]] static MotionProfile segment(Time from, double rev, double rev_per_s,
                                             double rev_per_s2) noexcept;

  /// Angle at `time`, in revolutions.
  [[nodiscard]] double revolutions(Time time) const noexcept {
    return kind_ == Kind::constant ? start_ + rate_ * static_cast<double>(time.count()) : curved(time);
  }

  /// Angle at `time` in counts of an encoder of 2^single_turn_bits counts a turn, rounded towards minus
  /// infinity, as an encoder that is within count n reports n. `single_turn_bits` 1..24.
  [[nodiscard]] std::int64_t counts(Time time, unsigned single_turn_bits) const noexcept {
    const double exact = revolutions(time) * static_cast<double>(std::uint32_t{1} << single_turn_bits);
    const auto truncated = static_cast<std::int64_t>(exact);
    return truncated - (static_cast<double>(truncated) > exact ? 1 : 0);
  }

 private:
  enum class Kind : std::uint8_t { constant, sine, trapezoid, segment };

  [[nodiscard]] double curved(Time time) const noexcept;

  Kind kind_ = Kind::constant;
  double start_ = 0.0;   // revolutions
  double rate_ = 0.0;    // revolutions per ns (constant), per s² (segment); radians per s (sine)
  double speed_ = 0.0;   // amplitude in revolutions (sine); revolutions per s (top speed; segment)
  double ramp_s_ = 0.0;  // seconds from rest to the top speed
  double cruise_s_ = 0.0;
  Time from_{0};  // where a segment has its angle
};

}  // namespace tm485::sim
