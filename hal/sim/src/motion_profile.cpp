#include "tm485/sim/motion_profile.hpp"

#include <cmath>
#include <numbers>

namespace tm485::sim {
namespace {

constexpr double kSecondsPerMinute = 60.0;
constexpr double kNsPerSecond = 1e9;

}  // namespace

MotionProfile MotionProfile::constant(double rpm, double start_rev) noexcept {
  MotionProfile motion;
  motion.start_ = start_rev;
  motion.rate_ = rpm / kSecondsPerMinute / kNsPerSecond;
  return motion;
}

MotionProfile MotionProfile::sine(double amplitude_rev, double frequency_hz, double start_rev) noexcept {
  MotionProfile motion;
  motion.kind_ = Kind::sine;
  motion.start_ = start_rev;
  motion.rate_ = 2.0 * std::numbers::pi * frequency_hz;
  motion.speed_ = amplitude_rev;
  return motion;
}

MotionProfile MotionProfile::trapezoid(double max_rpm, double accel_rpm_per_s, double cruise_s,
                                       double start_rev) noexcept {
  MotionProfile motion;
  motion.kind_ = Kind::trapezoid;
  motion.start_ = start_rev;
  motion.speed_ = max_rpm / kSecondsPerMinute;
  motion.ramp_s_ = std::abs(max_rpm) / accel_rpm_per_s;
  motion.cruise_s_ = cruise_s;
  return motion;
}

MotionProfile MotionProfile::segment(Time from, double rev, double rev_per_s, double rev_per_s2) noexcept {
  MotionProfile motion;
  motion.kind_ = Kind::segment;
  motion.start_ = rev;
  motion.rate_ = rev_per_s2;
  motion.speed_ = rev_per_s;
  motion.from_ = from;
  return motion;
}

double MotionProfile::curved(Time time) const noexcept {
  if (kind_ == Kind::segment) {
    const double span = static_cast<double>((time - from_).count()) / kNsPerSecond;
    return start_ + (speed_ + 0.5 * rate_ * span) * span;
  }
  const double seconds = static_cast<double>(time.count()) / kNsPerSecond;
  if (kind_ == Kind::sine) return start_ + speed_ * std::sin(rate_ * seconds);

  const double leg = 2.0 * ramp_s_ + cruise_s_;
  if (leg <= 0.0) return start_;  // a top speed of 0: the shaft rests
  double within = std::fmod(seconds, 2.0 * leg);
  if (within < 0.0) within += 2.0 * leg;
  // The way back is the way out run backwards in time.
  if (within > leg) within = 2.0 * leg - within;

  if (ramp_s_ <= 0.0) return start_ + speed_ * within;
  const double accel = speed_ / ramp_s_;
  const double ramp_rev = 0.5 * speed_ * ramp_s_;
  if (within <= ramp_s_) return start_ + 0.5 * accel * within * within;
  if (within <= ramp_s_ + cruise_s_) return start_ + ramp_rev + speed_ * (within - ramp_s_);
  const double left = leg - within;
  return start_ + 2.0 * ramp_rev + speed_ * cruise_s_ - 0.5 * accel * left * left;
}

}  // namespace tm485::sim
