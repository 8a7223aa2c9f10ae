// Turns that come without a position (ID1): wrong ones pass the CRC as wrong positions do, and are held back as these are.
#include <gtest/gtest.h>

#include <cstdint>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/track.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::Track;
using test::us;

constexpr std::uint32_t kMiddle = 1U << 16, kLast = (1U << 17) - 1;
constexpr auto kEnough = static_cast<int>(PlausibilityGate::kAgree);

class TurnsCheck : public ::testing::Test {
 protected:
  TurnsCheck() {
    track.step = us(100);
    track.apart = Time{0};
  }
  /// The shaft stands still in turn 7.
  void stand(std::uint32_t abs = kMiddle) {
    for (int k = 0; k < 8; ++k) ASSERT_TRUE(track.id3(abs, 7));
  }
  /// A reply to ID1 alone, where no position is read.
  Errc alone(std::uint32_t abm) {
    const auto sample = track.feed(test::id1_reply(abm), DataId::multi_turn);
    if (sample) turns = sample->turns();
    return sample ? Errc::ok : sample.error();
  }
  /// One between replies with positions.
  Errc between(std::uint32_t abm) {
    const auto reply = Reply::parse(test::id1_reply(abm), DataId::multi_turn, profile);
    return track->note(*reply, track.now() + us(50), us(1));
  }

  Track track;
  CompiledProfile profile = test::compiled(test::preset("tm485_17"));
  std::int32_t turns = 0;
};

TEST_F(TurnsCheck, EachWrongBitIsHeldBackWhereThePositionIsKnown) {
  stand();
  for (unsigned bit = 0; bit < 16; ++bit) {
    EXPECT_EQ(between(7U ^ (1U << bit)), Errc::position_implausible) << bit;
    EXPECT_EQ(track->hold(track.now(), ms(1)).turns(), 7) << bit;
    EXPECT_EQ(between(7), Errc::ok) << bit;
  }
}

TEST_F(TurnsCheck, AtTheEndOfATurnTheNextOneIsPossibleAndTheOneAfterItIsNot) {
  stand(kLast);
  EXPECT_EQ(between(8), Errc::ok);
  EXPECT_EQ(track->hold(track.now(), ms(1)).turns(), 8);
  EXPECT_EQ(between(7), Errc::ok);
  EXPECT_EQ(between(6), Errc::position_implausible);
  EXPECT_EQ(between(9), Errc::position_implausible);
}

TEST_F(TurnsCheck, TheTurnCountWraps) {
  for (int k = 0; k < 8; ++k) ASSERT_TRUE(track.id3(kLast, 0x7FFF));
  EXPECT_EQ(between(0x8000), Errc::ok);
  EXPECT_EQ(track->hold(track.now(), ms(1)).turns(), -32768);
  EXPECT_EQ(between(0x8001), Errc::position_implausible);
  EXPECT_EQ(between(0x7FFF), Errc::ok);
}

TEST_F(TurnsCheck, SomeThatAgreeOnAnotherTurnEndWhatIsKnown) {
  stand();
  for (int k = 1; k < kEnough; ++k) ASSERT_EQ(between(300), Errc::position_implausible) << k;
  EXPECT_EQ(between(300), Errc::position_lost);
  // And not if they do not agree with each other, or a good one came between.
  for (int k = 1; k < 4 * kEnough; ++k)
    ASSERT_EQ(between(k % 2 == 0 ? 300U : 500U), Errc::position_implausible) << k;
  ASSERT_EQ(between(7), Errc::ok);
  for (int rounds = 0; rounds < 2; ++rounds) {
    for (int k = 1; k < kEnough; ++k) ASSERT_EQ(between(300), Errc::position_implausible) << k;
    EXPECT_EQ(between(7), Errc::ok);
  }
}

TEST_F(TurnsCheck, TheNextTurnIsAnotherOneToo) {
  for (int k = 0; k < 8; ++k) ASSERT_TRUE(track.id3(kMiddle, 6));
  EXPECT_EQ(between(7), Errc::position_implausible);
  EXPECT_EQ(between(5), Errc::position_implausible);
  EXPECT_EQ(between(6), Errc::ok);
}

TEST_F(TurnsCheck, BackAtTheStartValueTheEncoderHasRestarted) {
  stand();
  const std::uint32_t start = 1;
  for (int k = 1; k < kEnough; ++k) ASSERT_EQ(between(start), Errc::position_implausible) << k;
  EXPECT_EQ(between(start), Errc::encoder_restarted);
}

TEST_F(TurnsCheck, BehindForgetNothingIsLeftOfThoseThatAgreed) {
  stand();
  for (int k = 1; k < kEnough; ++k) ASSERT_EQ(between(300), Errc::position_implausible) << k;
  (void)track->forget();
  stand();
  EXPECT_EQ(between(300), Errc::position_implausible);
}

