// Noise of the estimated velocity against its phase lag, measured over bandwidths from 250 Hz to 4 kHz, as CSV.
//
//   tm485_estimator_curve [speeds]      default 300
//
// 16 kHz. Noise: root mean square over random constant speeds from 10 to 3000 rpm, rounding to whole counts only,
// beside plain differencing of the same samples. Phase lag: of a sine of 100 Hz, measured with the estimator.
#include <algorithm>
#include <cmath>
#include <complex>
#include <cstdio>
#include <cstdlib>
#include <numbers>
#include <random>
#include <vector>

#include "tm485/design/estimator_design.hpp"
#include "tm485/motion/estimator.hpp"

namespace {

using namespace tm485;

constexpr Time kPeriod{62'500};
constexpr double kSeconds = 62.5e-6;

struct Noise {
  double estimator = 0;
  double difference = 0;
  double median_ratio = 0;  ///< of single speeds
  double worst_ratio = 0;
};

Noise noise(const EstimatorGains& gains, int bits, int speeds) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  Noise sum;
  std::vector<double> ratios;
  for (int s = 0; s < speeds; ++s) {
    const double per_sample = (10.0 + 2990.0 * uniform(random)) / 60.0 * std::ldexp(1.0, bits) * kSeconds;
    const double phase = uniform(random);
    const double truth = per_sample / kSeconds;
    Estimator estimator(gains);
    std::int64_t last = 0;
    double estimated = 0;
    double differenced = 0;
    constexpr int kSettle = 1000;
    constexpr int kMeasured = 4000;
    for (int i = 0; i < kSettle + kMeasured; ++i) {
      const auto sample = static_cast<std::int64_t>(std::floor(per_sample * i + phase));
      estimator.update(sample, kPeriod * i);
      if (i >= kSettle) {
        estimated += std::pow(double{estimator.at(kPeriod * i).velocity} - truth, 2) / kMeasured;
        differenced += std::pow(static_cast<double>(sample - last) / kSeconds - truth, 2) / kMeasured;
      }
      last = sample;
    }
    ratios.push_back(std::sqrt(differenced / estimated));
    sum.estimator += estimated / speeds;
    sum.difference += differenced / speeds;
  }
  std::ranges::sort(ratios);
  return {std::sqrt(sum.estimator), std::sqrt(sum.difference), ratios[ratios.size() / 2], ratios.front()};
}

/// Degrees that the estimate lags a sine's true velocity, at the instant of the sample.
double phase_lag(const EstimatorGains& gains, double frequency) {
  constexpr double kAmplitude = 1e6;
  Estimator estimator(gains);
  std::complex<double> sum = 0;
  for (int i = 0; i < 20'000; ++i) {
    const double angle = 2 * std::numbers::pi * frequency * i * kSeconds;
    estimator.update(std::llround(kAmplitude * std::sin(angle)), kPeriod * i);
    if (i >= 4'000) sum += double{estimator.at(kPeriod * i).velocity} * std::polar(1.0, -angle);
  }
  return -std::arg(sum) * 180 / std::numbers::pi;
}

}  // namespace

int main(int argc, char** argv) {
  const int speeds = argc > 1 ? std::max(1, std::atoi(argv[1])) : 300;
  std::puts(
      "states,bits,bandwidth_hz,velocity_noise_counts_per_s,differencing_counts_per_s,ratio,median_ratio,"
      "worst_ratio,"
      "white_ratio,phase_lag_100hz_deg");
  for (const unsigned order : {2U, 3U}) {
    for (const int bits : {17, 23}) {
      for (const double bandwidth : {250.0, 354.0, 500.0, 707.0, 1000.0, 1414.0, 2000.0, 2828.0, 4000.0}) {
        const auto design = design::solve_for_bandwidth({.order = order, .period = kPeriod}, bandwidth);
        if (!design) {
          std::fprintf(stderr, "%g Hz: %s\n", bandwidth, design::describe(design.error()).data());
          return 1;
        }
        const Noise n = noise(design->gains, bits, speeds);
        const double white =
            std::sqrt(2.0 * design->model.measurement_variance()) / kSeconds / design->velocity_noise;
        std::printf("%u,%d,%.0f,%.1f,%.1f,%.2f,%.2f,%.2f,%.2f,%.3f\n", order, bits, bandwidth, n.estimator,
                    n.difference, n.difference / n.estimator, n.median_ratio, n.worst_ratio, white,
                    phase_lag(design->gains, 100));
      }
    }
  }
}
