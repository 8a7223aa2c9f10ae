#include "doctor/binomial.hpp"

#include <cmath>

namespace tm485::cli::doctor {
namespace {

/// The probability of at most `events` in `trials`, each of probability `p`.
double at_most(std::uint32_t events, std::uint32_t trials, double p) {
  const double log_p = std::log(p);
  const double log_q = std::log1p(-p);
  double log_choose = 0.0;
  double sum = 0.0;
  for (std::uint32_t k = 0; k <= events; ++k) {
    sum += std::exp(log_choose + k * log_p + (trials - k) * log_q);
    log_choose += std::log(static_cast<double>(trials - k)) - std::log(static_cast<double>(k + 1));
  }
  return sum;
}

}  // namespace

double upper_bound_95(std::uint32_t events, std::uint32_t trials) {
  constexpr double kMissed = 0.05;
  constexpr int kHalvings = 50;
  if (events >= trials) return 1.0;
  double low = 0.0;
  double high = 1.0;
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = (low + high) / 2.0;
    (at_most(events, trials, middle) > kMissed ? low : high) = middle;
  }
  return high;
}

}  // namespace tm485::cli::doctor
