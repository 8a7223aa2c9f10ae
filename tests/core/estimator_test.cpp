// Estimator and FixedEstimator: start, motion, large positions, irregular latch times, gaps, and how far the two are apart.
// The gains are plain data here; tests/design holds them against the full filter.
#include "tm485/motion/estimator.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <random>
#include <vector>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/motion/estimator_fixed.hpp"
#include "tm485/motion/position_tracker.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::ns;
using test::us;

constexpr EstimatorGains make_gains(std::uint8_t order) {
  EstimatorGains gains;
  gains.period = us(62) + ns(500);
  gains.order = order;
  // As solved for 1 kHz at 16 kHz.
  if (order == 2) {
    gains.gain = {0.424100041F, 0.115544081F, 0.0F};
    gains.covariance = {.pp = 0.0353416689F, .pv = 0.00962867402F, .vv = 0.00612476654F};
    gains.process_noise = 0.00193182216F;
  } else {
    gains.gain = {0.37690419F, 0.0887343287F, 0.010445334F};
    gains.covariance = {0.0314086825F,  0.00739452709F,  0.000870444521F,
                        0.00284363399F, 0.000465759396F, 0.000116663068F};
    gains.process_noise = 1.45917911e-05F;
  }
  gains.measurement_variance = 1.0F / 12.0F;
  gains.longest_gap = 20;
  return gains;
}

constexpr EstimatorGains kTwo = make_gains(2);
constexpr EstimatorGains kThree = make_gains(3);
constexpr FixedGains kFixedTwo = *FixedGains::from(kTwo);
constexpr FixedGains kFixedThree = *FixedGains::from(kThree);
static_assert(valid(kTwo) && valid(kThree));

