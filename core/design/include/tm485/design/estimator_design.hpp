// The gains of the estimators (motion/estimator.hpp), solved from noise and period, or from a bandwidth.
//
// For a host, or for start-up on Linux: uses double precision, the heap and Eigen (inside only).
// docs/estimator.md has the model and the equations.
#pragma once

#include <array>
#include <complex>
#include <cstdint>
#include <expected>
#include <string_view>

#include "tm485/motion/estimator_gains.hpp"
#include "tm485/time.hpp"

namespace tm485::design {

enum class DesignError : std::uint8_t {
  bad_order,       ///< the order is neither 2 nor 3
  bad_period,      ///< the period is not within 1 µs to 33 ms
  bad_gap,         ///< the longest gap is not within 2 and 32 periods
  bad_noise,       ///< a noise is negative, not finite, or the process noise is 0
  bad_bandwidth,   ///< the bandwidth is not within 1/10000 and 0.4 of the sample rate
  no_convergence,  ///< the Riccati equation has no accurate solution for these numbers
  gain_too_large,  ///< the process noise is so large that the filter would be plain differencing
};

/// One clause: what was wrong and what to do. Static storage.
[[nodiscard]] std::string_view describe(DesignError error) noexcept;

/// What is assumed about shaft and encoder. Counts are of the position that the estimator is given.
struct EstimatorModel {
  unsigned order = 3;   ///< 2: white acceleration; 3: white jerk
  Time period{62'500};  ///< nominal distance of two samples
  double process_noise =
      0;  ///< density of that white noise: counts²/s³ with two states, counts²/s⁵ with three
  double sensor_deviation = 0;    ///< counts, standard deviation of the position besides its quantisation
  double start_acceleration = 0;  ///< counts/s², standard deviation at a start; three states only
  std::uint8_t longest_gap = 32;  ///< periods without a sample that are bridged, 2 to 32

  /// Of one position, counts²: 1/12 for the rounding to whole counts, and the sensor's.
  [[nodiscard]] constexpr double measurement_variance() const noexcept {
    return 1.0 / 12.0 + sensor_deviation * sensor_deviation;
  }
};

/// A solution. Vectors and matrices are in counts and periods (see EstimatorGains), row by row, the first
/// `order` (`order`²) numbers count.
struct EstimatorDesign {
  EstimatorModel model;
  EstimatorGains gains;
  std::array<double, 3> gain{};       ///< the steady state's gain, unrounded
  std::array<double, 9> predicted{};  ///< covariance before a sample, counts²
  std::array<double, 9> updated{};    ///< covariance after it
  /// Standard deviation of the velocity, counts/s, that the noise of the positions alone brings about (white,
  /// of `measurement_variance`). Plain differencing has sqrt(2 * variance) / period.
  double velocity_noise = 0;

  /// Estimated over true velocity at a frequency, at the instant of a sample: 1 is perfect, its argument the phase.
  [[nodiscard]] std::complex<double> velocity_response(double frequency_hz) const;
};

/// Gains for given noise: the discrete Riccati equation, solved by structured doubling.
[[nodiscard]] std::expected<EstimatorDesign, DesignError> solve_gains(const EstimatorModel& model);

/// The process noise with which estimated over true velocity is -3 dB at `bandwidth_hz`, and its gains.
/// `model.process_noise` is not read.
[[nodiscard]] std::expected<EstimatorDesign, DesignError> solve_for_bandwidth(EstimatorModel model,
                                                                              double bandwidth_hz);

}  // namespace tm485::design
