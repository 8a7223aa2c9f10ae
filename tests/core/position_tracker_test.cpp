// PositionTracker: wraps, turns, unwrapping, held samples, direction, angle and units.
#include "tm485/motion/position_tracker.hpp"

#include <gtest/gtest.h>

#include <cmath>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "support/track.hpp"

namespace tm485 {
namespace {

TEST(Quality, HasAName) {
  EXPECT_EQ(name(Quality::invalid), "invalid");
  EXPECT_EQ(name(Quality::held), "held");
  EXPECT_EQ(name(Quality::extrapolated), "extrapolated");
  EXPECT_EQ(name(Quality::fresh), "fresh");
}

using test::Bytes;
using test::compiled;
using test::error_of;
using test::ms;
using test::ns;
using test::Track;
using test::us;

constexpr std::int64_t kTurn17 = 1 << 17;
constexpr std::int64_t kTurn23 = 1 << 23;

TEST(PositionTracker, IsTurnsAndAbsOfOneFrame) {
  Track track;
  EXPECT_EQ(track.id3(0, 1)->position(), 0) << "the turn count starts at 1";
  EXPECT_EQ(track.id3(0x1FFFF, 1)->position(), kTurn17 - 1);
  EXPECT_EQ(track.id3(5, 2)->position(), kTurn17 + 5);
  const auto sample = track.id3(7, 0);
  EXPECT_EQ(sample->position(), -kTurn17 + 7);
  EXPECT_EQ(sample->single_turn(), 7U);
  EXPECT_EQ(sample->turns(), 0);
  EXPECT_TRUE(sample->has_position());
  EXPECT_EQ(sample->quality(), Quality::fresh);
  EXPECT_EQ(sample->latch_time(), track.now());
  EXPECT_EQ(sample->latch_uncertainty(), ns(500));
  EXPECT_EQ(sample->enid(), 0x11);
  EXPECT_EQ(sample->id(), DataId::everything);
}

TEST(PositionTracker, TurnMinusOneIsSignExtended) {
  Track track;
  const auto sample = track.id3(10, 0xFFFF);
  EXPECT_EQ(sample->turns(), -1);
  EXPECT_EQ(sample->position(), -2 * kTurn17 + 10);
  Track bit16;
  EXPECT_EQ(bit16.id3(10, 0x1FFFF)->turns(), -1) << "bit 16 does not belong to the count";
}

TEST(PositionTracker, PositionGoesOnWhereTheTurnCountWraps) {
  Track up;
  std::int64_t last = up.id3(0, 0x7FFE)->position();
  EXPECT_EQ(last, (32766 - 1) * kTurn17);
  for (const std::uint32_t abm : {0x7FFFU, 0x8000U, 0x8001U}) {
    const auto sample = up.id3(0, abm);
    EXPECT_EQ(sample->position() - last, kTurn17) << abm;
    last = sample->position();
  }
  Track down;
  last = down.id3(0, 1)->position();
  for (const std::uint32_t abm : {0U, 0xFFFFU, 0xFFFEU}) {
    const auto sample = down.id3(0, abm);
    EXPECT_EQ(sample->position() - last, -kTurn17) << abm;
    last = sample->position();
  }
  for (const std::uint32_t abm : {0xFFFFU, 0U, 1U}) {
    const auto sample = down.id3(0, abm);
    EXPECT_EQ(sample->position() - last, kTurn17) << abm;
    last = sample->position();
  }
  EXPECT_EQ(last, 0);
}

TEST(PositionTracker, OneCountAcrossTheWrapOfBothCounters) {
  Track track;
  EXPECT_EQ(track.id3(0x1FFFF, 0xFFFF)->position(), -kTurn17 - 1);
  EXPECT_EQ(track.id3(0, 0)->position(), -kTurn17);
  EXPECT_EQ(track.id3(0x1FFFF, 0xFFFF)->position(), -kTurn17 - 1);
  EXPECT_EQ(track.id3(0, 0)->position(), -kTurn17);
}

TEST(PositionTracker, CountsMoreTurnsThan16Bits) {
  Track track("tm485_17", {.reference_turn = {}, .max_speed_rpm = 1'000'000});
  std::uint32_t abm = 1;
  std::int64_t turns = 0;
  for (int i = 0; i < 200; ++i) {
    abm = (abm + 30'000) & 0xFFFF;
    turns += 30'000;
    ASSERT_EQ(track.id3(3, abm)->position(), turns * kTurn17 + 3);
  }
  for (int i = 0; i < 400; ++i) {
    abm = (abm - 30'000) & 0xFFFF;
    turns -= 30'000;
    ASSERT_EQ(track.id3(3, abm)->position(), turns * kTurn17 + 3);
  }
}

TEST(PositionTracker, TwentyThreeBitsTimesManyTurnsDoesNotOverflow32Bits) {
  Track track("tm485_23");
  EXPECT_EQ(track.id3(0x7FFFFF, 0x7FFF)->position(), 32766 * kTurn23 + 0x7FFFFF);
  Track negative("tm485_23");
  EXPECT_EQ(negative.id3(0, 0x8000)->position(), -32769 * kTurn23);
}

TEST(PositionTracker, DirectionZeroOffsetAndReferenceTurn) {
  AxisConfig axis;
  axis.zero_offset = 100;
  EXPECT_EQ(Track("tm485_17", axis).id3(150, 1)->position(), 50);
  axis.reversed = true;
  EXPECT_EQ(Track("tm485_17", axis).id3(150, 1)->position(), -50);
  EXPECT_EQ(Track("tm485_17", axis).id3(150, 2)->position(), -50 - kTurn17);
  axis = {};
  axis.reference_turn = 0;
  EXPECT_EQ(Track("tm485_17", axis).id3(150, 1)->position(), kTurn17 + 150);
  axis.reference_turn = -3;
  EXPECT_EQ(Track("tm485_17", axis).id3(0, 0xFFFD)->position(), 0);
}

TEST(PositionTracker, SingleTurnOnlyIsUnwrappedOverManyTurnsBothWays) {
  for (const int direction : {1, -1}) {
    Track track("tm485_17_st");
    std::int64_t shaft = 1'000;
    ASSERT_EQ(track.id0(1'000)->position(), 1'000) << "no turns: no reference turn";
    for (int i = 0; i < 5'000; ++i) {
      shaft += direction * 60'000;  // just below half a turn
      ASSERT_EQ(track.id0(static_cast<std::uint32_t>(shaft & 0x1FFFF))->position(), shaft);
    }
    EXPECT_GT(std::abs(shaft), 2'000 * kTurn17);
  }
}

TEST(PositionTracker, Id3OfASingleTurnEncoderIsUnwrappedToo) {
  Track track("tm485_17_st");
  track.apart = Time{0};
  EXPECT_EQ(track.id3(0x1FFF0, 0)->position(), 0x1FFF0);
  const auto sample = track.id3(0x00010, 0xABCD);
  EXPECT_EQ(sample->position(), 0x20010);
  EXPECT_EQ(sample->turns(), 0) << "what such an encoder sends for ABM means nothing";
}

TEST(PositionTracker, Id0GoesOnWhereId3WasAndBack) {
  Track track;
  EXPECT_EQ(track.id3(0x1FFFE, 5)->position(), 4 * kTurn17 + 0x1FFFE);
  EXPECT_EQ(track.id0(0x00002)->position(), 5 * kTurn17 + 2);
  EXPECT_EQ(track.id0(0x1FFFE)->position(), 4 * kTurn17 + 0x1FFFE);
  EXPECT_EQ(track.id0(0x00004)->position(), 5 * kTurn17 + 4);
  const auto sample = track.id3(0x00006, 6);
  EXPECT_EQ(sample->position(), 5 * kTurn17 + 6);
  EXPECT_EQ(sample->turns(), 6);
}

TEST(PositionTracker, Id0FirstOnAMultiTurnEncoderIsNoPosition) {
  Track track;
  EXPECT_EQ(error_of(track.id0(5)), Errc::position_lost);
  EXPECT_EQ(track->hold(track.now(), ms(1)).quality(), Quality::invalid)
      << "a refused reply leaves nothing behind";
  EXPECT_TRUE(track.id3(5, 1));
  EXPECT_TRUE(track.id0(5));
}

TEST(PositionTracker, AGapLongerThanTheUnwrapLimitIsPositionLost) {
  Track track;
  EXPECT_EQ(track->unwrap_limit(), ms(5)) << "half a turn at 6000 rpm";
  ASSERT_TRUE(track.id3(5, 1));
  track.step = ms(5) - us(1) - ns(1);  // the latch instants are known to half a microsecond each
  EXPECT_TRUE(track.id0(6));
  track.step = ms(5) - us(1);
  EXPECT_EQ(error_of(track.id0(7)), Errc::position_lost);
  EXPECT_EQ(error_of(track.id0(7)), Errc::position_lost) << "and stays so";
  track.step = ms(1'000);
  EXPECT_EQ(track.id3(9, 40)->position(), 39 * kTurn17 + 9) << "turns of a multi-turn frame need no history";
  track.step = us(100);
  EXPECT_EQ(track.id0(10)->position(), 39 * kTurn17 + 10);
}

TEST(PositionTracker, AnId1OrId2ReplyDoesNotExtendTheUnwrapLimit) {
  Track track;
  ASSERT_TRUE(track.id3(5, 0));
  track.step = ms(3);
  const auto turns = track.feed(test::id1_reply(0xFFFF), DataId::multi_turn);
  ASSERT_TRUE(turns);
  EXPECT_FALSE(turns->has_position());
  EXPECT_EQ(turns->turns(), -1);
  EXPECT_EQ(turns->quality(), Quality::fresh);
  EXPECT_FALSE(track.feed(test::id2_reply(0x11), DataId::encoder_id)->has_position());
  EXPECT_EQ(error_of(track.id0(6)), Errc::position_lost);
}

TEST(PositionTracker, HeldThenInvalidWithAge) {
  Track track;
  EXPECT_EQ(track->hold(ns(0), ms(2)).quality(), Quality::invalid) << "nothing was ever read";
  const auto fresh = track.id3(77, 1);
  const Time latch = fresh->latch_time();
  const Sample held = track->hold(latch + ms(2), ms(2));
  EXPECT_EQ(held.quality(), Quality::held);
  EXPECT_EQ(held.position(), 77);
  EXPECT_EQ(held.latch_time(), latch) << "a held sample is as old as its data";
  EXPECT_EQ(held.age(latch + ms(2)), ms(2));
  EXPECT_EQ(track->hold(latch + ms(2) + ns(1), ms(2)).quality(), Quality::invalid);
  EXPECT_EQ(track.id3(78, 1)->quality(), Quality::fresh);
}

TEST(PositionTracker, ForgetStartsAnew) {
  Track track("tm485_17_st");
  ASSERT_TRUE(track.id0(0x1FFFF));
  ASSERT_EQ(track.id0(0x00001)->position(), 0x20001);
  track->set_referenced(true);
  EXPECT_TRUE(track.id0(0x00001)->referenced());
  const Sample forgotten = track->forget();
  EXPECT_EQ(forgotten.quality(), Quality::invalid);
  EXPECT_FALSE(forgotten.referenced());
  EXPECT_EQ(track->hold(track.now(), ms(2)).quality(), Quality::invalid)
      << "a forgotten position is not held";
  const auto anew = track.id0(0x00001);
  EXPECT_EQ(anew->position(), 1);
  EXPECT_FALSE(anew->referenced());
}

TEST(PositionTracker, SequenceCountsEveryPublication) {
  Track track;
  const std::uint32_t first = track.id3(1, 1)->sequence();
  EXPECT_EQ(track.id3(2, 1)->sequence(), first + 1);
  EXPECT_EQ(track->hold(track.now(), ms(2)).sequence(), first + 2);
  EXPECT_EQ(track->forget().sequence(), first + 3);
  EXPECT_FALSE(track.id0(1));
  EXPECT_EQ(track.id3(2, 1)->sequence(), first + 4) << "a refused reply is no publication";
}

TEST(PositionTracker, ABatteryKeepsTheReferenceUnlessTheEncoderSaysThatTurnsWereLost) {
  EXPECT_FALSE(Track("tm485_17").id3(1, 1)->referenced());
  EXPECT_TRUE(Track("tformat_17_battery").id3(1, 1)->referenced());
  for (const int almc : {0x01, 0x08, 0x20, 0x40}) {
    const std::uint8_t sf = almc >= 0x10 ? 0x20 : 0x00;
    EXPECT_FALSE(Track("tformat_17_battery").id3(1, 1, sf, static_cast<std::uint8_t>(almc))->referenced())
        << almc;
  }
  EXPECT_TRUE(Track("tformat_17_battery").id3(1, 1, 0x20, 0x80)->referenced())
      << "a weak battery has lost nothing yet";
  Track homed;
  ASSERT_TRUE(homed.id3(1, 1));
  homed->set_referenced(true);
  EXPECT_TRUE(homed.id3(1, 1)->referenced());
  EXPECT_TRUE(homed->hold(homed.now(), ms(2)).referenced());
}

TEST(PositionTracker, StatusAndAlarm) {
  Track track("tformat_23");
  const auto normal = track.id3(1, 1, 0x20, 0xC9);
  EXPECT_EQ(normal->status(), StatusSet(0x20, 0xC9));
  EXPECT_EQ(normal->alarm(), AlarmLevel::none);
  EXPECT_EQ(normal->quality(), Quality::fresh);
  const auto fault = track.id3(1, 1, 0x10, 0x04);
  EXPECT_EQ(fault->alarm(), AlarmLevel::fault);
  EXPECT_EQ(fault->quality(), Quality::fresh) << "an alarm never drops a position";
  EXPECT_EQ(track.id0(1, 0x00)->status(), StatusSet(0x00, 0x04)) << "ALMC as of the last reply that had one";
}

TEST(PositionTracker, ElectricalAngleEqualsTheReferenceInDouble) {
  test::Rng rng(40);
  for (const char* name : {"tm485_17", "tm485_23"}) {
    const unsigned bits = test::preset(name).single_turn_bits;
    for (int round = 0; round < 2'000; ++round) {
      AxisConfig axis;
      axis.pole_pairs = static_cast<std::uint16_t>(1 + test::random_below(rng, 50));
      axis.reversed = test::random_below(rng, 2) == 0;
      axis.electrical_offset = test::random_bits(rng, 32);
      axis.zero_offset = 12'345;  // plays no part: commutation follows the shaft
      const std::uint32_t abs = test::random_bits(rng, bits);
      double turns = static_cast<double>(abs) / std::pow(2.0, bits) * axis.pole_pairs;
      if (axis.reversed) turns = -turns;
      turns += static_cast<double>(axis.electrical_offset) / 4294967296.0;
      const double expected = (turns - std::floor(turns)) * 4294967296.0;
      const double seen = Track(name, axis).id3(abs, 1)->electrical_angle();
      double error = std::abs(seen - expected);
      error = std::min(error, 4294967296.0 - error);
      ASSERT_LT(error, 1.0) << abs << " " << axis.pole_pairs;
    }
  }
}

TEST(PositionTracker, AMatchlessSpeedLimitDoesNotOverflow) {
  for (const std::int32_t rpm :
       {std::numeric_limits<std::int32_t>::min(), -1, 0, 1, std::numeric_limits<std::int32_t>::max()}) {
    AxisConfig axis;
    axis.max_speed_rpm = rpm;
    Track track("tm485_23", axis);
    EXPECT_GT(track->unwrap_limit(), ns(0));
    track.apart = std::chrono::hours(1);
    EXPECT_TRUE(track.id3(0, 1));
    EXPECT_TRUE(track.id3(0, 1));
  }
}

TEST(AxisConfig, UnitsAndGear) {
  AxisConfig axis;
  EXPECT_EQ(to_units(kTurn17 + 1, axis, 17), 131'073.0);
  axis.units = Units::rev;
  EXPECT_DOUBLE_EQ(to_units(-kTurn17 / 2, axis, 17), -0.5);
  axis.units = Units::deg;
  EXPECT_DOUBLE_EQ(to_units(kTurn23 * 3 / 4, axis, 23), 270.0);
  axis.units = Units::rad;
  EXPECT_DOUBLE_EQ(to_units(kTurn23, axis, 23), 2 * std::acos(-1.0));
  axis.units = Units::rev;
  axis.gear_numerator = 3;
  axis.gear_denominator = 50;
  EXPECT_DOUBLE_EQ(to_units(kTurn17 * 50, axis, 17), 3.0);
  axis.gear_numerator = -1;
  axis.gear_denominator = 10;
  EXPECT_DOUBLE_EQ(to_units(kTurn17 * 5, axis, 17), -0.5);
  axis.units = Units::counts;
  EXPECT_EQ(to_units(kTurn17, axis, 17), 131'072.0) << "counts are motor counts, without gear";
}

}  // namespace
}  // namespace tm485
