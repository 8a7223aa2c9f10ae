// A shaft that is driven as hard as its limits allow, and says where it is.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "judge.hpp"
#include "noise.hpp"

namespace residual {

/// Full acceleration one way, the other way or none, for 10 us to 10 ms each; never faster than its greatest speed.
class Shaft {
 public:
  Shaft(double rpm, double rpm_s, Random& random)
      : fastest_(rpm / 60 * kTurn), steepest_(rpm_s / 60 * kTurn), random_(random) {}

  void advance(double seconds) {
    while (seconds > 0) {
      if (left_ <= 0) {
        left_ = 1e-5 * std::exp2(10 * random_.uniform());
        acceleration_ = steepest_ * (static_cast<double>(random_.below(3)) - 1);
      }
      double step = std::min(seconds, left_);
      if (acceleration_ != 0) {
        const double until = ((acceleration_ > 0 ? fastest_ : -fastest_) - speed_) / acceleration_;
        if (until <= 0) {
          acceleration_ = 0;
          speed_ = speed_ < 0 ? -fastest_ : fastest_;
        } else {
          step = std::min(step, until);
        }
      }
      position_ += (speed_ + acceleration_ * step / 2) * step;
      speed_ += acceleration_ * step;
      seconds -= step;
      left_ -= step;
    }
    while (position_ > kFar) position_ -= 2 * kFar;  // turns and ABS wrap there as well
    while (position_ < -kFar) position_ += 2 * kFar;
  }
  [[nodiscard]] double position() const { return position_; }
  /// A little before or after.
  [[nodiscard]] double position_at(double offset) const { return position_ + speed_ * offset; }

 private:
  static constexpr double kTurn = 1U << kAbsBits;
  static constexpr double kFar = static_cast<double>(std::int64_t{1} << (kPositionBits - 1));
  double fastest_;
  double steepest_;
  double position_ = 0;
  double speed_ = 0;
  double acceleration_ = 0;
  double left_ = 0;
  Random& random_;
};

}  // namespace residual
