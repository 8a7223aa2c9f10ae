#include "tm485/sim/motion_profile.hpp"

#include <gtest/gtest.h>

namespace tm485::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(MotionProfile, RestsAtZeroByDefault) {
  const MotionProfile motion;
  EXPECT_EQ(motion.counts(seconds{1000}, 17), 0);
}

TEST(MotionProfile, ConstantSpeedCountsTurns) {
  const auto motion = MotionProfile::constant(60.0);  // one turn a second
  EXPECT_EQ(motion.counts(seconds{1}, 17), 131072);
  EXPECT_EQ(motion.counts(milliseconds{250}, 23), 2097152);
}

TEST(MotionProfile, RoundsTowardsMinusInfinity) {
  const auto motion = MotionProfile::constant(-60.0);
  EXPECT_EQ(motion.counts(Time{1}, 17), -1);
  EXPECT_EQ(motion.counts(seconds{1}, 17), -131072);
}

TEST(MotionProfile, StartAngleAddsToTheMotion) {
  EXPECT_EQ(MotionProfile::constant(60.0, -2.5).counts(seconds{1}, 17), -196608);
}

TEST(MotionProfile, ResolvesACountOfTwentyThreeBitsAfterAnHourAtFullSpeed) {
  const auto motion = MotionProfile::constant(6000.0, 1.0 / 8388608.0);
  EXPECT_EQ(motion.counts(seconds{3600}, 23), std::int64_t{360'000} * 8388608 + 1);
}

TEST(MotionProfile, SineSwingsAboutItsStart) {
  const auto motion = MotionProfile::sine(0.25, 2.0, 1.0);
  EXPECT_DOUBLE_EQ(motion.revolutions(Time{0}), 1.0);
  EXPECT_NEAR(motion.revolutions(milliseconds{125}), 1.25, 1e-12);
  EXPECT_NEAR(motion.revolutions(milliseconds{250}), 1.0, 1e-12);
  EXPECT_NEAR(motion.revolutions(milliseconds{375}), 0.75, 1e-12);
}

TEST(MotionProfile, TrapezoidRampsCruisesAndReturns) {
  // 10 turns a second reached in 1 s, held for 2 s: 5 + 20 + 5 turns out, and back.
  const auto motion = MotionProfile::trapezoid(600.0, 600.0, 2.0);
  EXPECT_NEAR(motion.revolutions(milliseconds{500}), 1.25, 1e-9);
  EXPECT_NEAR(motion.revolutions(seconds{1}), 5.0, 1e-9);
  EXPECT_NEAR(motion.revolutions(seconds{3}), 25.0, 1e-9);
  EXPECT_NEAR(motion.revolutions(milliseconds{3500}), 28.75, 1e-9);
  EXPECT_NEAR(motion.revolutions(seconds{4}), 30.0, 1e-9);
  EXPECT_NEAR(motion.revolutions(seconds{7}), 5.0, 1e-9);
  EXPECT_NEAR(motion.revolutions(seconds{8}), 0.0, 1e-9);
  EXPECT_NEAR(motion.revolutions(seconds{9}), 5.0, 1e-9);
}

TEST(MotionProfile, TrapezoidMayGoClockwiseFirst) {
  EXPECT_NEAR(MotionProfile::trapezoid(-600.0, 600.0, 2.0).revolutions(seconds{4}), -30.0, 1e-9);
}

TEST(MotionProfile, TrapezoidOfSpeedZeroRests) {
  EXPECT_DOUBLE_EQ(MotionProfile::trapezoid(0.0, 600.0, 0.0, 3.0).revolutions(seconds{4}), 3.0);
}

TEST(MotionProfile, SegmentIsAParabolaThroughItsStart) {
  const auto motion = MotionProfile::segment(seconds{5}, 2.0, 3.0, -4.0);
  EXPECT_DOUBLE_EQ(motion.revolutions(seconds{5}), 2.0);
  EXPECT_DOUBLE_EQ(motion.revolutions(milliseconds{5500}), 2.0 + 1.5 - 0.5);
  EXPECT_DOUBLE_EQ(motion.revolutions(milliseconds{4500}), 2.0 - 1.5 - 0.5) << "and before it";
  EXPECT_EQ(motion.counts(milliseconds{5500}, 17), 3 * 131072);
}

TEST(MotionProfile, SegmentResolvesACountOfTwentyThreeBitsAfterAnHour) {
  // One count in 1 us: the span counts, not the instant.
  const auto motion = MotionProfile::segment(seconds{3600}, 1000.0, 1e6 / 8388608.0, 0.0);
  EXPECT_EQ(motion.counts(seconds{3600} + Time{1500}, 23), std::int64_t{1000} * 8388608 + 1);
}

}  // namespace
}  // namespace tm485::sim
