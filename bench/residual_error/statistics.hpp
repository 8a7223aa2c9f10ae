// Bounds of what was counted, and what can be computed instead.
#pragma once

#include <cmath>
#include <cstdint>

#include "judge.hpp"

namespace residual {

struct Interval {
  double low = 0;
  double high = 1;
};

/// The share of the beta distribution's mass below x: the continued fraction of Lentz.
inline double beta_below(double x, double a, double b) {
  if (x <= 0) return 0;
  if (x >= 1) return 1;
  if (x > (a + 1) / (a + b + 2)) return 1 - beta_below(1 - x, b, a);
  const double front =
      std::exp(std::lgamma(a + b) - std::lgamma(a) - std::lgamma(b) + a * std::log(x) + b * std::log1p(-x)) /
      a;
  constexpr double kTiny = 1e-300;
  double f = 1;
  double c = 1;
  double d = 0;
  for (int i = 0; i < 10'000; ++i) {
    const double m = i / 2;
    double numerator = 1;
    if (i > 0 && i % 2 == 0) numerator = m * (b - m) * x / ((a + 2 * m - 1) * (a + 2 * m));
    if (i % 2 == 1) numerator = -(a + m) * (a + b + m) * x / ((a + 2 * m) * (a + 2 * m + 1));
    d = 1 + numerator * d;
    d = 1 / (std::abs(d) < kTiny ? kTiny : d);
    c = 1 + numerator / (std::abs(c) < kTiny ? kTiny : c);
    f *= c * d;
    if (i > 0 && std::abs(1 - c * d) < 1e-12) break;
  }
  return front * (f - 1);
}

/// Clopper-Pearson: the shares with which `hits` of `tries` are not rarer than `tail` on either side.
inline Interval clopper_pearson(std::uint64_t hits, std::uint64_t tries, double tail = 0.025) {
  if (tries == 0) return {};
  const auto k = static_cast<double>(hits);
  const auto n = static_cast<double>(tries);
  const auto solve = [](double wanted, double a, double b) {
    double low = 0;
    double high = 1;
    for (int i = 0; i < 200; ++i) {
      const double middle = i < 60 && low == 0 ? high * 1e-1 : (low + high) / 2;
      (beta_below(middle, a, b) < wanted ? low : high) = middle;
    }
    return (low + high) / 2;
  };
  Interval interval;
  interval.low = hits == 0 ? 0 : solve(tail, k, n - k + 1);
  interval.high = hits == tries ? 1 : solve(1 - tail, k + 1, n - k);
  return interval;
}

/// Independent bits wrong with p: how often a pattern within `open`, not all zero, has an even number in each column.
inline double undetected(double p, const Bytes& open) {
  double all = 1;
  for (unsigned column = 0; column < 8; ++column) {
    int rows = 0;
    for (const std::uint8_t mask : open) rows += (mask >> column) & 1;
    all *= (1 + std::pow(1 - 2 * p, rows)) / 2 * std::pow(1 - p, 11 - rows);
  }
  return all - std::pow(1 - p, 88);
}

}  // namespace residual
