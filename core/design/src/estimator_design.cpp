#include "tm485/design/estimator_design.hpp"

#include <cmath>
#include <numbers>

#include "riccati.hpp"

namespace tm485::design {
namespace {

double seconds(Time span) { return static_cast<double>(span.count()) * 1e-9; }

/// The noise density in units of the period and of the measurement's deviation.
double normalised(const EstimatorModel& model) {
  const double period = seconds(model.period);
  return model.process_noise * std::pow(period, 2.0 * model.order - 1.0) / model.measurement_variance();
}

/// A step of the steady filter: x = transition x + gain z.
struct Filter {
  Matrix step;
  Vector gain;
};

Filter filter(unsigned order, const Vector& gain) {
  Matrix rest = Matrix::Identity(order, order);
  rest.col(0) -= gain;
  return {rest * transition(order, 1.0), gain};
}

/// Estimated over true velocity at `angle` (radians per sample).
std::complex<double> response(const Filter& filter, double angle) {
  const std::complex<double> back = std::polar(1.0, -angle);
  const auto order = filter.gain.size();
  const Eigen::MatrixXcd left =
      Eigen::MatrixXcd::Identity(order, order) - back * filter.step.cast<std::complex<double>>();
  const Eigen::VectorXcd states = left.partialPivLu().solve(filter.gain.cast<std::complex<double>>());
  return states(1) / std::complex<double>(0.0, angle);
}

/// Variance of the velocity for white measurements of variance 1: the sum of the squared impulse response.
double velocity_variance(const Filter& filter) {
  Matrix power = filter.step;
  Matrix sum = filter.gain * filter.gain.transpose();
  for (int i = 0; i < 64; ++i) {  // 2^64 terms
    const Matrix more = power * sum * power.transpose();
    sum += more;
    if (more.norm() < 1e-16 * sum.norm()) break;
    power = power * power;
  }
  return sum(1, 1);
}

std::expected<void, DesignError> check(const EstimatorModel& model) {
  if (model.order != 2 && model.order != 3) return std::unexpected(DesignError::bad_order);
  if (model.period < Time{1'000} || model.period > Time{33'000'000}) {
    return std::unexpected(DesignError::bad_period);
  }
  if (model.longest_gap < 2 || model.longest_gap > 32) return std::unexpected(DesignError::bad_gap);
  for (const double noise : {model.sensor_deviation, model.start_acceleration}) {
    if (!std::isfinite(noise) || noise < 0) return std::unexpected(DesignError::bad_noise);
  }
  return {};
}

EstimatorGains::Gain narrowed(const Vector& gain) {
  return {static_cast<float>(gain(0)), static_cast<float>(gain(1)),
          gain.size() == 3 ? static_cast<float>(gain(2)) : 0.0F};
}

template <std::size_t kSize>
std::array<double, kSize> numbers(const Matrix& matrix) {
  std::array<double, kSize> result{};
  std::size_t at = 0;
  for (Eigen::Index row = 0; row < matrix.rows(); ++row) {
    for (Eigen::Index column = 0; column < matrix.cols(); ++column) result[at++] = matrix(row, column);
  }
  return result;
}

}  // namespace

std::string_view describe(DesignError error) noexcept {
  switch (error) {
    case DesignError::bad_order:
      return "the order is neither 2 nor 3: choose the number of states";
    case DesignError::bad_period:
      return "the period is not within 1 us to 33 ms: give the distance of two samples";
    case DesignError::bad_gap:
      return "the longest gap is not within 2 and 32 periods";
    case DesignError::bad_noise:
      return "a noise is negative or not a number, or the process noise is 0: give densities above 0";
    case DesignError::bad_bandwidth:
      return "the bandwidth is not within 1/10000 and 0.4 of the sample rate: choose another, or sample "
             "faster";
    case DesignError::no_convergence:
      return "the Riccati equation has no accurate solution for these numbers: the process noise is extreme";
    case DesignError::gain_too_large:
      return "the filter would be plain differencing: lower the process noise";
  }
  return "unknown";
}

std::complex<double> EstimatorDesign::velocity_response(double frequency_hz) const {
  if (frequency_hz == 0.0) return 1.0;
  Vector vector(model.order);
  for (unsigned i = 0; i < model.order; ++i) vector(i) = gain[i];
  return response(filter(model.order, vector), 2.0 * std::numbers::pi * frequency_hz * seconds(model.period));
}

std::expected<EstimatorDesign, DesignError> solve_gains(const EstimatorModel& model) {
  if (const auto checked = check(model); !checked) return std::unexpected(checked.error());
  const double noise = normalised(model);
  if (!std::isfinite(noise) || noise <= 0) return std::unexpected(DesignError::bad_noise);
  const auto predicted = steady_state(model.order, noise);
  if (!predicted) return std::unexpected(DesignError::no_convergence);

  EstimatorDesign design;
  design.model = model;
  const double variance = model.measurement_variance();
  const double period = seconds(model.period);
  const Vector gain = best_gain(*predicted);
  const Matrix updated = corrected(*predicted, gain);
  design.gain = numbers<3>(gain);
  design.predicted = numbers<9>(*predicted * variance);
  design.updated = numbers<9>(updated * variance);
  design.velocity_noise = std::sqrt(velocity_variance(filter(model.order, gain)) * variance) / period;
  design.gains.period = model.period;
  design.gains.order = static_cast<std::uint8_t>(model.order);
  design.gains.longest_gap = model.longest_gap;
  design.gains.gain = narrowed(gain);
  const auto put = [&](float& to, int row, int column) {
    to = static_cast<float>(updated(row, column) * variance);
  };
  put(design.gains.covariance.pp, 0, 0);
  put(design.gains.covariance.pv, 0, 1);
  put(design.gains.covariance.vv, 1, 1);
  if (model.order == 3) {
    put(design.gains.covariance.pa, 0, 2);
    put(design.gains.covariance.va, 1, 2);
    put(design.gains.covariance.aa, 2, 2);
  }
  design.gains.process_noise = static_cast<float>(noise * variance);
  design.gains.measurement_variance = static_cast<float>(variance);
  const double start = model.order == 3 ? model.start_acceleration * period * period : 0.0;
  design.gains.acceleration_variance = static_cast<float>(start * start);
  if (!valid(design.gains)) return std::unexpected(DesignError::gain_too_large);
  return design;
}

std::expected<EstimatorDesign, DesignError> solve_for_bandwidth(EstimatorModel model, double bandwidth_hz) {
  if (const auto checked = check(model); !checked) return std::unexpected(checked.error());
  const double period = seconds(model.period);
  const double relative = bandwidth_hz * period;
  const bool possible = relative >= 1e-4 && relative <= 0.4;  // false for a NaN
  if (!possible) return std::unexpected(DesignError::bad_bandwidth);
  const double angle = 2.0 * std::numbers::pi * relative;

  // At a fixed frequency the response grows with the noise, up to where it would overshoot.
  const auto power = [&](double exponent) -> std::expected<double, DesignError> {
    const auto predicted = steady_state(model.order, std::pow(10.0, exponent));
    if (!predicted) return std::unexpected(DesignError::no_convergence);
    return std::norm(response(filter(model.order, best_gain(*predicted)), angle));
  };
  // The filter's corner is near noise^(1 / (2 order)) radians per period, so two decades either side bracket it.
  const double middle = 2.0 * model.order * std::log10(angle);
  double low = middle - 4.0 * model.order;
  double high = middle + 4.0 * model.order;
  for (int i = 0; i < 100; ++i) {
    const double exponent = (low + high) / 2.0;
    const auto at = power(exponent);
    if (!at) {
      // Extreme noise only: both ends are far from the corner, the side tells where to go on.
      (exponent < middle ? low : high) = exponent;
      continue;
    }
    (*at < 0.5 ? low : high) = exponent;
  }
  const double noise = std::pow(10.0, (low + high) / 2.0);
  const auto at = power(std::log10(noise));
  if (!at || std::abs(*at - 0.5) > 1e-6) return std::unexpected(DesignError::no_convergence);
  model.process_noise = noise * model.measurement_variance() / std::pow(period, 2.0 * model.order - 1.0);
  return solve_gains(model);
}

}  // namespace tm485::design
