// What the estimator promises on a shaft: the full filter's trajectory, its stated variance over gaps and starts, the
// noise at random speeds, extrapolation at constant acceleration. Figures of all bandwidths: docs/estimator.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "support.hpp"
#include "tm485/motion/estimator.hpp"
#include "tm485/motion/estimator_fixed.hpp"

namespace tm485 {
namespace {

using design::EstimatorDesign;
using test::at_bandwidth;
using test::FullFilter;
using test::RandomMotion;
using test::seconds;

constexpr Time kPeriod{62'500};

TEST(EstimatorAccuracy, TrajectoryIsTheFullFilters) {
  for (const unsigned order : {2U, 3U}) {
    const EstimatorDesign design = at_bandwidth(order, 1000);
    Estimator estimator(design.gains);
    const FixedGains fixed_gains = *FixedGains::from(design.gains);
    FixedEstimator fixed(fixed_gains);
    FullFilter filter(design.model);
    RandomMotion motion(design.model, 1);
    motion.state(1) = 6.5e6;
    filter.state(1) = 6.5e6;
    filter.converge(kPeriod, 2000);
    filter.state(0) = 0;
    for (int i = 0; i < 6'000; ++i) {
      const Time latch = kPeriod * i;
      const auto sample = static_cast<std::int64_t>(std::floor(motion.state(0)));
      filter.predict(seconds(kPeriod));
      filter.correct(static_cast<double>(sample));
      estimator.update(sample, latch);
      fixed.update(sample, latch);
      motion.advance(seconds(kPeriod));
      if (i < 1000) continue;  // the starts differ
      const Estimate estimate = estimator.at(latch);
      const FixedEstimate integer = fixed.at(latch);
      const double truth = filter.state(0) - static_cast<double>(estimate.position);
      // float: 409 counts a sample and 24 bits
      ASSERT_NEAR(double{estimate.fraction}, truth, 2e-4) << i;
      ASSERT_NEAR(double{estimate.velocity} - filter.state(1), 0.0, 5.0) << i;
      ASSERT_NEAR(static_cast<double>(integer.position - estimate.position) +
                      static_cast<double>(integer.fraction) / 4294967296.0,
                  truth, 1e-3)
          << i;
      ASSERT_NEAR(static_cast<double>(integer.velocity) / 256.0 - filter.state(1), 0.0, 5.0) << i;
      if (order == 3) {
        ASSERT_NEAR(double{estimate.acceleration} - filter.state(2), 0.0, 1e4) << i;
        ASSERT_NEAR(static_cast<double>(integer.acceleration) - filter.state(2), 0.0, 1e4) << i;
      }
      ASSERT_NEAR(double{estimate.position_variance} / filter.covariance(0, 0), 1.0, 1e-5) << i;
      ASSERT_NEAR(double{estimate.velocity_variance} / filter.covariance(1, 1), 1.0, 1e-5) << i;
      // And between the samples.
      FullFilter later = filter;
      later.predict(31e-6);
      const Estimate ahead = estimator.at(latch + Time{31'000});
      ASSERT_NEAR(static_cast<double>(ahead.position) + double{ahead.fraction}, later.state(0), 2e-3) << i;
      ASSERT_NEAR(double{ahead.position_variance} / later.covariance(0, 0), 1.0, 1e-5) << i;
    }
  }
}

/// Errors over stated deviations, of position and velocity, for a motion drawn from the model, with a given share of
/// samples missing, in bursts, and jitter of the latch times.
constexpr int kSamples = 100'000;
constexpr int kStretch = 5'000;

struct Consistency {
  double worst = 0;            ///< of the position
  double mean_square = 0;      ///< of the position; 1 if the variance is exact
  double velocity_square = 0;  ///< of the velocity
  int beyond_five = 0;
  int samples = 0;
  int bridged = 0;
};

Consistency consistency(const EstimatorDesign& design, double missing, int burst, double jitter,
                        std::uint64_t seed) {
  Estimator estimator(design.gains);
  RandomMotion motion(design.model, seed);
  const double sensor = design.model.sensor_deviation;
  Consistency result;
  Time now{0};
  int gap = 0;
  for (int i = 0; i < kSamples; ++i) {
    // A motion drawn from the model wanders off to speeds of no shaft: begin again now and then.
    if (i % kStretch == 0) {
      motion.state.setZero();
      estimator.reset();
      gap = 0;
    }
    const Time latch =
        kPeriod * i + Time{static_cast<std::int64_t>((motion.uniform() - 0.5) * 2 * jitter * 62'500)};
    motion.advance(seconds(latch - now));
    now = latch;
    const auto sample = static_cast<std::int64_t>(std::floor(motion.state(0) + motion.normal() * sensor));
    if (gap == 0 && estimator.state() == EstimatorState::tracking && motion.uniform() < missing) {
      gap = 1 + static_cast<int>(motion.uniform() * burst);
    }
    if (gap > 0) {
      --gap;
      estimator.miss(latch);
      ++result.bridged;
    } else {
      estimator.update(sample, latch);
    }
    const Estimate estimate = estimator.at(latch);
    if (!estimate.valid()) continue;
    // Samples are rounded down, so they stand for the middle of a count.
    const double error =
        static_cast<double>(estimate.position) - (motion.state(0) - 0.5) + double{estimate.fraction};
    const double ratio = error / std::sqrt(double{estimate.position_variance});
    const double velocity_error = double{estimate.velocity} - motion.state(1);
    result.worst = std::max(result.worst, std::abs(ratio));
    result.beyond_five += std::abs(ratio) > 5 ? 1 : 0;
    result.mean_square += ratio * ratio;
    result.velocity_square += velocity_error * velocity_error / double{estimate.velocity_variance};
    ++result.samples;
  }
  result.mean_square /= result.samples;
  result.velocity_square /= result.samples;
  return result;
}

TEST(EstimatorAccuracy, StatedVarianceIsTheErrorsWithoutGaps) {
  for (const unsigned order : {2U, 3U}) {
    for (const double bandwidth : {250.0, 1000.0, 4000.0}) {
      const Consistency c = consistency(at_bandwidth(order, bandwidth, 3), 0, 1, 0, 21);
      EXPECT_NEAR(c.mean_square, 1.0, 0.06) << order << " " << bandwidth;
      EXPECT_NEAR(c.velocity_square, 1.0, 0.06) << order << " " << bandwidth;
      EXPECT_EQ(c.beyond_five, 0);
    }
  }
}

TEST(EstimatorAccuracy, MissingSamplesAreBridgedInsideFiveSigma) {
  for (const unsigned order : {2U, 3U}) {
    for (const double bandwidth : {250.0, 1000.0, 2000.0}) {
      const EstimatorDesign design = at_bandwidth(order, bandwidth, 1);
      for (const int burst : {1, 4, design.gains.longest_gap - 2}) {
        const Consistency c = consistency(design, 0.05, burst, 0.05, 22);
        // Of 100000 Gaussian errors 0.06 are beyond five deviations, and they come in rows.
        EXPECT_LE(c.beyond_five, 5) << order << " " << bandwidth << " " << burst;
        EXPECT_LT(c.worst, 5.5) << order << " " << bandwidth << " " << burst;
        EXPECT_GT(c.bridged, 4000);
        EXPECT_EQ(c.samples, kSamples - kSamples / kStretch);  // never lost
        EXPECT_LT(c.mean_square, 1.06) << order << " " << bandwidth << " " << burst;
        EXPECT_LT(c.velocity_square, 1.06) << order << " " << bandwidth << " " << burst;
      }
    }
  }
}

TEST(EstimatorAccuracy, EverySecondSampleMissingStaysStable) {
  for (const unsigned order : {2U, 3U}) {
    for (const double bandwidth : {250.0, 1000.0, 4000.0}) {
      const EstimatorDesign design = at_bandwidth(order, bandwidth, 1);
      for (const int each : {2, 3, 5, 8}) {
        Estimator estimator(design.gains);
        RandomMotion motion(design.model, 31);
        double sum = 0;
        int samples = 0;
        for (int i = 0; i < 20'000; ++i) {
          const Time latch = kPeriod * i;
          motion.advance(seconds(kPeriod));
          if (i % each != 0) continue;
          estimator.update(std::llround(motion.state(0) + motion.normal()), latch);
          if (i < 2000) continue;
          const Estimate e = estimator.at(latch);
          const double error = static_cast<double>(e.position) - motion.state(0) + double{e.fraction};
          sum += error * error / double{e.position_variance};
          ++samples;
        }
        EXPECT_LT(sum / samples, 1.1) << order << " " << bandwidth << " " << each;
      }
    }
  }
}

TEST(EstimatorAccuracy, StatedVarianceCoversTheStart) {
  // Many starts, from any speed, with the acceleration that the model was told of.
  constexpr double kAcceleration = 2.1e7;  // 1000 rad/s² at 17 bits
  for (const unsigned order : {2U, 3U}) {
    design::EstimatorModel model{
        .order = order, .sensor_deviation = 0.3, .start_acceleration = kAcceleration};
    const EstimatorDesign design = design::solve_for_bandwidth(model, 1000).value();
    std::vector<double> square(60);
    constexpr int kStarts = 4000;
    for (std::uint64_t start = 0; start < kStarts; ++start) {
      RandomMotion motion(design.model, 1000 + start);
      motion.state(1) = 1e7 * (motion.uniform() - 0.5);
      if (order == 3) motion.state(2) = kAcceleration * motion.normal();
      Estimator estimator(design.gains);
      for (std::size_t i = 0; i < square.size() + 1; ++i) {
        const Time latch = kPeriod * static_cast<std::int64_t>(i);
        estimator.update(static_cast<std::int64_t>(std::floor(motion.state(0) + 0.3 * motion.normal())),
                         latch);
        if (i > 0) {
          const Estimate e = estimator.at(latch);
          ASSERT_TRUE(e.valid());
          const double error = static_cast<double>(e.position) - (motion.state(0) - 0.5) + double{e.fraction};
          square[i - 1] += error * error / double{e.position_variance} / kStarts;
        }
        motion.advance(seconds(kPeriod));
      }
    }
    for (std::size_t i = 0; i < square.size(); ++i) EXPECT_LT(square[i], 1.15) << order << ", sample " << i;
    EXPECT_GT(square.back(), order == 3 ? 0.85 : 0.3);  // and states little more than what is true
  }
}

/// Root mean square of the velocity's error over constant speeds: estimator, fixed point, plain differencing.
struct Noise {
  double estimator = 0;
  double fixed = 0;
  double difference = 0;
};

Noise noise_at_random_speeds(const EstimatorDesign& design, unsigned bits, int speeds, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const FixedGains fixed_gains = *FixedGains::from(design.gains);
  Noise sum;
  for (int s = 0; s < speeds; ++s) {
    double per_sample = 0;
    do {
      per_sample = (10.0 + 2990.0 * uniform(random)) / 60.0 * std::ldexp(1.0, static_cast<int>(bits)) *
                   seconds(kPeriod);
    } while (per_sample == std::floor(per_sample));
    const double phase = uniform(random);
    const double truth = per_sample / seconds(kPeriod);
    Estimator estimator(design.gains);
    FixedEstimator fixed(fixed_gains);
    std::int64_t last = 0;
    constexpr int kSettle = 500;
    constexpr int kMeasured = 2000;
    for (int i = 0; i < kSettle + kMeasured; ++i) {
      const auto sample = static_cast<std::int64_t>(std::floor(per_sample * i + phase));
      const Time latch = kPeriod * i;
      estimator.update(sample, latch);
      fixed.update(sample, latch);
      if (i >= kSettle) {
        const auto add = [&](double& to, double velocity) {
          to += std::pow(velocity - truth, 2) / kMeasured / speeds;
        };
        add(sum.estimator, double{estimator.at(latch).velocity});
        add(sum.fixed, static_cast<double>(fixed.at(latch).velocity) / 256.0);
        add(sum.difference, static_cast<double>(sample - last) / seconds(kPeriod));
      }
      last = sample;
    }
  }
  return {std::sqrt(sum.estimator), std::sqrt(sum.fixed), std::sqrt(sum.difference)};
}

TEST(EstimatorAccuracy, VelocityNoiseAtRandomSpeeds) {
  // 1 kHz at 16 kHz, 300 speeds from 10 to 3000 rpm. The noise is that of the rounding alone; over random speeds it
  // is white on average, for which two states reach 9.8 and three states 10.6 (EstimatorDesign::velocity_noise).
  for (const unsigned bits : {17U, 23U}) {
    const Noise three = noise_at_random_speeds(at_bandwidth(3, 1000), bits, 300, 1);
    EXPECT_GE(three.difference / three.estimator, 10.0) << bits;
    EXPECT_GE(three.difference / three.fixed, 10.0) << bits;
    const Noise two = noise_at_random_speeds(at_bandwidth(2, 1000), bits, 300, 1);
    EXPECT_GE(two.difference / two.estimator, 9.0) << bits;
    EXPECT_GE(two.difference / two.fixed, 9.0) << bits;
    EXPECT_NEAR(three.difference, std::sqrt(1.0 / 6.0) / seconds(kPeriod), 400);
  }
}

TEST(EstimatorAccuracy, ANarrowFilterKeepsItsPrecisionAtSpeed) {
  // 23 bits at 3000 rpm: a step of the velocity is 32 counts/s in a float, more than one correction of this filter.
  const EstimatorDesign design = at_bandwidth(2, 10);
  const double rate = 4.194304e8 + 12345.678;
  Estimator estimator(design.gains);
  double sum = 0;
  for (int i = 0; i < 40'000; ++i) {
    const double truth = rate * i * seconds(kPeriod);
    estimator.update(static_cast<std::int64_t>(std::floor(truth)), kPeriod * i);
    if (i < 20'000) continue;
    const Estimate e = estimator.at(kPeriod * i);
    const double base = std::floor(truth);
    sum += std::pow(static_cast<double>(e.position - static_cast<std::int64_t>(base)) + double{e.fraction} -
                        (truth - 0.5 - base),
                    2);
  }
  EXPECT_LT(std::sqrt(sum / 20'000), 2 * std::sqrt(design.updated[0]));
}

TEST(EstimatorAccuracy, NoiseOfWhiteRoundingIsWhatTheDesignStates) {
  const EstimatorDesign two = at_bandwidth(2, 1000);
  const EstimatorDesign three = at_bandwidth(3, 1000);
  const double differencing = std::sqrt(2.0 / 12.0) / seconds(kPeriod);
  EXPECT_NEAR(differencing / two.velocity_noise, 9.82, 0.01);
  EXPECT_NEAR(differencing / three.velocity_noise, 10.57, 0.01);
}

TEST(EstimatorAccuracy, ThreeStatesExtrapolateConstantAcceleration) {
  // Up to 3000 rpm and back, 17 and 23 bits, both directions: one period ahead, within one count beyond the rounding.
  const EstimatorDesign design = at_bandwidth(3, 1000);
  const FixedGains fixed_gains = *FixedGains::from(design.gains);
  for (const unsigned bits : {17U, 23U}) {
    for (const double rad_per_s2 : {10.0, 100.0, 1000.0, -1000.0}) {
      const double acceleration = rad_per_s2 / (2 * M_PI) * std::ldexp(1.0, static_cast<int>(bits));
      const double top = 50.0 * std::ldexp(1.0, static_cast<int>(bits));  // 3000 rpm, counts/s
      Estimator estimator(design.gains);
      FixedEstimator fixed(fixed_gains);
      const double start = rad_per_s2 < 0 ? top : -top;
      double worst = 0;
      double worst_fixed = 0;
      const int samples =
          std::min(60'000, static_cast<int>(2 * top / std::abs(acceleration) / seconds(kPeriod)));
      const auto truth = [&](double t) { return start * t + acceleration / 2 * t * t; };
      for (int i = 0; i < samples; ++i) {
        const Time latch = kPeriod * i;
        const auto sample = static_cast<std::int64_t>(std::floor(truth(i * seconds(kPeriod))));
        estimator.update(sample, latch);
        fixed.update(sample, latch);
        if (i < 500) continue;
        const Time ahead = latch + kPeriod;
        const double middle = truth((i + 1) * seconds(kPeriod)) - 0.5;  // samples are rounded down
        const Estimate e = estimator.at(ahead);
        const FixedEstimate f = fixed.at(ahead);
        const double base = middle - std::floor(middle);
        const auto whole = static_cast<std::int64_t>(std::floor(middle));
        worst =
            std::max(worst, std::abs(static_cast<double>(e.position - whole) + double{e.fraction} - base));
        worst_fixed = std::max(worst_fixed, std::abs(static_cast<double>(f.position - whole) +
                                                     static_cast<double>(f.fraction) / 4294967296.0 - base));
      }
      RecordProperty("worst_" + std::to_string(bits) + "_" + std::to_string(static_cast<int>(rad_per_s2)),
                     std::to_string(worst));
      EXPECT_LT(worst, 1.0) << bits << " bits, " << rad_per_s2 << " rad/s2";
      EXPECT_LT(worst_fixed, 1.0) << bits << " bits, " << rad_per_s2 << " rad/s2";
    }
  }
}

TEST(EstimatorAccuracy, TwoStatesLagAtConstantAccelerationAsTheModelSays) {
  // The price of the second order: a position error of a (1 - gain) / velocity gain, a known number.
  const EstimatorDesign design = at_bandwidth(2, 1000);
  constexpr double kAcceleration = 1000.0 / (2 * M_PI) * 131072.0;
  const double per_period = kAcceleration * seconds(kPeriod) * seconds(kPeriod);
  Estimator estimator(design.gains);
  double sum = 0;
  for (int i = 0; i < 4000; ++i) {
    const double t = i * seconds(kPeriod);
    const double truth = kAcceleration / 2 * t * t;
    estimator.update(static_cast<std::int64_t>(std::floor(truth)), kPeriod * i);
    if (i < 2000) continue;
    const Estimate e = estimator.at(kPeriod * i);
    sum += truth - 0.5 - static_cast<double>(e.position) - double{e.fraction};
  }
  EXPECT_NEAR(sum / 2000, per_period * (1 - design.gain[0]) / design.gain[1], 0.02);
}

}  // namespace
}  // namespace tm485
