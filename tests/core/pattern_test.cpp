// Patterns: which can be kept and with what slack, which are refused and why, and the grid that follows.
#include <gtest/gtest.h>

#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/scheduler.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::ns;
using test::us;

const CompiledProfile& profile() {
  static const CompiledProfile kProfile = test::compiled("tm485_17");
  return kProfile;
}
PortCapability margin(Time jitter) {
  PortCapability port;
  port.jitter_margin = jitter;
  return port;
}

/// Eight slots of 40 us: ID0 in six of them, ID3 in the last two.
Pattern mixed(Time slot = us(40)) {
  return Pattern(slot, {{DataId::single_turn, 6}, {DataId::everything, 1, 2}});
}

CycleRefusal refusal(const Pattern& pattern, const Phase& phase = {}, const PortCapability& port = {}) {
  const auto result = Scheduler::make(pattern, phase, profile(), port);
  EXPECT_FALSE(result);
  return result ? CycleRefusal{Errc::ok} : result.error();
}

TEST(Pattern, AnEveryEighthSlotMixIsAcceptedWithItsSlack) {
  const auto scheduler = Scheduler::make(mixed(), profile(), {});
  ASSERT_TRUE(scheduler);
  const Feasibility f = scheduler->feasibility();
  EXPECT_EQ(f.slot, us(40));
  EXPECT_EQ(f.length, us(320));
  EXPECT_EQ(f.slack, ns(0)) << "the ID0 slots are as long as T1";
  EXPECT_EQ(f.gap, ns(17'500)) << "what the two slots of ID3 leave beyond its T1";
  EXPECT_FALSE(f.free_running) << "lateness is caught up behind ID3";
  EXPECT_EQ(scheduler->sample_gap(), us(80));
  EXPECT_EQ(scheduler->unwrap_gap(), us(80)) << "the ID0 behind the ID3";
  EXPECT_TRUE(scheduler->reads_position());
}

TEST(Pattern, TheShortestSlotIsTheLongestNeedOfItsSteps) {
  EXPECT_EQ(Scheduler::make(mixed(Time{0}), profile(), {})->feasibility().slot, us(40));
  const Pattern tight(Time{0}, {{DataId::single_turn, 1}, {DataId::everything, 1}});
  EXPECT_EQ(Scheduler::make(tight, profile(), {})->feasibility().slot, ns(62'500));
  const Pattern odd(Time{0}, {{DataId::everything, 1, 3}});
  EXPECT_EQ(Scheduler::make(odd, profile(), {})->feasibility().slot, ns(20'834)) << "rounded up";
}

TEST(Pattern, RefusalsNameTheStepAndTheNearest) {
  CycleRefusal r = refusal(mixed(us(35)));
  EXPECT_EQ(r.code, Errc::period_below_t1);
  EXPECT_EQ(r.nearest, us(40));
  EXPECT_EQ(r.step, 0);
  r = refusal(Pattern(us(40), {{DataId::single_turn, 7}, {DataId::everything, 1}}));
  EXPECT_EQ(r.code, Errc::period_below_t1);
  EXPECT_EQ(r.step, 7) << "ID3 in one slot of 40 us";
  EXPECT_EQ(r.nearest, ns(62'500));
  EXPECT_EQ(refusal(Pattern(us(40), {})).code, Errc::bad_argument) << "nothing to read";
  EXPECT_EQ(refusal(Pattern(us(100), {{DataId::everything, 33}})).code, Errc::bad_argument) << "too many";
  EXPECT_TRUE(Scheduler::make(Pattern(us(100), {{DataId::everything, 32}}), profile(), {}));
  EXPECT_EQ(refusal(Pattern(us(100), {{DataId::everything, 200}, {DataId::everything, 200}})).code,
            Errc::bad_argument);
  EXPECT_EQ(refusal(Pattern(us(100), {{DataId::everything, 1, 0}})).code, Errc::bad_argument);
  r = refusal(Pattern(us(100), {{DataId::everything, 2}, {DataId::eeprom_read, 1}}));
  EXPECT_EQ(r.code, Errc::bad_argument);
  EXPECT_EQ(r.step, 2);
  PortCapability slow;
  slow.shortest_exchange = us(500);
  r = refusal(mixed(us(300)), {}, slow);
  EXPECT_EQ(r.code, Errc::period_below_port);
  EXPECT_EQ(r.nearest, us(500));
}

TEST(Pattern, StepsComeInOrderWithTheirDeclaredGaps) {
  Statistics statistics;
  Scheduler scheduler = *Scheduler::make(mixed(), profile(), {});
  scheduler.begin(us(1'000));
  for (int round = 0; round < 3; ++round) {
    for (int i = 0; i < 7; ++i) {
      EXPECT_EQ(scheduler.slot(), us(1'000 + 320 * round + 40 * i));
      EXPECT_EQ(scheduler.id(), i < 6 ? DataId::single_turn : DataId::everything);
      scheduler.on_start(scheduler.slot(), statistics);
    }
  }
  EXPECT_EQ(statistics.skipped, 0U);
}

TEST(Pattern, LatenessIsCarriedToTheGapAndCaughtUpThere) {
  Statistics statistics;
  RequestSpacing spacing;
  Scheduler scheduler = *Scheduler::make(mixed(), profile(), margin(us(2)));
  scheduler.begin(us(0));
  Time previous = -kNever;
  for (int i = 0; i < 21; ++i) {
    const Time late = i == 1 ? ns(1'900) : ns(0);
    const Time start = std::max(scheduler.slot(), spacing.earliest()) + late;
    if (i >= 1 && i <= 6) {
      EXPECT_EQ(start - us(40) * i, ns(1'900)) << i << ": carried on";
    }
    if (i >= 7) {
      EXPECT_EQ((start - us(320)) % us(40), ns(0)) << i << ": caught up";
    }
    EXPECT_GE(start - previous, us(40));
    previous = start;
    spacing.on_start(start, profile().t1(scheduler.id()));
    scheduler.on_start(start, statistics);
  }
  EXPECT_EQ(statistics.skipped, 0U);
  EXPECT_EQ(statistics.slips, 0U);
}

TEST(Pattern, AStartBeyondTheMarginSkipsTheNextStep) {
  Statistics statistics;
  Scheduler scheduler = *Scheduler::make(mixed(), profile(), margin(us(2)));
  scheduler.begin(us(0));
  scheduler.on_start(ns(2'001), statistics);
  EXPECT_EQ(statistics.skipped, 1U);
  EXPECT_EQ(scheduler.slot(), us(80));
  EXPECT_EQ(scheduler.step(), 1U) << "a slot falls out, and none of the steps";
}

// A fuzzer has found it: with as many slots lost behind each exchange as the pattern has steps but one, the same step was
// read again and again. If that was ID1, no position was ever read.
TEST(Pattern, MissedSlotsDoNotStarveAStep) {
  const Pattern pattern(us(65), {{DataId::multi_turn, 1}, {DataId::single_turn, 1}, {DataId::everything, 1}});
  Scheduler scheduler = *Scheduler::make(pattern, profile(), margin(us(1)));
  scheduler.begin(us(0));
  Statistics statistics;
  for (std::size_t i = 0; i < 30; ++i) {
    EXPECT_EQ(scheduler.slot(), us(195) * static_cast<int>(i)) << "on the grid";
    EXPECT_EQ(scheduler.step(), i % 3) << i;
    scheduler.on_start(scheduler.slot(), statistics);
    EXPECT_EQ(scheduler.give_way(us(195) * static_cast<int>(i) + us(185)), 2U);
  }
}

TEST(Pattern, InPhaseAStallPassesWholePatternsAndKeepsStepAndPhase) {
  Statistics statistics;
  Scheduler scheduler = *Scheduler::make(mixed(), Phase::at(us(4)), profile(), margin(us(2)));
  scheduler.begin(us(0));
  scheduler.on_start(us(320) * 1'000 + us(95), statistics);  // in the third slot of a pattern
  EXPECT_EQ(scheduler.slot(), us(320) * 1'000 + us(160)) << "T1 ends at 135";
  EXPECT_EQ(statistics.skipped, 7'003U);
  for (int i = 4; i < 7; ++i) {
    EXPECT_EQ(scheduler.id(), i < 6 ? DataId::single_turn : DataId::everything) << i;
    scheduler.on_start(scheduler.slot(), statistics);
  }
  EXPECT_EQ(scheduler.slot(), us(320) * 1'001);
}

// Of a pattern in phase a step that has given way is asked before it gives way again.
TEST(Pattern, InPhaseEachStepGivesWayOnceUntilItWasAsked) {
  const Pattern pattern(us(70),
                        {{DataId::single_turn, 1}, {DataId::everything, 1}, {DataId::everything, 1, 2}});
  Statistics statistics;
  Scheduler scheduler = *Scheduler::make(pattern, Phase::at(us(4)), profile(), {});
  scheduler.begin(us(0));
  EXPECT_TRUE(scheduler.may_give_way(us(1'000)));
  EXPECT_EQ(scheduler.give_way(us(70)), 1U);
  EXPECT_TRUE(scheduler.may_give_way(us(280))) << "the two others";
  EXPECT_FALSE(scheduler.may_give_way(us(282))) << "and the first again";
  EXPECT_EQ(scheduler.give_way(us(142)), 2U) << "counted from the slot, however late it is";
  EXPECT_EQ(scheduler.slot(), us(280));
  EXPECT_FALSE(scheduler.may_give_way(us(282)));
  scheduler.on_start(us(280), statistics);
  EXPECT_FALSE(scheduler.may_give_way(us(352)));
  scheduler.on_start(us(350), statistics);
  scheduler.on_start(us(420), statistics);
  EXPECT_TRUE(scheduler.may_give_way(us(1'000)));
  EXPECT_EQ(scheduler.give_way(us(560) + us(2'800)), 30U);
  EXPECT_FALSE(scheduler.may_give_way(scheduler.slot() + us(2))) << "all have";
  scheduler.begin(scheduler.slot());
  EXPECT_TRUE(scheduler.may_give_way(scheduler.slot() + us(2)));
}

// Steps that T1 pushes out, because their owner is late every time, have not given way: the background has its turn.
TEST(Pattern, StepsThatT1PushesOutHaveNotGivenWay) {
  const Pattern pattern(us(70), {{DataId::everything, 1}, {DataId::single_turn, 1}});
  Statistics statistics;
  Scheduler scheduler = *Scheduler::make(pattern, Phase::at(us(4)), profile(), {});
  scheduler.begin(us(0));
  for (int i = 0; i < 10; ++i) scheduler.on_start(scheduler.slot() + us(10), statistics);
  EXPECT_EQ(statistics.skipped, 10U);
  EXPECT_TRUE(scheduler.may_give_way(scheduler.slot() + us(140)));
  // Where nobody counts on a step's place in time, none ever does.
  for (const Phase& phase : {Phase{}, Phase::at(us(4))}) {
    Scheduler one = *Scheduler::make(Cycle{DataId::everything, us(70)}, phase, profile(), {});
    one.begin(us(0));
    EXPECT_GT(one.give_way(us(300)), 3U);
    EXPECT_TRUE(one.may_give_way(us(900)));
  }
  Scheduler any = *Scheduler::make(pattern, profile(), {});
  any.begin(us(0));
  EXPECT_GT(any.give_way(us(300)), 3U);
  EXPECT_TRUE(any.may_give_way(us(900)));
}

TEST(Pattern, AnExchangeThatTakesTheLineMovesOnByTheSlotsItTakes) {
  Scheduler scheduler = *Scheduler::make(mixed(), profile(), {});
  scheduler.begin(us(0));
  EXPECT_EQ(scheduler.give_way(us(40)), 1U);
  EXPECT_EQ(scheduler.slot(), us(40));
  EXPECT_EQ(scheduler.give_way(us(40)), 0U) << "it ends where the slot begins";
  EXPECT_EQ(scheduler.give_way(us(121)), 2U) << "a microsecond is carried on";
  EXPECT_EQ(scheduler.slot(), us(120));
  EXPECT_EQ(scheduler.give_way(us(122)), 1U);
  EXPECT_EQ(scheduler.slot(), us(160));
  Scheduler free = *Scheduler::make(Cycle{}, profile(), {});
  free.begin(us(0));
  EXPECT_EQ(free.give_way(us(40)), 1U);
  EXPECT_EQ(free.slot(), us(40)) << "a free grid moves";
}

TEST(Pattern, AnEpochSetsThePhaseOfTheLatch) {
  const Phase phase = Phase::at(us(1'000'000));
  for (const int first : {0, 1, 95, 96, 97, 999'999, 1'000'001, 7'654'321}) {
    Scheduler scheduler = *Scheduler::make(Cycle{DataId::everything, us(100)}, phase, profile(), {});
    EXPECT_FALSE(scheduler.free_running());
    scheduler.begin(us(first));
    EXPECT_GE(scheduler.slot(), us(first));
    EXPECT_LT(scheduler.slot(), us(first + 100));
    EXPECT_EQ((scheduler.slot() + us(4) - us(1'000'000)) % us(100), ns(0)) << "a request is 4 us long";
  }
}

TEST(Pattern, WithAPhaseEvenAPatternWithoutSlackKeepsItsGrid) {
  Statistics statistics;
  Scheduler scheduler = *Scheduler::make(Cycle{}, Phase::at(us(0)), profile(), margin(us(2)));
  scheduler.begin(us(0));
  const Time first = scheduler.slot();
  scheduler.on_start(first + us(1), statistics);
  EXPECT_EQ(scheduler.slot(), first + ns(62'500));
  scheduler.on_start(first + ns(63'500), statistics);  // carried on: there is nothing to catch up in
  EXPECT_EQ(statistics.skipped, 0U);
  scheduler.on_start(first + ns(125'000 + 2'001), statistics);
  EXPECT_EQ(statistics.skipped, 1U);
  EXPECT_EQ(statistics.slips, 0U);
}

TEST(Pattern, AServoPeriodThatDoesNotFitIsRefusedWithASlotThatDoes) {
  EXPECT_EQ(ServoClock{}.lead, Time{0}) << "at the tick, unless it is asked for";
  const auto locked = [](Time period, Time lead) { return Phase::locked_to({period, lead}); };
  EXPECT_TRUE(
      Scheduler::make(Cycle{DataId::everything, ns(62'500)}, locked(ns(62'500), us(55)), profile(), {}));
  EXPECT_TRUE(Scheduler::make(Cycle{DataId::everything, ns(62'500)}, locked(ms(1), us(55)), profile(), {}));
  EXPECT_TRUE(Scheduler::make(mixed(), locked(us(40), us(55)), profile(), {}));
  EXPECT_TRUE(
      Scheduler::make(Cycle{DataId::everything, ns(111'100)}, locked(ns(333'333), us(55)), profile(), {}))
      << "a third of a 3 kHz period, as well as nanoseconds can say it";

  CycleRefusal r = refusal(Cycle{DataId::everything, us(70)}, locked(ms(1), us(55)));
  EXPECT_EQ(r.code, Errc::servo_mismatch);
  EXPECT_EQ(r.nearest, ns(71'428));
  EXPECT_TRUE(Scheduler::make(Cycle{DataId::everything, r.nearest}, locked(ms(1), us(55)), profile(), {}));
  r = refusal(Cycle{DataId::everything, us(130)}, locked(us(100), us(55)));
  EXPECT_EQ(r.code, Errc::servo_mismatch);
  EXPECT_EQ(r.nearest, us(200));
  r = refusal({us(70), {{DataId::single_turn, 1}, {DataId::multi_turn, 1}}}, locked(us(125), us(55)));
  EXPECT_EQ(r.code, Errc::servo_mismatch);
  EXPECT_EQ(r.nearest, us(125)) << "two slots are 250 us then, twice the period";
  EXPECT_EQ(refusal(Cycle{DataId::everything, us(100)}, locked(ns(0), us(40))).code, Errc::servo_mismatch);
  EXPECT_EQ(refusal(Cycle{DataId::everything, us(100)}, locked(ms(30), us(40))).code, Errc::servo_mismatch)
      << "300 patterns in a period";
}

TEST(Pattern, ALeadThatTheReplyCannotKeepIsRefused) {
  const Cycle cycle{DataId::everything, us(100)};
  const auto ready = Scheduler::make(cycle, profile(), {})->feasibility().ready;
  EXPECT_EQ(ready, us(50)) << "T2 at most 6, eleven characters";
  const CycleRefusal r = refusal(cycle, Phase::locked_to({us(100), us(50) - ns(1)}));
  EXPECT_EQ(r.code, Errc::lead_too_short);
  EXPECT_EQ(r.nearest, ready);
  EXPECT_TRUE(Scheduler::make(cycle, Phase::locked_to({us(100), ready}), profile(), {}));
  EXPECT_EQ(refusal(cycle, Phase::locked_to({us(100), us(101)})).code, Errc::bad_argument);
}

}  // namespace
}  // namespace tm485
