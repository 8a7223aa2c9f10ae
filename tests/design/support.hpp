// The full-matrix Kalman filter in counts and seconds: the oracle of the estimator's tests. It shares nothing with
// tm485::design but the model.
#pragma once

#include <Eigen/Dense>
#include <cmath>
#include <cstdint>
#include <random>

#include "tm485/design/estimator_design.hpp"

namespace tm485::test {

inline double seconds(Time span) { return static_cast<double>(span.count()) * 1e-9; }

class FullFilter {
 public:
  explicit FullFilter(const design::EstimatorModel& model)
      : order_(static_cast<int>(model.order)),
        noise_(model.process_noise),
        variance_(model.measurement_variance()) {
    state = Eigen::VectorXd::Zero(order_);
    covariance = Eigen::MatrixXd::Identity(order_, order_);
  }

  /// The matrices by their definition: sums of t^n / n!, and the integral of the impulse response's products.
  [[nodiscard]] Eigen::MatrixXd transition(double t) const {
    Eigen::MatrixXd f = Eigen::MatrixXd::Zero(order_, order_);
    for (int i = 0; i < order_; ++i) {
      for (int j = i; j < order_; ++j) f(i, j) = std::pow(t, j - i) / std::tgamma(j - i + 1);
    }
    return f;
  }
  [[nodiscard]] Eigen::MatrixXd process(double t) const {
    Eigen::MatrixXd q(order_, order_);
    for (int i = 0; i < order_; ++i) {
      for (int j = 0; j < order_; ++j) {
        const int a = order_ - 1 - i;  // the impulse response of state i is t^a / a!
        const int b = order_ - 1 - j;
        q(i, j) = noise_ * std::pow(t, a + b + 1) / ((a + b + 1) * std::tgamma(a + 1) * std::tgamma(b + 1));
      }
    }
    return q;
  }

  void predict(double t) {
    const Eigen::MatrixXd f = transition(t);
    state = f * state;
    covariance = f * covariance * f.transpose() + process(t);
  }
  void correct(double position) {
    gain = covariance.col(0) / (covariance(0, 0) + variance_);
    state += gain * (position - state(0));
    Eigen::MatrixXd rest = Eigen::MatrixXd::Identity(order_, order_);
    rest.col(0) -= gain;
    covariance = rest * covariance * rest.transpose() + gain * gain.transpose() * variance_;
  }
  void converge(Time period, int steps) {
    for (int i = 0; i < steps; ++i) {
      predict(seconds(period));
      correct(state(0));
    }
  }

  Eigen::VectorXd state;
  Eigen::VectorXd gain;
  Eigen::MatrixXd covariance;

 private:
  int order_;
  double noise_;
  double variance_;
};

/// A motion drawn from the model itself, and its samples.
class RandomMotion {
 public:
  RandomMotion(const design::EstimatorModel& model, std::uint64_t seed)
      : filter_(model), random_(seed), order_(static_cast<int>(model.order)) {
    state = Eigen::VectorXd::Zero(order_);
  }
  void advance(double t) {
    if (t <= 0) return;
    const Eigen::MatrixXd root = filter_.process(t).llt().matrixL();
    Eigen::VectorXd noise(order_);
    for (int i = 0; i < order_; ++i) noise(i) = normal();
    state = filter_.transition(t) * state + root * noise;
  }
  double normal() { return normal_(random_); }
  double uniform() { return std::uniform_real_distribution<double>(0.0, 1.0)(random_); }

  Eigen::VectorXd state;

 private:
  FullFilter filter_;
  std::mt19937_64 random_;
  std::normal_distribution<double> normal_;
  int order_;
};

inline design::EstimatorDesign at_bandwidth(unsigned order, double bandwidth_hz,
                                            double sensor_deviation = 0) {
  design::EstimatorModel model;
  model.order = order;
  model.sensor_deviation = sensor_deviation;
  return design::solve_for_bandwidth(model, bandwidth_hz).value();
}

}  // namespace tm485::test
