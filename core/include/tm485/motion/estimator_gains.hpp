// EstimatorGains: everything the estimators need to know about the model and its noise, as plain data.
//
// tm485::design solves them (on a host, or once at start-up); they may also stand as a constant in flash.
// Inside, the unit of time is the nominal period: velocity is in counts per period, acceleration in counts
// per period squared, so that the gains are plain numbers near or below one. docs/estimator.md has the model.
#pragma once

#include <cstdint>

#include "tm485/motion/state_covariance.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// Trivially copyable; the estimators keep a reference.
struct EstimatorGains {
  using Gain = StateCovariance<float>::Gain;

  Time period{0};                     ///< nominal distance of two samples; 1 µs to 33 ms
  std::uint8_t order = 2;             ///< states: 2 (position, velocity) or 3 (and acceleration)
  std::uint8_t longest_gap = 32;      ///< after more periods without a sample start anew; 2 to 32
  Gain gain;                          ///< of the steady state: what one count of innovation adds
  StateCovariance<float> covariance;  ///< of the steady state, after a sample
  float process_noise = 0;            ///< density, counts² per period^(2 order - 1)
  float measurement_variance = 0;     ///< of one sample, counts²
  float acceleration_variance = 0;    ///< at a start, (counts per period²)²; 0: at rest or at constant speed
};

/// Where an estimator stands.
enum class EstimatorState : std::uint8_t {
  empty,     ///< no sample yet, or `reset`
  starting,  ///< one sample: a position, no velocity
  lost,      ///< no sample for longer than the longest gap; the next one starts anew
  tracking,  ///< the last update brought a sample
  bridging,  ///< a sample is missing; the estimate goes on with growing variance
};

/// True if the gains can be used: orders, ranges and signs. Any thread; constant time.
[[nodiscard]] constexpr bool valid(const EstimatorGains& gains) noexcept {
  const auto& [position, velocity, acceleration] = gains.gain;
  const bool three = gains.order == 3;
  if (gains.order != 2 && !three) return false;
  if (gains.period < Time{1'000} || gains.period > Time{33'000'000}) return false;
  if (gains.longest_gap < 2 || gains.longest_gap > 32) return false;
  // Written as what must hold, so that a NaN does not.
  const bool gain_good = position > 0.0F && position <= 1.0F && velocity > 0.0F && velocity < 2.0F;
  const bool third_good = three ? acceleration > 0.0F && acceleration < 2.0F : acceleration == 0.0F;
  const bool spread_good = gains.covariance.pp > 0.0F && gains.covariance.vv > 0.0F;
  const bool third_spread_good = three ? gains.covariance.aa > 0.0F : gains.covariance.aa == 0.0F;
  if (!gain_good || !third_good || !spread_good || !third_spread_good) return false;
  // Far beyond any shaft; with more noise a sample would be all that counts.
  constexpr float kMost = 1e12F;
  const auto in_range = [](float value) { return value > 0.0F && value < kMost; };
  if (!in_range(gains.process_noise) || !in_range(gains.measurement_variance)) return false;
  return gains.acceleration_variance >= 0.0F && gains.acceleration_variance < kMost;
}

}  // namespace tm485
