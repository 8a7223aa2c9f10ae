// PositionTracker and AxisConfig at their limits: what a shaft cannot do, what an axis cannot be, what is stale.
#include <gtest/gtest.h>

#include <type_traits>

#include "support/track.hpp"

namespace tm485 {
namespace {

using test::error_of;
using test::ms;
using test::ns;
using test::Track;
using test::us;

constexpr std::int64_t kTurn17 = 1 << 17;
constexpr std::int64_t kTurn23 = 1 << 23;

TEST(PositionTracker, AFrameThatTheShaftCannotHaveReachedIsRefusedAndLeavesNothing) {
  Track track;
  track.apart = Time{0};
  track.step = ms(1);  // 6000 rpm: 13107.2 counts
  ASSERT_TRUE(track.id3(1'000, 1));
  EXPECT_EQ(error_of(track.id3(1'000 ^ 0x8000, 1 ^ 0x8000)), Errc::position_implausible)
      << "two flips in one column";
  EXPECT_EQ(track->hold(track.now(), ms(3)).position(), 1'000);
  EXPECT_EQ(track->hold(track.now(), ms(3)).turns(), 1);
  EXPECT_EQ(track.id3(1'000 + 26'000, 1)->position(), 27'000) << "two milliseconds since the last good one";
  EXPECT_EQ(error_of(track.id3(27'000 + 13'200, 1)), Errc::position_implausible);
  track.step = us(1);
  EXPECT_EQ(error_of(track.id0(27'000 + 15'000)), Errc::position_implausible)
      << "of single-turn data as well";
  EXPECT_TRUE(track.id0(27'000 + 13'000));
}

TEST(PositionTracker, AFrameThatTheShaftCanHaveReachedInALongTimeIsGood) {
  Track track;
  track.apart = std::chrono::seconds(20);
  ASSERT_TRUE(track.id3(0, 1));
  const auto sample = track.id3(0, 1 + 1'900);
  ASSERT_TRUE(sample) << "6000 rpm is 2000 turns in 20 s";
  EXPECT_EQ(sample->position(), 1'900 * kTurn17);
}

TEST(PositionTracker, AnAlarmIsThatOfTheReplyAndNotOfAnOlderOne) {
  Track track;
  EXPECT_EQ(track.id3(1, 1, 0x10, 0x04)->alarm(), AlarmLevel::fault);
  EXPECT_EQ(track->hold(track.now(), ms(2)).alarm(), AlarmLevel::fault);
  EXPECT_EQ(track.id0(1)->alarm(), AlarmLevel::none);
  EXPECT_EQ(track.id0(1, 0x10)->alarm(), AlarmLevel::fault);
  EXPECT_EQ(track.id3(1, 1)->alarm(), AlarmLevel::none);
}

TEST(PositionTracker, AnInvalidSampleHasNoPosition) {
  Track track;
  EXPECT_TRUE(track.id3(1, 1)->has_position());
  EXPECT_TRUE(track->hold(track.now(), ms(2)).has_position());
  EXPECT_FALSE(track->hold(track.now() + ms(3), ms(2)).has_position());
  EXPECT_TRUE(track.id3(1, 1)->has_position());
  EXPECT_FALSE(track->forget().has_position());
}

TEST(PositionTracker, TheDefaultReferenceIsTheTurnAtWhichTheProfileBegins) {
  EXPECT_EQ(Track("tm485_17").id3(0, 1)->position(), 0);
  EXPECT_EQ(Track("tformat_17").id3(0, 0)->position(), 0);
  EXPECT_EQ(Track("tformat_23_battery").id3(5, 1)->position(), kTurn23 + 5);
}

TEST(PositionTracker, AnEncoderWithoutTurnsHasZero) {
  const auto frame = *Frame::parse(test::id3_reply(1, 0xFFFFFF));
  EXPECT_EQ(frame.turns(0), 0);
  EXPECT_EQ(frame.turns(24), -1);
}

TEST(PositionTracker, AShortTurnCountWrapsToo) {
  Profile small = test::preset("tm485_17");
  small.single_turn_bits = 8;
  small.multi_turn_bits = 8;
  Track track(small, {});
  track.apart = ms(30);  // three turns at most
  const std::int64_t first = track.id3(5, 127)->position();
  EXPECT_EQ(track.id3(5, 128)->position() - first, 256);
  EXPECT_EQ(track.id3(250, 127)->position() - first, 245);
  EXPECT_EQ(track.id3(0, 129)->position() - first, 507);
}

// A tracker keeps a reference to its profile: a temporary one must not compile.
static_assert(std::is_constructible_v<PositionTracker, const CompiledProfile&, AxisConfig>);
static_assert(!std::is_constructible_v<PositionTracker, CompiledProfile, AxisConfig>);
static_assert(!std::is_constructible_v<PositionTracker, const CompiledProfile, AxisConfig>);

TEST(AxisConfig, ValidUpToItsLimits) {
  constexpr std::int64_t kLargest = std::int64_t{1} << 60;
  const auto with = [](auto edit) {
    AxisConfig axis;
    edit(axis);
    return axis.valid();
  };
  EXPECT_TRUE(AxisConfig{}.valid());
  EXPECT_TRUE(with([](AxisConfig& a) { a.zero_offset = kLargest - 1; }));
  EXPECT_TRUE(with([](AxisConfig& a) { a.zero_offset = 1 - kLargest; }));
  EXPECT_FALSE(with([](AxisConfig& a) { a.zero_offset = kLargest; }));
  EXPECT_FALSE(with([](AxisConfig& a) { a.zero_offset = -kLargest; }));
  EXPECT_FALSE(with([](AxisConfig& a) { a.gear_numerator = 0; }));
  EXPECT_FALSE(with([](AxisConfig& a) { a.gear_denominator = 0; }));
  EXPECT_FALSE(with([](AxisConfig& a) { a.pole_pairs = 0; }));
  EXPECT_FALSE(with([](AxisConfig& a) { a.max_speed_rpm = 0; }));
  EXPECT_TRUE(with([](AxisConfig& a) { a.max_speed_rpm = 1'000'000; }));
  EXPECT_FALSE(with([](AxisConfig& a) { a.max_speed_rpm = 1'000'001; }));
}

}  // namespace
}  // namespace tm485
