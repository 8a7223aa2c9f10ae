// The shaft that tests of the plausibility gate have: 17 bit, and limits.
#pragma once

#include <cstdint>

#include "tm485/motion/axis_config.hpp"

namespace tm485::test::gate {

inline constexpr unsigned kBits = 17;
inline constexpr double kTurn = 131'072.0;

inline AxisConfig limits(std::int32_t rpm = 6'000, std::int32_t rpm_s = 1'000'000) {
  AxisConfig axis;
  axis.max_speed_rpm = rpm;
  axis.max_acceleration_rpm_s = rpm_s;
  return axis;
}

}  // namespace tm485::test::gate
