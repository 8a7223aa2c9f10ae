// The solved gains against the recursion of the full-matrix filter, the bandwidth against a sine, the errors.
#include "tm485/design/estimator_design.hpp"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>

#include "support.hpp"
#include "tm485/motion/estimator.hpp"
#include "tm485/motion/estimator_fixed.hpp"

namespace tm485::design {
namespace {

using test::at_bandwidth;
using test::FullFilter;
using test::seconds;

TEST(EstimatorDesign, GainsAndCovarianceAreTheFullFiltersLimit) {
  struct Case {
    unsigned order;
    double noise;
    Time period;
    double sensor;
  };
  for (const Case& c : {Case{2, 3e7, Time{62'500}, 0},
                        {2, 1e12, Time{62'500}, 2},
                        {2, 1e6, Time{1'000'000}, 0.5},
                        {3, 1e16, Time{62'500}, 0},
                        {3, 7e19, Time{62'500}, 1},
                        {3, 1e15, Time{40'000}, 0},
                        {3, 1e9, Time{1'000'000}, 0.3}}) {
    const EstimatorModel model{
        .order = c.order, .period = c.period, .process_noise = c.noise, .sensor_deviation = c.sensor};
    const auto design = solve_gains(model);
    ASSERT_TRUE(design.has_value()) << describe(design.error());
    FullFilter filter(model);
    filter.converge(c.period, 20'000);
    const double period = seconds(c.period);
    for (unsigned i = 0; i < c.order; ++i) {
      const double gain = filter.gain(i) * std::pow(period, i);
      EXPECT_NEAR(design->gain[i] / gain, 1.0, 1e-6);
      const auto& [position, velocity, acceleration] = design->gains.gain;
      const std::array<float, 3> rounded{position, velocity, acceleration};
      EXPECT_NEAR(double{rounded[i]} / gain, 1.0, 1e-6);
      for (unsigned j = 0; j < c.order; ++j) {
        const double scale = std::pow(period, i + j);
        EXPECT_NEAR(design->updated[i * c.order + j] / (filter.covariance(i, j) * scale), 1.0, 1e-6);
      }
    }
    // The plain data say the same, and so does what the fixed point has for the first sample after a gap.
    const StateCovariance<float>& p = design->gains.covariance;
    EXPECT_NEAR(double{p.pp} / filter.covariance(0, 0), 1.0, 1e-6);
    EXPECT_NEAR(double{p.pv} / (filter.covariance(0, 1) * period), 1.0, 1e-6);
    EXPECT_NEAR(double{p.vv} / (filter.covariance(1, 1) * period * period), 1.0, 1e-6);
    const auto fixed = FixedGains::from(design->gains);
    ASSERT_TRUE(fixed);
    for (std::size_t missing = 0; missing < FixedGains::kCorrections; ++missing) {
      FullFilter gap = filter;
      gap.predict(static_cast<double>(missing + 1) * period);
      if (gap.covariance(0, 0) < 1e6) {
        EXPECT_NEAR(fixed->variance[missing + 1] / (gap.covariance(0, 0) * 4096), 1.0,
                    1e-6 + 1.0 / (gap.covariance(0, 0) * 4096));
      }
      gap.correct(0.0);
      const FixedGains::Correction& correction = fixed->correction[missing];
      EXPECT_NEAR(correction.position / std::ldexp(gap.gain(0), 30), 1.0, 2e-6);
      EXPECT_NEAR(correction.velocity / std::ldexp(gap.gain(1) * period, 30), 1.0, 2e-6);
      if (c.order == 3) {
        EXPECT_NEAR(correction.acceleration, std::ldexp(gap.gain(2) * period * period, 30),
                    2.0 + 2e-6 * correction.acceleration);
      }
    }
  }
}

TEST(EstimatorDesign, TheSolutionRepeatsItself) {
  // predicted -> update -> predict gives predicted again: the Riccati equation itself, to rounding.
  for (const unsigned order : {2U, 3U}) {
    for (const double bandwidth : {10.0, 100.0, 1000.0, 5000.0}) {
      const EstimatorDesign design = at_bandwidth(order, bandwidth);
      FullFilter filter(design.model);
      const double period = seconds(design.model.period);
      for (unsigned i = 0; i < order; ++i) {
        for (unsigned j = 0; j < order; ++j) {
          filter.covariance(i, j) = design.predicted[i * order + j] / std::pow(period, i + j);
        }
      }
      const Eigen::MatrixXd before = filter.covariance;
      filter.correct(0.0);
      filter.predict(period);
      EXPECT_LT((filter.covariance - before).cwiseQuotient(before).cwiseAbs().maxCoeff(), 1e-11)
          << order << " " << bandwidth;
    }
  }
}

/// Estimated over true velocity, measured with the float estimator on a sine's exact positions.
std::complex<double> measured(const EstimatorDesign& design, double frequency) {
  constexpr double kAmplitude = 2e5;  // counts: whole counts do not show
  const double period = seconds(design.model.period);
  const double omega = 2 * std::numbers::pi * frequency;
  Estimator estimator(design.gains);
  std::complex<double> sum = 0;
  int samples = 0;
  const int settle = 4'000;
  for (int i = 0; i < settle + 16'000; ++i) {  // a whole second of whole cycles
    const double angle = omega * i * period;
    const Time latch = design.model.period * i;
    estimator.update(std::llround(kAmplitude * std::sin(angle)), latch);
    if (i < settle) continue;
    sum += double{estimator.at(latch).velocity} * std::polar(1.0, -angle);
    ++samples;
  }
  return 2.0 * sum / (kAmplitude * omega * samples);
}

TEST(EstimatorDesign, BandwidthIsWhereASineSaysSo) {
  for (const unsigned order : {2U, 3U}) {
    for (const double bandwidth : {250.0, 500.0, 1000.0, 2000.0, 4000.0}) {
      const EstimatorDesign design = at_bandwidth(order, bandwidth);
      EXPECT_NEAR(std::norm(design.velocity_response(bandwidth)), 0.5, 1e-6);
      for (const double frequency : {bandwidth / 10, bandwidth / 2, bandwidth}) {
        const auto expected = design.velocity_response(frequency);
        EXPECT_LT(std::abs(measured(design, frequency) - expected), 2e-3)
            << order << " states, " << bandwidth << " Hz, at " << frequency;
      }
      EXPECT_NEAR(std::abs(measured(design, bandwidth)), std::numbers::sqrt2 / 2, 2e-3);
    }
  }
}

TEST(EstimatorDesign, BandwidthAndNoiseFixedByEachOther) {
  const EstimatorDesign design = at_bandwidth(3, 700, 0.5);
  const auto again = solve_gains(design.model);
  ASSERT_TRUE(again);
  EXPECT_NEAR(std::abs(again->velocity_response(700)), std::numbers::sqrt2 / 2, 1e-6);
  EXPECT_NEAR(design.gain[0], at_bandwidth(3, 700, 0).gain[0], 1e-9);  // only the ratio of the noises counts
}

TEST(EstimatorDesign, VelocityNoiseIsThatOfWhiteSamples) {
  for (const unsigned order : {2U, 3U}) {
    const EstimatorDesign design = at_bandwidth(order, 1000, 20);  // 20 counts: whole counts do not show
    Estimator estimator(design.gains);
    test::RandomMotion random(design.model, 5);
    double sum = 0;
    constexpr int kSamples = 400'000;
    for (int i = 0; i < kSamples; ++i) {
      const Time latch = design.model.period * i;
      estimator.update(std::llround(random.normal() * 20), latch);
      if (i < 1000) continue;
      const double velocity = double{estimator.at(latch).velocity};
      sum += velocity * velocity;
    }
    EXPECT_NEAR(std::sqrt(sum / (kSamples - 1000)) / design.velocity_noise, 1.0, 0.02);
  }
}

TEST(EstimatorDesign, ErrorsHaveNames) {
  const auto error = [](auto change) {
    EstimatorModel model{.process_noise = 1e10};
    change(model);
    const auto design = solve_gains(model);
    return design ? DesignError{255} : design.error();
  };
  EXPECT_EQ(error([](EstimatorModel&) {}), DesignError{255});
  EXPECT_EQ(error([](EstimatorModel& m) { m.order = 4; }), DesignError::bad_order);
  EXPECT_EQ(error([](EstimatorModel& m) { m.period = Time{999}; }), DesignError::bad_period);
  EXPECT_EQ(error([](EstimatorModel& m) { m.period = Time{33'000'001}; }), DesignError::bad_period);
  EXPECT_EQ(error([](EstimatorModel& m) { m.process_noise = 0; }), DesignError::bad_noise);
  EXPECT_EQ(error([](EstimatorModel& m) { m.process_noise = std::numeric_limits<double>::quiet_NaN(); }),
            DesignError::bad_noise);
  EXPECT_EQ(error([](EstimatorModel& m) { m.sensor_deviation = -1; }), DesignError::bad_noise);
  EXPECT_EQ(error([](EstimatorModel& m) { m.start_acceleration = std::numeric_limits<double>::infinity(); }),
            DesignError::bad_noise);
  EXPECT_EQ(error([](EstimatorModel& m) { m.longest_gap = 33; }), DesignError::bad_gap);
  // So much noise that no double tells a covariance's parts apart, or so little.
  EXPECT_EQ(error([](EstimatorModel& m) { m.process_noise = 1e60; }), DesignError::gain_too_large);
  EXPECT_EQ(error([](EstimatorModel& m) { m.process_noise = 1e-60; }), DesignError::no_convergence);
  for (const double bandwidth : {0.0, -5.0, 1.0, 6'401.0, std::numeric_limits<double>::quiet_NaN()}) {
    const auto design = solve_for_bandwidth(EstimatorModel{}, bandwidth);
    ASSERT_FALSE(design) << bandwidth;
    EXPECT_EQ(design.error(), DesignError::bad_bandwidth);
  }
  for (unsigned i = 0; i <= static_cast<unsigned>(DesignError::gain_too_large); ++i) {
    EXPECT_NE(describe(static_cast<DesignError>(i)), describe(DesignError{255}));
  }
}

TEST(EstimatorDesign, TheWholeRangeOfBandwidthsCanBeSolved) {
  for (const unsigned order : {2U, 3U}) {
    for (double bandwidth = 5; bandwidth < 6'400; bandwidth *= 1.6) {
      EstimatorModel model{.order = order, .start_acceleration = 2e7};
      const auto design = solve_for_bandwidth(model, bandwidth);
      ASSERT_TRUE(design.has_value()) << order << " " << bandwidth << ": " << describe(design.error());
      EXPECT_TRUE(valid(design->gains));
    }
  }
}

}  // namespace
}  // namespace tm485::design