// Usable at compile time, so nothing of it needs a library at run time either.
static_assert([] {
  Estimator estimator(kTwo);
  for (int i = 0; i < 10; ++i) estimator.update(i * 100, Time{i * 62'500});
  const Estimate estimate = estimator.at(Time{9 * 62'500});
  return estimate.position == 900 && estimate.velocity == 1.6e6F;
}());
static_assert([] {
  FixedEstimator estimator(kFixedTwo);
  for (int i = 0; i < 10; ++i) estimator.update(i * 100, Time{i * 62'500});
  return estimator.at(Time{9 * 62'500}).valid();
}());
static_assert(std::is_trivially_copyable_v<Estimator> && std::is_trivially_copyable_v<FixedEstimator>);

double counts(const Estimate& e) { return static_cast<double>(e.position) + double{e.fraction}; }
double counts(const FixedEstimate& e) {
  return static_cast<double>(e.position) + static_cast<double>(e.fraction) / 4294967296.0;
}

TEST(Estimator, StartsWithTwoSamples) {
  Estimator estimator(kThree);
  EXPECT_EQ(estimator.state(), EstimatorState::empty);
  EXPECT_FALSE(estimator.at(us(5)).valid());
  EXPECT_EQ(estimator.at(us(5)).position, 0) << "nothing is known";
  EXPECT_EQ(estimator.update(1000, us(1000)), EstimatorState::starting);
  EXPECT_FALSE(estimator.at(us(1000)).valid());
  EXPECT_EQ(estimator.at(us(1000)).position, 1000);
  EXPECT_EQ(estimator.update(1250, us(1125)), EstimatorState::tracking);
  const Estimate estimate = estimator.at(us(1250));
  EXPECT_TRUE(estimate.valid());
  EXPECT_EQ(estimate.position, 1500);
  EXPECT_FLOAT_EQ(estimate.velocity, 2e6F);
  EXPECT_EQ(estimate.acceleration, 0.0F);
  estimator.reset();
  EXPECT_EQ(estimator.state(), EstimatorState::empty);
  EXPECT_EQ(estimator.update(5, us(2000)), EstimatorState::starting);
}

TEST(Estimator, SecondSampleTooSoonTellsNoVelocity) {
  Estimator estimator(kTwo);
  FixedEstimator fixed(kFixedTwo);
  for (const auto& [position, latch] : {std::pair{0, us(0)}, {1, us(10)}}) {
    EXPECT_EQ(estimator.update(position, latch), EstimatorState::starting);
    EXPECT_EQ(fixed.update(position, latch), EstimatorState::starting);
  }
  EXPECT_EQ(estimator.update(100, us(50)), EstimatorState::tracking);
  EXPECT_EQ(fixed.update(100, us(50)), EstimatorState::tracking);
  EXPECT_FLOAT_EQ(estimator.at(us(50)).velocity, 2e6F);
  EXPECT_NEAR(static_cast<double>(fixed.at(us(50)).velocity) / 256.0, 2e6, 1.0);
}

/// The same motion must give the same numbers wherever it takes place.
template <class E, class G>
void expect_no_loss(const G& gains, std::int64_t base) {
  E near(gains);
  E far(gains);
  std::mt19937_64 random(7);
  std::int64_t position = 0;
  for (int i = 0; i < 2000; ++i) {
    position += 26'000 + static_cast<std::int64_t>(random() % 7);
    const Time latch{i * 62'500};
    near.update(position, latch);
    far.update(
        static_cast<std::int64_t>(static_cast<std::uint64_t>(base) + static_cast<std::uint64_t>(position)),
        latch);
    const auto a = near.at(latch + us(30));
    const auto b = far.at(latch + us(30));
    ASSERT_EQ(static_cast<std::uint64_t>(b.position) - static_cast<std::uint64_t>(base),
              static_cast<std::uint64_t>(a.position));
    ASSERT_EQ(a.fraction, b.fraction);
    ASSERT_EQ(a.velocity, b.velocity);
    ASSERT_EQ(a.acceleration, b.acceleration);
  }
}

TEST(Estimator, LosesNothingAtLargePositions) {
  constexpr std::int64_t kFar = std::int64_t{1} << 45;
  // The last one runs over the end of 64 bits: the distance is what counts.
  for (const std::int64_t base : {kFar, -kFar, std::numeric_limits<std::int64_t>::max() - 1'000'000}) {
    expect_no_loss<Estimator>(kThree, base);
    expect_no_loss<FixedEstimator>(kFixedThree, base);
  }
}

TEST(Estimator, GoesByTheTimeThatPassed) {
  // 4 counts per µs, latched at whole µs: exact samples. Jitter of ±20 µs and missing samples must not show.
  for (const bool three : {false, true}) {
    Estimator estimator(three ? kThree : kTwo);
    FixedEstimator fixed(three ? kFixedThree : kFixedTwo);
    std::mt19937_64 random(3);
    for (int i = 0; i < 20'000; ++i) {
      if (i > 1 && random() % 4 == 0) continue;
      const std::int64_t at_us = i * 63 + static_cast<std::int64_t>(random() % 41) - 20;
      const EstimatorState before = estimator.state();
      estimator.update(4 * at_us, us(at_us));
      fixed.update(4 * at_us, us(at_us));
      if (before < EstimatorState::tracking) continue;
      ASSERT_LT(std::abs(estimator.innovation()), 2e-3F) << i;
      ASSERT_LT(std::abs(fixed.innovation()), 2e-3F * 65536) << i;
      ASSERT_NEAR(estimator.at(us(at_us)).velocity, 4e6, 10.0) << i;
      ASSERT_NEAR(static_cast<double>(fixed.at(us(at_us)).velocity) / 256.0, 4e6, 10.0) << i;
      ASSERT_NEAR(counts(estimator.at(us(at_us + 17))), static_cast<double>(4 * at_us + 68), 0.01) << i;
    }
    EXPECT_EQ(estimator.state(), EstimatorState::tracking);
  }
}

TEST(Estimator, MissingSamplesAreBridgedWithGrowingVariance) {
  Estimator estimator(kTwo);
  FixedEstimator fixed(kFixedTwo);
  std::int64_t i = 0;
  for (; i < 200; ++i) {
    estimator.update(i * 100, Time{i * 62'500});
    fixed.update(i * 100, Time{i * 62'500});
  }
  float before = estimator.at(estimator.latch_time()).position_variance;
  std::uint32_t fixed_before = fixed.at(fixed.latch_time()).variance;
  EXPECT_FLOAT_EQ(before, kTwo.covariance.pp);
  for (; i < 200 + 19; ++i) {
    const Time now{i * 62'500};
    ASSERT_EQ(estimator.miss(now), EstimatorState::bridging);
    ASSERT_EQ(fixed.miss(now), EstimatorState::bridging);
    const Estimate estimate = estimator.at(now);
    EXPECT_TRUE(estimate.valid());
    EXPECT_NEAR(counts(estimate), static_cast<double>(i * 100), 1e-3);
    EXPECT_NEAR(counts(fixed.at(now)), static_cast<double>(i * 100), 1e-3);
    EXPECT_GT(estimate.position_variance, before);
    EXPECT_GT(fixed.at(now).variance, fixed_before);
    EXPECT_NEAR(static_cast<double>(fixed.at(now).variance) / 4096.0, double{estimate.position_variance},
                0.02 * double{estimate.position_variance} + 0.001);
    before = estimate.position_variance;
    fixed_before = fixed.at(now).variance;
  }
  EXPECT_EQ(estimator.update(i * 100, Time{i * 62'500}), EstimatorState::tracking);
  EXPECT_EQ(fixed.update(i * 100, Time{i * 62'500}), EstimatorState::tracking);
  EXPECT_EQ(fixed.at(fixed.latch_time()).variance,
            UINT32_MAX);  // not stated until its gains are steady again
  // Better at once, back to the steady state with time, never below it.
  float after = estimator.at(estimator.latch_time()).position_variance;
  EXPECT_LT(after, before);
  for (int k = 0; k < 100; ++k) {
    ++i;
    estimator.update(i * 100, Time{i * 62'500});
    fixed.update(i * 100, Time{i * 62'500});
    const float now = estimator.at(estimator.latch_time()).position_variance;
    EXPECT_LT(now, before);
    EXPECT_GT(now, 0.98F * kTwo.covariance.pp);
    after = now;
  }
  EXPECT_FLOAT_EQ(after, kTwo.covariance.pp);
  EXPECT_NEAR(fixed.at(fixed.latch_time()).variance, double{kTwo.covariance.pp} * 4096, 1.0);
}

TEST(StateCovariance, OfTwoSamplesIsThatOfTheirDifference) {
  // Velocity: two samples' noise over the span, and what white jerk did in it; the unknown acceleration bends it.
  constexpr double t = 1.5;
  constexpr double noise = 0.2;
  constexpr double sample = 0.7;
  constexpr double acceleration = 3.0;
  const auto p = StateCovariance<double>::of_two_samples(t, noise, 3, sample, acceleration);
  EXPECT_NEAR(p.pp, sample, 1e-12);
  EXPECT_NEAR(p.pv, sample / t, 1e-12);
  EXPECT_NEAR(p.pa, 0.0, 1e-12);
  const double motion = noise * t * t * t * (1.0 / 3 - 2.0 / 8 + 1.0 / 20);
  EXPECT_NEAR(p.vv, 2 * sample / (t * t) + motion + acceleration * t * t / 4, 1e-12);
  EXPECT_NEAR(p.va, noise * t * t * (1.0 / 2 - 1.0 / 6) + acceleration * t / 2, 1e-12);
  EXPECT_NEAR(p.aa, noise * t + acceleration, 1e-12);
}

TEST(Estimator, TooLongAGapStartsAnew) {
  const auto check = [](auto estimator) {
    for (std::int64_t i = 0; i < 10; ++i) estimator.update(i * 100 + i % 2 * 40, Time{i * 62'500});
    EXPECT_NE(estimator.innovation(), 0);
    const Time last{9 * 62'500};
    EXPECT_EQ(estimator.miss(last + Time{20 * 62'500}), EstimatorState::bridging);
    EXPECT_EQ(estimator.miss(last + Time{20 * 62'500 + 1}), EstimatorState::lost);
    EXPECT_FALSE(estimator.at(last).valid());
    EXPECT_EQ(estimator.update(7'000'000, last + ms(2)), EstimatorState::starting);
    EXPECT_EQ(estimator.innovation(), 0);
    EXPECT_EQ(estimator.update(7'000'000, last + ms(2) + us(62)), EstimatorState::tracking);
    EXPECT_EQ(estimator.at(last + ms(3)).position, 7'000'000);
    // Without being told of the misses it comes to the same.
    EXPECT_EQ(estimator.update(7'000'000, last + ms(20)), EstimatorState::starting);
    EXPECT_EQ(estimator.miss(last + ms(200)), EstimatorState::starting);
  };
  check(Estimator(kTwo));
  check(FixedEstimator(kFixedTwo));
}

TEST(Estimator, LatchTimesThatDoNotAdvanceAreIgnored) {
  const auto check = [](auto estimator) {
    for (std::int64_t i = 0; i < 10; ++i) estimator.update(i * 100, Time{i * 62'500});
    const auto before = estimator.at(us(700));
    EXPECT_EQ(estimator.update(123'456, Time{9 * 62'500}), EstimatorState::tracking);
    EXPECT_EQ(estimator.update(123'456, Time{8 * 62'500}), EstimatorState::tracking);
    const auto after = estimator.at(us(700));
    EXPECT_EQ(before.position, after.position);
    EXPECT_EQ(before.velocity, after.velocity);
  };
  check(Estimator(kTwo));
  check(FixedEstimator(kFixedTwo));
}

TEST(Estimator, AJumpNoShaftCanDoStartsAnew) {
  const auto check = [](auto estimator) {
    for (std::int64_t i = 0; i < 10; ++i) estimator.update(i * 100, Time{i * 62'500});
    for (const std::int64_t jump : {std::int64_t{1} << 50, std::numeric_limits<std::int64_t>::min()}) {
      const Time latch = estimator.latch_time();
      EXPECT_EQ(estimator.update(jump, latch + us(60)), EstimatorState::starting);
      EXPECT_EQ(estimator.update(jump + 5, latch + us(120)), EstimatorState::tracking);
    }
  };
  check(Estimator(kThree));
  check(FixedEstimator(kFixedThree));
}

TEST(Estimator, TakesFreshSamplesOnly) {
  const CompiledProfile profile = test::compiled(test::preset("tm485_17"));
  PositionTracker tracker(profile, AxisConfig{});
  const auto sample = [&](std::uint32_t abs, Time latch) {
    const auto bytes = test::id3_reply(abs, 1, profile.profile().enids.values[0]);
    return *tracker.update(*Reply::parse(bytes, DataId::everything, profile), latch);
  };
  Estimator estimator(kTwo);
  FixedEstimator fixed(kFixedTwo);
  for (std::uint32_t i = 0; i < 5; ++i) {
    const Sample fresh = sample(100 + 10 * i, us(63) * i);
    estimator.update(fresh);
    fixed.update(fresh);
    const Sample held = tracker.hold(us(63) * i + us(60), ms(1));
    EXPECT_EQ(held.quality(), Quality::held);
    estimator.update(held);
    fixed.update(held);
  }
  EXPECT_EQ(estimator.update(Sample{}), EstimatorState::tracking);
  EXPECT_EQ(fixed.update(Sample{}), EstimatorState::tracking);
  EXPECT_EQ(estimator.latch_time(), us(63 * 4));
  EXPECT_NEAR(counts(estimator.at(us(63 * 5))), 150.0, 1e-3);
  EXPECT_NEAR(counts(fixed.at(us(63 * 5))), 150.0, 1e-3);
}

TEST(Estimator, AnyInstantMayBeAsked) {
  const auto check = [](auto estimator) {
    for (std::int64_t i = 0; i < 100; ++i) estimator.update(-i * 26'214, Time{i * 62'500});
    const Time last = estimator.latch_time();
    EXPECT_NEAR(counts(estimator.at(last - us(31) - ns(250))), -98.5 * 26'214, 0.01);
    EXPECT_NEAR(counts(estimator.at(last + us(31) + ns(250))), -99.5 * 26'214, 0.01);
    EXPECT_EQ(estimator.at(last + us(1)).time, last + us(1));
    for (const Time far : {kNever, -kNever, last + ms(500)}) {
      EXPECT_EQ(estimator.at(far).state, EstimatorState::tracking);
    }
  };
  check(Estimator(kThree));
  check(FixedEstimator(kFixedThree));
}

TEST(Estimator, PositionIsRoundedDown) {
  Estimator estimator(kThree);
  for (std::int64_t i = 0; i < 100; ++i) estimator.update(-i * 100, Time{i * 62'500});
  for (std::int64_t i = -60'000; i < 200'000; i += 1'234) {
    const Estimate estimate = estimator.at(estimator.latch_time() + Time{i});
    ASSERT_GE(estimate.fraction, 0.0F);
    ASSERT_LE(estimate.fraction, 1.0F);
    ASSERT_NEAR(counts(estimate), -9'900.0 - static_cast<double>(i) * 100 / 62'500, 1e-3);
  }
}

TEST(Estimator, PositionFromACountIsExactNearIt) {
  Estimate estimate;
  estimate.position = (std::int64_t{1} << 45) + 3;
  estimate.fraction = 0.25F;
  EXPECT_EQ(estimate.position_from(std::int64_t{1} << 45), 3.25F);
  EXPECT_EQ(estimate.position_from((std::int64_t{1} << 45) + 4), -0.75F);
  EXPECT_GE(estimate.position_from(0), 1073741824.0F);
}

TEST(Estimator, SquareRoot) {
  for (double value = 1e-12; value < 1e30; value *= 1.37) {
    const auto number = static_cast<float>(value);
    EXPECT_NEAR(double{square_root(number)} / std::sqrt(double{number}), 1.0, 2.5e-7) << value;
  }
  EXPECT_EQ(square_root(0.0F), 0.0F);
  EXPECT_EQ(square_root(-1.0F), 0.0F);
}

TEST(Estimator, TheGainsOfTheSteadyStateAreTakenAsTheyAre) {
  EstimatorGains gains = make_gains(3);
  gains.gain = {0.5F, 0.25F, 0.125F};
  const auto fixed = FixedGains::from(gains);
  ASSERT_TRUE(fixed);
  EXPECT_EQ(fixed->correction[0].position, 1 << 29);
  EXPECT_EQ(fixed->correction[0].velocity, 1 << 28);
  EXPECT_EQ(fixed->correction[0].acceleration, 1 << 27);
  gains.period = ns(1 << 15);
  EXPECT_EQ(FixedGains::from(gains)->periods_per_ns, 1U << 31) << "no rounding where none is needed";
}

TEST(Estimator, InvalidGainsAreToldApart) {
  const auto broken = [](auto change) {
    EstimatorGains gains = make_gains(2);
    change(gains);
    EXPECT_EQ(test::error_of(FixedGains::from(gains)), Errc::bad_argument);
    return !valid(gains);
  };
  EXPECT_TRUE(broken([](EstimatorGains& g) { g.period = ns(999); }));
  EXPECT_TRUE(broken([](EstimatorGains& g) { g.period = ms(34); }));
  EXPECT_TRUE(broken([](EstimatorGains& g) { g.order = 4; }));
  EXPECT_TRUE(broken([](EstimatorGains& g) { g.longest_gap = 33; }));
  EXPECT_TRUE(broken([](EstimatorGains& g) { g.gain.position = 1.01F; }));
  EXPECT_TRUE(broken([](EstimatorGains& g) { g.gain.velocity = 0.0F; }));
  EXPECT_TRUE(broken([](EstimatorGains& g) { g.gain.acceleration = 0.1F; }));
  EXPECT_TRUE(broken([](EstimatorGains& g) { g.covariance.pp = 0.0F; }));
  EXPECT_TRUE(broken([](EstimatorGains& g) { g.process_noise = std::numeric_limits<float>::quiet_NaN(); }));
  EXPECT_TRUE(broken([](EstimatorGains& g) { g.measurement_variance = 0.0F; }));
  EXPECT_TRUE(broken([](EstimatorGains& g) { g.acceleration_variance = -1.0F; }));
}

TEST(FixedEstimator, TooFastForItStartsAnew) {
  FixedEstimator estimator(kFixedTwo);
  const std::int64_t step = std::int64_t{1} << 22;
  estimator.update(0, us(0));
  EXPECT_EQ(estimator.update(step, us(62)), EstimatorState::starting);
  // Just below is fine, and so is what it leads to within the longest gap.
  estimator.reset();
  for (std::int64_t i = 0; i < 50; ++i) estimator.update(i * (step - 10'000), Time{i * 62'500});
  EXPECT_EQ(estimator.state(), EstimatorState::tracking);
  const Time ahead = estimator.latch_time() + Time{20 * 62'500};
  EXPECT_NEAR(counts(estimator.at(ahead)), 69.0 * static_cast<double>(step - 10'000), 1.0);
}

TEST(FixedEstimator, ASpeedThatGrowsBeyondItsRangeStartsAnew) {
  FixedEstimator estimator(kFixedTwo);
  const std::int64_t step = (std::int64_t{1} << 22) - 10'000;  // counts a period; the range ends at 2^22
  std::int64_t position = 0;
  Time latch{0};
  const auto next = [&](std::int64_t by) { return estimator.update(position += by, latch += Time{62'500}); };
  for (int i = 0; i < 50; ++i) next(step);
  ASSERT_EQ(estimator.state(), EstimatorState::tracking);
  int updates = 0;
  while (next(2 * step) == EstimatorState::tracking && updates < 10) ++updates;
  EXPECT_LE(updates, 3);
  EXPECT_EQ(estimator.state(), EstimatorState::starting);
  EXPECT_EQ(estimator.at(latch).position, position);
  EXPECT_EQ(estimator.at(latch).velocity, 0);
  next(1'000);
  EXPECT_EQ(next(1'000), EstimatorState::tracking);
}

/// The integers against the floats over the same samples: 17 and 23 bits' speeds, both directions, jitter.
TEST(FixedEstimator, FollowsTheFloatEstimator) {
  for (const bool three : {false, true}) {
    for (const double rate : {2e4, -6.5e6, 4.2e8, -4.2e8}) {  // counts/s
      Estimator estimator(three ? kThree : kTwo);
      FixedEstimator fixed(three ? kFixedThree : kFixedTwo);
      std::mt19937_64 random(11);
      double worst_position = 0;
      double worst_velocity = 0;
      double worst_acceleration = 0;
      for (std::int64_t i = 0; i < 20'000; ++i) {
        const Time latch{i * 62'500 + static_cast<std::int64_t>(random() % 2001) - 1000};
        const double seconds = static_cast<double>(latch.count()) * 1e-9;
        const double position = rate * seconds + rate * 1e-3 * std::sin(2 * M_PI * 20 * seconds);
        const auto sample = static_cast<std::int64_t>(std::floor(position));
        ASSERT_EQ(estimator.update(sample, latch), fixed.update(sample, latch));
        if (i < 500) continue;  // their starts differ
        const Time ask = latch + Time{static_cast<std::int64_t>(random() % 125'000)};
        const Estimate a = estimator.at(ask);
        const FixedEstimate b = fixed.at(ask);
        ASSERT_EQ(a.state, b.state);
        worst_position = std::max(worst_position,
                                  std::abs(static_cast<double>(a.position - b.position) + double{a.fraction} -
                                           static_cast<double>(b.fraction) / 4294967296.0));
        worst_velocity =
            std::max(worst_velocity, std::abs(double{a.velocity} - static_cast<double>(b.velocity) / 256.0));
        worst_acceleration = std::max(worst_acceleration,
                                      std::abs(double{a.acceleration} - static_cast<double>(b.acceleration)));
      }
      // A float has 24 bits of the step between two samples and of the velocity; the rest is the fixed point's.
      EXPECT_LT(worst_position, 0.005 + std::abs(rate) * 62.5e-6 * 1e-6) << rate;
      EXPECT_LT(worst_velocity, 10.0 + std::abs(rate) * 3e-7) << rate;
      EXPECT_LT(worst_acceleration, 1e4 + std::abs(rate) * 5e-3) << rate;
    }
  }
}

}  // namespace
}  // namespace tm485
