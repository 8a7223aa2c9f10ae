// What the node starts with; `start` on the console takes others.
#pragma once

#include "tm485/motion/estimator_gains.hpp"
#include "tm485/time.hpp"

namespace servo_node {

/// Start-up parameters.
struct Parameters {
  tm485::Time period{62'500};    ///< request start to request start
  tm485::Time allowance{4'000};  ///< last stop bit on the wire until the software has the byte, at most
};

/// A second-order estimator wants to know how the shaft moves. Printed by tm485::design::solve_for_bandwidth for
/// {.order = 3} and a bandwidth of 0.075 / period: 1.2 kHz at 62.5 us, 15 Hz at 5 ms. Its numbers are in periods, so
/// they hold for any.
[[nodiscard]] constexpr tm485::EstimatorGains gains_for(tm485::Time period) noexcept {
  tm485::EstimatorGains gains;
  gains.period = period;
  gains.order = 3;
  gains.longest_gap = 32;
  gains.gain = {0.434364766F, 0.122919776F, 0.0173923783F};
  gains.covariance = {0.0361970626F,  0.0102433152F,   0.00144936482F,
                      0.00482595898F, 0.000959232741F, 0.0002926827F};
  gains.process_noise = 4.45656478e-05F;
  gains.measurement_variance = 0.0833333358F;
  return gains;
}
static_assert(valid(gains_for(tm485::Time{62'500})));

}  // namespace servo_node