TEST_F(TurnsCheck, WithoutAnyPositionATurnMoreOrLessIsPossible) {
  stand();
  ASSERT_EQ(alone(7), Errc::ok);
  EXPECT_EQ(alone(8), Errc::ok);
  EXPECT_EQ(alone(7), Errc::ok);
  for (unsigned bit = 1; bit < 16; ++bit) {
    EXPECT_EQ(alone(7U ^ (1U << bit)), Errc::position_implausible) << bit;
    ASSERT_EQ(alone(7), Errc::ok);
  }
  EXPECT_EQ(turns, 7);
  for (int k = 1; k < kEnough; ++k) ASSERT_EQ(alone(300), Errc::position_implausible) << k;
  EXPECT_EQ(alone(300), Errc::position_lost);
}

TEST_F(TurnsCheck, AsMuchMoreAsTheShaftCanHaveTurnedMeanwhile) {
  stand();
  ASSERT_EQ(alone(7), Errc::ok);
  // ID2 says nothing of turns: the time since the last ones counts.
  track.step = ms(50);
  for (int k = 0; k < 20; ++k) ASSERT_TRUE(track.feed(test::id2_reply(0x11), DataId::encoder_id));
  EXPECT_EQ(alone(7 + 100), Errc::ok) << "6000 rpm for a second";
  track.step = ms(100);
  EXPECT_EQ(alone(107 + 13), Errc::position_implausible);
  EXPECT_EQ(alone(107 + 13), Errc::ok) << "in twice that time it can";
}

TEST_F(TurnsCheck, TheyAgreeThoughMoreIsPossibleMeanwhile) {
  stand();
  ASSERT_EQ(alone(7), Errc::ok);
  track.step = ms(20);
  for (int k = 1; k < kEnough; ++k) ASSERT_EQ(alone(300), Errc::position_implausible) << k;
  EXPECT_EQ(alone(300), Errc::position_lost);
}

TEST_F(TurnsCheck, WhereTheLatchesAreNotKnownMoreIsPossible) {
  stand();
  ASSERT_EQ(alone(7), Errc::ok);
  Time now = track.now();
  const auto told = [&](std::uint32_t abm, Time uncertainty) {
    now += ms(10);
    Sample sample;
    return track->update(*Reply::parse(test::id1_reply(abm), DataId::multi_turn, profile), now, uncertainty,
                         sample);
  };
  ASSERT_EQ(told(7, ms(20)), Errc::ok);
  EXPECT_EQ(told(14, ms(20)), Errc::position_implausible);
  now -= ms(10);
  EXPECT_EQ(told(13, ms(20)), Errc::ok) << "10 ms, and 20 ms of both: 5 turns, and one";
}

// Of eight bits of turns, most are possible after a second.
TEST(TurnsOfFewBits, TheRangeOfTurnsWrapsToo) {
  Profile few = test::preset("tm485_17");
  few.multi_turn_bits = 8;
  Track track(few, {});
  track.step = us(100);
  track.apart = Time{0};
  for (int k = 0; k < 8; ++k) ASSERT_TRUE(track.id3(kMiddle, 7));
  const auto alone = [&](std::uint32_t abm) {
    const auto sample = track.feed(test::id1_reply(abm), DataId::multi_turn);
    return sample ? Errc::ok : sample.error();
  };
  ASSERT_EQ(alone(7), Errc::ok);
  track.step = ms(1'000);
  EXPECT_EQ(alone(7 + 103), Errc::position_implausible);
  track.step = Time{0};
  EXPECT_EQ(alone(7 + 255 - 101), Errc::position_implausible) << "103 down";
  EXPECT_EQ(alone(7 + 256 - 101), Errc::ok);
  track.step = ms(2'000);
  EXPECT_EQ(alone(100), Errc::ok) << "all of them";
  track.step = ms(1'000);
  EXPECT_EQ(alone(100 + 90), Errc::ok);
}

TEST_F(TurnsCheck, BehindStartUpAnEnidMayComeFirst) {
  track.step = ms(500);
  stand();
  track.step = us(100);
  ASSERT_TRUE(track.feed(test::id2_reply(0x11), DataId::encoder_id));
  EXPECT_EQ(alone(7 + 5), Errc::position_implausible);
  EXPECT_EQ(alone(7), Errc::ok);
}

TEST_F(TurnsCheck, NothingIsJudgedBeforeThereIsAPosition) {
  EXPECT_EQ(alone(300), Errc::ok);
  EXPECT_EQ(turns, 300);
}

}  // namespace
}  // namespace tm485
