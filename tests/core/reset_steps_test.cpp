// A reset run request by request, against replies written by hand: how often it tries, when it gives up, what it takes
// for done. On the encoder model: tests/integration/reset_run_test.cpp.
#include <gtest/gtest.h>

#include <optional>

#include "support/completions.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/reset_run.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::us;

class ResetSteps : public testing::Test {
 protected:
  /// The next request, as soon as it is due.
  Request ask() {
    now = std::max(now, run->due());
    const auto request = run->next(now);
    if (!request) throw std::runtime_error("nothing is due");
    EXPECT_FALSE(run->next(now)) << "one at a time";
    return *request;
  }
  /// Where the shaft is, or the reply to a reset request.
  void answer(const Request& request, std::uint32_t abs = 0, std::uint32_t turns = 1, std::uint8_t sf = 0,
              std::uint8_t almc = 0) {
    const test::Bytes reply = request.id() == DataId::everything
                                  ? test::id3_reply(abs, turns, 0x11, sf, almc)
                                  : test::short_reply(request.bytes()[0], abs, sf);
    run->on_completion(test::heard(request, reply, profile), now += us(100));
  }
  void fail() { run->on_completion(test::failed(ask()), now += us(100)); }
  void ten() {
    for (int i = 0; i < 10; ++i) {
      EXPECT_TRUE(run->needs_line());
      answer(ask());
    }
  }
  [[nodiscard]] ResetOutcome outcome() const { return run->outcome().value_or(ResetOutcome{}); }

