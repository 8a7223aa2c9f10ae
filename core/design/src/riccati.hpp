// The steady state of the filter in units of the period and of the measurement's deviation. docs/estimator.md.
#pragma once

#include <Eigen/Dense>
#include <optional>

namespace tm485::design {

using Matrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;
using Vector = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3, 1>;

/// x' = F x over `periods`, with two or three states.
[[nodiscard]] Matrix transition(unsigned order, double periods);

/// Covariance that white noise of density `noise` (counts² per period^(2 order - 1)) adds over `periods`.
[[nodiscard]] Matrix process_covariance(unsigned order, double noise, double periods);

/// A covariance after a sample of variance 1, with the gain that is best or with another one.
[[nodiscard]] Vector best_gain(const Matrix& predicted);
[[nodiscard]] Matrix corrected(const Matrix& predicted, const Vector& gain);

/// The covariance before a sample that repeats itself: the solution of the discrete Riccati equation for
/// measurements of variance 1 a period apart. Nothing if it is not accurate to 1e-12.
[[nodiscard]] std::optional<Matrix> steady_state(unsigned order, double noise);

}  // namespace tm485::design
