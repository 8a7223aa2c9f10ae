#include "riccati.hpp"

#include <cmath>

namespace tm485::design {

Matrix transition(unsigned order, double periods) {
  Matrix f = Matrix::Identity(order, order);
  f(0, 1) = periods;
  if (order == 3) {
    f(0, 2) = periods * periods / 2.0;
    f(1, 2) = periods;
  }
  return f;
}

Matrix process_covariance(unsigned order, double noise, double periods) {
  // The integral of g(s) g(s)' over the span, g being the response to an impulse: (s, 1) or (s²/2, s, 1).
  const double t = periods;
  Matrix q(order, order);
  if (order == 2) {
    q << t * t * t / 3.0, t * t / 2.0,  //
        t * t / 2.0, t;
  } else {
    const double t2 = t * t;
    q << t2 * t2 * t / 20.0, t2 * t2 / 8.0, t2 * t / 6.0,  //
        t2 * t2 / 8.0, t2 * t / 3.0, t2 / 2.0,             //
        t2 * t / 6.0, t2 / 2.0, t;
  }
  return noise * q;
}

Vector best_gain(const Matrix& predicted) { return predicted.col(0) / (predicted(0, 0) + 1.0); }

Matrix corrected(const Matrix& predicted, const Vector& gain) {
  Matrix rest = Matrix::Identity(predicted.rows(), predicted.cols());
  rest.col(0) -= gain;
  Matrix result = rest * predicted * rest.transpose() + gain * gain.transpose();
  return (result + result.transpose()) / 2.0;
}

std::optional<Matrix> steady_state(unsigned order, double noise) {
  const Matrix f = transition(order, 1.0);
  const Matrix q = process_covariance(order, noise, 1.0);
  const Matrix one = Matrix::Identity(order, order);

  // Structured doubling: after n steps x is the covariance that 2^n samples lead to from certainty.
  Matrix a = f.transpose();
  Matrix g = Matrix::Zero(order, order);
  g(0, 0) = 1.0;
  Matrix x = q;
  constexpr int kMostSteps = 60;
  bool settled = false;
  for (int i = 0; i < kMostSteps && !settled; ++i) {
    const Matrix inverse = (one + g * x).inverse();
    const Matrix a_next = a * inverse * a;
    const Matrix g_next = g + a * inverse * g * a.transpose();
    const Matrix growth = a.transpose() * x * inverse * a;
    x += (growth + growth.transpose()) / 2.0;
    a = a_next;
    g = (g_next + g_next.transpose()) / 2.0;
    settled = growth.cwiseAbs().cwiseQuotient(x.cwiseAbs()).maxCoeff() < 1e-15;
  }
  // What rounding left is contracted by a few steps of the recursion itself, which also is the proof.
  for (int i = 0; i < 64; ++i) {
    const Matrix next = f * corrected(x, best_gain(x)) * f.transpose() + q;
    const double change = (next - x).cwiseAbs().cwiseQuotient(next.cwiseAbs()).maxCoeff();
    if (!std::isfinite(change)) return std::nullopt;
    x = next;
    if (change < 1e-13) return x;
  }
  Matrix next = f * corrected(x, best_gain(x)) * f.transpose() + q;
  if ((next - x).cwiseAbs().cwiseQuotient(next.cwiseAbs()).maxCoeff() > 1e-12) return std::nullopt;
  return next;
}

}  // namespace tm485::design