  CompiledProfile profile = test::compiled("tm485_17");
  std::optional<ResetRun> run{std::in_place, profile};
  Time now{ms(1'000)};
};

TEST_F(ResetSteps, TenAndALookBeforeAndAfter) {
  EXPECT_FALSE(run->active());
  EXPECT_EQ(run->due(), kNever);
  ASSERT_TRUE(run->start(ResetKind::errors));
  const Request before = ask();
  EXPECT_EQ(before.id(), DataId::everything);
  EXPECT_EQ(run->priority(), Priority::diagnostics);
  EXPECT_FALSE(run->holds_cycle());
  answer(before, 5, 9, 0x10, 0x04);
  for (int i = 0; i < 10; ++i) {
    EXPECT_TRUE(run->needs_line());
    EXPECT_EQ(run->priority(), Priority::reset_run);
    const Request request = ask();
    EXPECT_EQ(request.id(), DataId::reset_errors);
    answer(request);
  }
  EXPECT_FALSE(run->needs_line());
  EXPECT_TRUE(run->holds_cycle());
  EXPECT_EQ(run->due(), now + ms(5));
  answer(ask(), 6, 10);
  EXPECT_FALSE(run->holds_cycle());
  EXPECT_EQ(outcome().verdict, ResetVerdict::verified);
  EXPECT_EQ(outcome().runs, 1);
  EXPECT_EQ(outcome().abs_before, 5U);
  EXPECT_EQ(outcome().abs_after, 6U);
  EXPECT_EQ(outcome().turns_before, 9);
  EXPECT_EQ(outcome().turns_after, 10);
  EXPECT_EQ(outcome().status_before, StatusSet(0x10, 0x04));
  EXPECT_TRUE(outcome().status_after.empty());
}

TEST_F(ResetSteps, OneThatIsLostIsFollowedByAnotherRequestAndTenMore) {
  ASSERT_TRUE(run->start(ResetKind::errors));
  answer(ask());
  for (int i = 0; i < 9; ++i) answer(ask());
  fail();
  EXPECT_FALSE(run->needs_line()) << "so that the encoder forgets";
  EXPECT_TRUE(run->holds_cycle());
  const Request between = ask();
  EXPECT_EQ(between.id(), DataId::everything);
  answer(between);
  ten();
  answer(ask());
  EXPECT_EQ(outcome().verdict, ResetVerdict::verified);
  EXPECT_EQ(outcome().runs, 2);
}

TEST_F(ResetSteps, FiveRunsAreTheMost) {
  ASSERT_TRUE(run->start(ResetKind::errors));
  answer(ask());
  int runs = 0;
  while (run->active() && ++runs < 100) {
    EXPECT_TRUE(run->needs_line());
    fail();
    if (run->active()) answer(ask());
  }
  EXPECT_EQ(runs, 5);
  EXPECT_EQ(outcome().verdict, ResetVerdict::failed);
  EXPECT_EQ(outcome().code, Errc::timeout);
}

TEST_F(ResetSteps, ALookIsTriedTwelveTimesMore) {
  ASSERT_TRUE(run->start(ResetKind::errors));
  const Time begun = now;
  int asked = 0;
  while (run->active() && ++asked < 100) {
    fail();
    if (asked == 3) {
      EXPECT_EQ(run->due(), begun + us(300)) << "at once against noise";
    }
    if (asked == 4) {
      EXPECT_EQ(run->due(), now + ms(250)) << "slower against one that boots";
    }
  }
  EXPECT_EQ(asked, 13);
  EXPECT_EQ(outcome().verdict, ResetVerdict::failed);
}

TEST_F(ResetSteps, WhatTheBusRefuses) {
  ASSERT_TRUE(run->start(ResetKind::errors));
  (void)ask();
  run->on_refused(Errc::busy, now);
  EXPECT_TRUE(run->active()) << "tried again";
  (void)ask();
  run->on_refused(Errc::no_gap, now);
  EXPECT_EQ(outcome().verdict, ResetVerdict::refused);
  EXPECT_EQ(outcome().code, Errc::no_gap);
  // Late, of what has ended.
  run->on_completion(test::failed(*Request::make(DataId::everything)), now);
  EXPECT_FALSE(run->active());
}

TEST_F(ResetSteps, ZeroWantsAShaftThatStandsStillForAWhile) {
  // 2^-15 of a turn: 4 counts of 17 bits, across the seam too.
  for (const auto& [moved, verdict] :
       {std::pair{131'072 - 3, ResetVerdict::verified}, {6, ResetVerdict::refused}}) {
    run.emplace(profile);
    ASSERT_TRUE(run->start(ResetKind::zero));
    answer(ask(), 1);
    EXPECT_EQ(run->due(), now + ms(5));
    const Time begun = now;
    while (run->active() && !run->needs_line()) answer(ask(), static_cast<std::uint32_t>(moved));
    if (verdict == ResetVerdict::refused) {
      EXPECT_FALSE(run->active());
      EXPECT_EQ(outcome().code, Errc::shaft_moves);
      continue;
    }
    EXPECT_GE(now - begun, ms(50));
    EXPECT_LT(now - begun, ms(56));
    ten();
    EXPECT_EQ(run->due(), now + ms(105)) << "it takes effect, and a look";
    answer(ask(), 131'072 - 16);
    EXPECT_EQ(outcome().verdict, verdict);
  }
}

TEST_F(ResetSteps, ZeroThatIsNotAtZero) {
  ASSERT_TRUE(run->start(ResetKind::zero));
  while (!run->needs_line()) answer(ask(), 500);
  ten();
  answer(ask(), 17);
  EXPECT_EQ(outcome().verdict, ResetVerdict::refused);
  EXPECT_EQ(outcome().code, Errc::reset_without_effect);
}

TEST_F(ResetSteps, TurnsBackAtTheirStartOrBesideIt) {
  for (const auto& [turns, verdict] : {std::pair{0U, ResetVerdict::verified},
                                       {2U, ResetVerdict::verified},
                                       {3U, ResetVerdict::refused},
                                       {0xFFFFU, ResetVerdict::refused}}) {
    run.emplace(profile);
    ASSERT_TRUE(run->start(ResetKind::multi_turn));
    answer(ask(), 0, 700);
    ten();
    answer(ask(), 0, turns);
    EXPECT_EQ(outcome().verdict, verdict) << turns;
    EXPECT_EQ(outcome().turns_after, static_cast<std::int16_t>(turns));
  }
}

// Noise can put the read-back off, and the shaft turns on meanwhile: where it is then says neither that the turns were reset nor
// that they were not. So they are reset once more.
TEST_F(ResetSteps, TurnsThatAreReadBackLateAreResetAgain) {
  ASSERT_TRUE(run->start(ResetKind::multi_turn));
  answer(ask(), 0, 20);
  ten();
  for (int i = 0; i < 4; ++i) fail();  // three at once, then after 250 ms
  EXPECT_GT(run->due(), now + ms(200));
  answer(ask(), 0, 13);  // 3000 rpm up from the first, or 1700 down
  EXPECT_TRUE(run->needs_line());
  ten();
  answer(ask(), 0, 1);
  EXPECT_EQ(outcome().verdict, ResetVerdict::verified);
  EXPECT_EQ(outcome().runs, 2);
  EXPECT_EQ(outcome().turns_before, 20);
  EXPECT_EQ(outcome().turns_after, 1);
}

TEST_F(ResetSteps, TurnsThatNoShaftCanHaveMadeWereReset) {
  for (const std::uint32_t before : {700U, 0x8001U}) {  // on the other side of all turns too
    run.emplace(profile);
    ASSERT_TRUE(run->start(ResetKind::multi_turn));
    answer(ask(), 0, before);
    ten();
    for (int i = 0; i < 4; ++i) fail();
    answer(ask(), 0, 13);
    EXPECT_EQ(outcome().verdict, ResetVerdict::verified) << before;
    EXPECT_EQ(outcome().runs, 1);
  }
}

TEST_F(ResetSteps, TurnsThatNoShaftCanHaveMadeSinceWereNotReset) {
  ResetConfig slow;
  slow.max_speed_rpm = 1'000;
  for (const auto& [config, refused] : {std::pair{ResetConfig{}, false}, {slow, true}}) {
    run.emplace(profile, config);
    ASSERT_TRUE(run->start(ResetKind::multi_turn));
    answer(ask(), 0, 30);
    ten();
    for (int i = 0; i < 4; ++i) fail();
    answer(ask(), 0, 20);  // 256 ms: 26 turns at 6000 rpm, 5 at 1000
    EXPECT_EQ(run->active(), !refused);
    if (!refused) continue;
    EXPECT_EQ(outcome().verdict, ResetVerdict::refused);
    EXPECT_EQ(outcome().code, Errc::reset_without_effect);
  }
}

TEST_F(ResetSteps, TurnsThatAreReadBackLateEveryTimeAreNotCalledReset) {
  // What ended an earlier run says nothing of this one.
  ASSERT_TRUE(run->start(ResetKind::errors));
  (void)ask();
  run->on_refused(Errc::no_gap, now);
  ASSERT_TRUE(run->start(ResetKind::multi_turn));
  answer(ask(), 0, 20);
  for (int runs = 0; runs < 5; ++runs) {
    ten();
    for (int i = 0; i < 4; ++i) fail();
    answer(ask(), 0, 13);
  }
  EXPECT_FALSE(run->active());
  EXPECT_EQ(outcome().verdict, ResetVerdict::failed);
  EXPECT_EQ(outcome().code, Errc::timeout) << "what kept the read-back off";
  EXPECT_EQ(outcome().runs, 5);
}

TEST_F(ResetSteps, ABitThatStaysIsNamedUnlessThePolicyIgnoresIt) {
  ASSERT_TRUE(run->start(ResetKind::errors));
  answer(ask());
  ten();
  answer(ask(), 0, 1, 0x10, 0x04);
  EXPECT_EQ(outcome().verdict, ResetVerdict::cause_persists);
  EXPECT_EQ(outcome().persisting, StatusSet(0x10, 0x04));
  EXPECT_EQ(outcome().status_after, StatusSet(0x10, 0x04));
  ASSERT_TRUE(run->start(ResetKind::errors));
  answer(ask());
  ten();
  answer(ask(), 0, 1, profile.profile().reserved_status.sf(), profile.profile().reserved_status.almc());
  EXPECT_EQ(outcome().verdict, ResetVerdict::verified) << "reserved: no alarm";
  EXPECT_TRUE(outcome().persisting.empty());
}

}  // namespace
}  // namespace tm485
