#include "servo_plant.hpp"

#include <algorithm>
#include <numbers>

namespace tm485::cli {

void ServoPlant::advance(Time now) noexcept {
  ControlRecord record;
  while (records_.try_pop(record)) {
    turn(record.at);
    judge(record);
    commanded_ = record.at;
    if (!record.driving) off_ = false;
    command_ = record.driving && !off_ ? static_cast<double>(record.current_amperes) : 0.0;
  }
  turn(now);
  encoder_->model().set_motion(motor_.motion());
}

void ServoPlant::turn(Time until) noexcept {
  if (command_ != 0.0 && until - commanded_ > kWatchdog) {
    motor_.step(commanded_ + kWatchdog, command_);
    command_ = 0.0;
    ++findings_.watchdogs;
  }
  motor_.step(until, command_);
}

void ServoPlant::torque_off(Time now) noexcept {
  turn(now);
  command_ = 0.0;
  off_ = true;
}

/// In real time the shaft may have gone a little further than the record: its movement is traced back.
void ServoPlant::judge(const ControlRecord& record) noexcept {
  if (record.driving && !driving_) {
    held_since_ = record.at;
    smooth_ = static_cast<double>(record.current_amperes);
  }
  driving_ = record.driving;
  if (!record.driving) return;
  const double ago = static_cast<double>((motor_.time() - record.at).count()) * 1e-9;
  const double rev = motor_.motion().revolutions(record.at);
  const double rev_per_s = motor_.rev_per_s() - motor_.rev_per_s2() * ago;
  if (begun_ == kNever) {
    begun_ = record.at;
    turns_ = std::round(record.reference_rev - rev);
  }
  const double span = static_cast<double>((record.at - last_).count()) * 1e-9;
  last_ = record.at;
  const auto current = static_cast<double>(record.current_amperes);
  smooth_ += (current - smooth_) * (1.0 - std::exp(-2.0 * std::numbers::pi * kRippleHz * span));
  if (record.at - held_since_ < kSettle) return;
  findings_.tracking_rev.add(record.reference_rev - (rev + turns_));
  findings_.speed_rev_per_s.add(static_cast<double>(record.rev_per_s) - rev_per_s);
  findings_.ripple_amperes.add(current - smooth_);
  findings_.top_rev_per_s = std::max(findings_.top_rev_per_s, std::abs(rev_per_s));
}

}  // namespace tm485::cli
