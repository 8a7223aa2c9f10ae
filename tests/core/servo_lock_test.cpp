// The lock to a servo clock: drift is followed, jitter is not, T1 is kept whatever the servo clock does.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "support/frames.hpp"
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

/// A servo clock of its own, and a host that starts every request when it is due.
struct World {
  Scheduler scheduler;
  Time servo_period;
  double ppm = 0;                ///< the servo clock is slower by so much
  std::int64_t tick_jitter = 0;  ///< a tick is stamped up to so many ns late
  std::int64_t host_jitter = 0;
  bool ticking = true;
  test::Rng rng{80};
  Statistics statistics{};
  RequestSpacing spacing{};
  long double tick_at = 123'456.0L;  ///< ns
  Time last_latch{0};                ///< of the pattern's first step
  Time previous_start = -kNever;
  Time previous_t1{0};
  std::uint64_t t1_violations = 0;
  Time now{0};

  Time jitter(std::int64_t most) {
    return Time{most == 0
                    ? 0
                    : static_cast<std::int64_t>(test::random_below(rng, static_cast<std::size_t>(most + 1)))};
  }
  long double period() const { return static_cast<long double>(servo_period.count()) * (1.0L + ppm * 1e-6L); }

  /// One event: a tick or a request, whichever comes first. Answers the true tick if it was one.
  bool step(Time& true_tick) {
    const Time due = std::max(scheduler.slot(), spacing.earliest());
    const Time tick{static_cast<std::int64_t>(std::llround(tick_at))};
    if (tick <= due) {
      now = std::max(now, tick);
      if (ticking) scheduler.on_servo_tick(tick + jitter(tick_jitter), statistics);
      true_tick = tick;
      tick_at += period();
      return true;
    }
    const Time start = due + jitter(host_jitter);
    now = std::max(now, start);
    if (start - previous_start < previous_t1) ++t1_violations;
    previous_start = start;
    previous_t1 = profile().t1(scheduler.id());
    if (scheduler.step() == 0) last_latch = start + us(4);
    spacing.on_start(start, previous_t1);
    scheduler.on_start(start, statistics);
    return false;
  }
};

World make(const Pattern& pattern, Time servo_period, Time lead, Time jitter_margin = Time{0}) {
  PortCapability port;
  port.jitter_margin = jitter_margin;
  World world{*Scheduler::make(pattern, Phase::locked_to({servo_period, lead}), profile(), port),
              servo_period};
  world.scheduler.begin(us(7));
  return world;
}

/// Runs until `ticks` have come and answers the largest distance of a latch from lead before its tick, over the last
/// quarter of them.
Time worst_error(World& world, Time lead, int ticks) {
  Time worst{0};
  Time tick;
  for (int i = 0; i < ticks;) {
    if (!world.step(tick)) continue;
    ++i;
    if (i < ticks * 3 / 4) continue;
    Time error = (tick - lead - world.last_latch) % std::min(world.scheduler.length(), world.servo_period);
    const Time unit = std::min(world.scheduler.length(), world.servo_period);
    if (error > unit / 2) error -= unit;
    if (error < -unit / 2) error += unit;
    worst = std::max(worst, std::max(error, -error));
  }
  return worst;
}

TEST(ServoLock, ALatchComesTheLeadBeforeEveryTick) {
  World world = make(Cycle{DataId::everything, us(100)}, us(100), us(55));
  EXPECT_LE(worst_error(world, us(55), 2'000), ns(1));
  EXPECT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::locked);
  EXPECT_EQ(world.statistics.servo_locks, 1U);
  EXPECT_EQ(world.statistics.servo_ticks, 2'000U);
  EXPECT_EQ(world.statistics.skipped, 0U);
}

TEST(ServoLock, DriftOfEitherSignIsFollowedAtEveryRatio) {
  struct Case {
    Pattern pattern;
    Time servo;
    Time lead;
  };
  const Case cases[] = {
      {Cycle{DataId::everything, us(100)}, us(100), us(60)},
      {Cycle{DataId::everything, us(100)}, ms(1), us(60)},
      {Cycle{DataId::single_turn, us(50)}, ns(500'000), us(40)},
      {Cycle{DataId::everything, us(200)}, us(100), us(60)},
      {Pattern(us(45), {{DataId::single_turn, 6}, {DataId::everything, 1, 2}}), us(45), us(40)},
      {Pattern(us(45), {{DataId::single_turn, 6}, {DataId::everything, 1, 2}}), us(360), us(40)},
  };
  for (const auto& [pattern, servo, lead] : cases) {
    for (const double ppm : {-300.0, -20.0, 0.0, 20.0, 300.0}) {
      World world = make(pattern, servo, lead);
      world.ppm = ppm;
      EXPECT_LE(worst_error(world, lead, 8'000), ns(400)) << servo.count() << " ns, " << ppm << " ppm";
      EXPECT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::locked);
      EXPECT_NEAR(world.scheduler.servo_lock()->drift_ppm(), ppm, 12);
      EXPECT_EQ(world.t1_violations, 0U);
      EXPECT_EQ(world.statistics.servo_locks, 1U);
      EXPECT_LE(world.statistics.skipped, 1U) << "at most while the grid is moved";
    }
  }
}

// Many ticks a pattern all speak of the same error before it is corrected once.
TEST(ServoLock, IsStableUpToTheLargestRatio) {
  for (const int ratio : {2, 16, 32, 60}) {
    World longer = make(Cycle{DataId::everything, us(100) * ratio}, us(100), us(60));
    longer.ppm = 30;
    EXPECT_LE(worst_error(longer, us(60), 40'000), us(2)) << ratio << " ticks a pattern";
    EXPECT_EQ(longer.statistics.servo_locks, 1U) << ratio;
    World shorter = make(Cycle{DataId::everything, us(100)}, us(100) * ratio, us(60));
    shorter.ppm = 900;
    EXPECT_LE(worst_error(shorter, us(60), 8'000), us(2)) << ratio << " patterns a tick";
  }
  PortCapability port;
  EXPECT_FALSE(Scheduler::make(Cycle{DataId::everything, us(6'100)}, Phase::locked_to({us(100), us(60)}),
                               profile(), port));
}

TEST(ServoLock, LateStampedTicksMoveTheGridLittle) {
  World world = make(Cycle{DataId::everything, us(100)}, us(100), us(60));
  world.tick_jitter = 2'000;  // uniform: one microsecond late in the mean
  world.ppm = 50;
  EXPECT_LE(worst_error(world, us(60) - us(1), 20'000), ns(900)) << "of two microseconds of jitter";
  EXPECT_EQ(world.statistics.servo_locks, 1U);
  EXPECT_EQ(world.statistics.skipped, 0U);
}

TEST(ServoLock, AClockThatJumpsIsFoundAgain) {
  World world = make(Cycle{DataId::everything, us(100)}, us(100), us(60));
  EXPECT_LE(worst_error(world, us(60), 1'000), ns(1));
  world.tick_at += 37'000.0L;
  EXPECT_LE(worst_error(world, us(60), 1'000), ns(10));
  EXPECT_EQ(world.statistics.servo_locks, 2U);
  EXPECT_EQ(world.t1_violations, 0U);
}

TEST(ServoLock, OneStrayTickMovesNothingMuch) {
  World world = make(Cycle{DataId::everything, us(100)}, us(100), us(60));
  (void)worst_error(world, us(60), 1'000);
  world.scheduler.on_servo_tick(world.now + us(33), world.statistics);
  Time tick;
  Time worst{0};
  for (int i = 0; i < 400; ++i)
    if (world.step(tick)) worst = std::max(worst, std::chrono::abs(tick - us(60) - world.last_latch));
  EXPECT_LE(worst, us(2)) << "an eighth of a sixteenth of the period, and what the rate adds";
  EXPECT_EQ(world.statistics.servo_locks, 1U);
}

TEST(ServoLock, WithoutTicksTheGridGoesOnAtTheLastRate) {
  World world = make(Cycle{DataId::everything, us(100)}, us(100), us(60));
  world.ppm = 200;
  EXPECT_LE(worst_error(world, us(60), 8'000), ns(100));
  world.ticking = false;
  EXPECT_LE(worst_error(world, us(60), 1'000), us(2)) << "20 us without the rate";
  world.ticking = true;
  EXPECT_LE(worst_error(world, us(60), 1'000), ns(200));
  EXPECT_EQ(world.statistics.servo_locks, 2U) << "64 periods without a tick: sought anew";
}

TEST(ServoLock, WhileThePatternPausesTheClockIsFollowed) {
  World world = make(Cycle{DataId::everything, us(100)}, us(100), us(60));
  world.ppm = 200;
  EXPECT_LE(worst_error(world, us(60), 8'000), ns(100));
  world.scheduler.pause();
  for (int i = 0; i < 5'000; ++i) {
    world.now = Time{static_cast<std::int64_t>(std::llround(world.tick_at))};
    world.scheduler.on_servo_tick(world.now, world.statistics);
    world.tick_at += world.period();
  }
  EXPECT_NEAR(world.scheduler.servo_lock()->drift_ppm(), 200, 12);
  world.scheduler.begin(world.now + us(1));
  EXPECT_LE(worst_error(world, us(60), 4), ns(100)) << "from the start";
  EXPECT_EQ(world.statistics.servo_locks, 1U);
}

TEST(ServoLock, TicksDoNotMoveTheGridOfAPatternThatRunsAndIsLate) {
  World world = make(Cycle{DataId::everything, us(100)}, us(100), us(60));
  (void)worst_error(world, us(60), 1'000);
  for (int i = 0; i < 5; ++i) {
    world.now = Time{static_cast<std::int64_t>(std::llround(world.tick_at))};
    world.scheduler.on_servo_tick(world.now, world.statistics);
    world.tick_at += world.period();
  }
  const Time slot = world.scheduler.slot();
  EXPECT_LT(slot, world.now - us(400)) << "still the one that was missed";
  const std::uint32_t skipped = world.statistics.skipped;
  world.scheduler.on_start(world.now, world.statistics);
  EXPECT_GE(world.statistics.skipped - skipped, 4U);
  EXPECT_LE(world.scheduler.slot(), world.now + us(200)) << "the next that T1 allows";
}

// Found by the campaign (seed 2, run 2957): a run of resets had the line for 108 ms. The grid stood still, each tick found it
// late by the same drift once more, and the rate was wound up to three times the true one. Behind the run the grid was 62 us
// off, the lock was given up, and the next pattern put off by nearly its whole length.
TEST(ServoLock, WhileSomethingElseHasTheLineTicksTeachNothing) {
  for (const double ppm : {-300.0, 300.0}) {
    World world =
        make(Pattern(us(48), {{DataId::single_turn, 6}, {DataId::everything, 1, 2}}), us(1'536), us(620));
    world.ppm = ppm;
    EXPECT_LE(worst_error(world, us(620), 2'000), ns(100));
    for (int i = 0; i < 70; ++i) {
      world.now = Time{static_cast<std::int64_t>(std::llround(world.tick_at))};
      world.scheduler.on_servo_tick(world.now, world.statistics);
      world.tick_at += world.period();
    }
    EXPECT_GT(world.scheduler.give_way(world.now + us(100)), 1'500U);
    EXPECT_NEAR(world.scheduler.servo_lock()->drift_ppm(), ppm, 12);
    EXPECT_LE(worst_error(world, us(620), 4), us(1)) << "from the first one behind it";
    EXPECT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::locked);
    EXPECT_EQ(world.statistics.servo_locks, 1U);
  }
}

// A write to the EEPROM is known to hold the line for 18 ms before it begins, so the grid is put off at once.
TEST(ServoLock, AGridThatWasPutOffIsNotTaughtByTicksThatComeBefore) {
  for (const double ppm : {-400.0, 100.0, 400.0}) {
    World world = make(Cycle{DataId::everything, us(125)}, us(125), us(60));
    world.ppm = ppm;
    EXPECT_LE(worst_error(world, us(60), 8'000), ns(100));
    EXPECT_GT(world.scheduler.give_way(world.now + ms(18)), 140U);
    Time tick;
    for (int i = 0; i < 144; ++i) ASSERT_TRUE(world.step(tick)) << "no slot before the line is free";
    EXPECT_NEAR(world.scheduler.servo_lock()->drift_ppm(), ppm, 12);
    EXPECT_LE(worst_error(world, us(60), 4), ns(200));
    EXPECT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::locked);
    EXPECT_EQ(world.statistics.servo_locks, 1U);
  }
}

// Found by the campaign (seed 4, run 1470), once it looked at the phase behind writes: what a hold leaves of an error was taken
// for a rate eight ticks long, four times too much, and the next hold made four times as much of that.
TEST(ServoLock, ManyHoldsInARowDoNotMakeItSwing) {
  for (const std::int64_t jitter : {0, 1'000}) {
    World world = make(Cycle{DataId::everything, us(134)}, us(134), us(60));
    world.ppm = -376;
    world.tick_jitter = jitter;
    EXPECT_LE(worst_error(world, us(60), 8'000), us(1));
    Time worst{0};
    for (int hold = 0; hold < 200; ++hold) {
      (void)world.scheduler.give_way(world.now + ms(18));
      Time tick;
      for (int ticks = 0; ticks < 150; ticks += world.step(tick) ? 1 : 0) {
        if (world.scheduler.slot() > world.now + us(300)) continue;  // a hold
        Time error = (tick - us(60) - world.last_latch) % us(134);
        if (error > us(67)) error -= us(134);
        if (error < -us(67)) error += us(134);
        if (world.last_latch > world.now - us(134)) worst = std::max(worst, std::max(error, -error));
      }
    }
    EXPECT_LE(worst, us(2)) << jitter;
    EXPECT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::locked);
    EXPECT_NEAR(world.scheduler.servo_lock()->drift_ppm(), -376, 60);
  }
}

// Found by the campaign (seed 20261122, run 438): with four ticks a pattern, each stamped up to 1.8 us late, the rate went to and
// fro by 100 ppm, which is 2 us at the end of a write and the more the next time.
TEST(ServoLock, WhatJitterHasTaughtIsNotRunThroughAHold) {
  World world = make(Cycle{DataId::everything, us(198)}, ns(49'500), us(88));
  world.ppm = 58;
  world.tick_jitter = 1'848;
  Time tick;
  Time worst{0};
  for (int requests = 1; requests < 20'000;) {
    if (!world.step(tick)) {
      if (++requests % 7 == 0) (void)world.scheduler.give_way(world.scheduler.slot() + ms(18));
    } else if (requests > 400 && world.last_latch > world.now - us(198)) {
      Time error = (tick - us(88) - world.last_latch) % ns(49'500);
      if (error > ns(24'750)) error -= ns(49'500);
      if (error < -ns(24'750)) error += ns(49'500);
      worst = std::max(worst, std::max(error, -error));
    }
  }
  EXPECT_LE(worst, us(4));
  EXPECT_NEAR(world.scheduler.servo_lock()->drift_ppm(), 58, 120);
}

// Nor do they keep it from learning the rate in the first place.
TEST(ServoLock, TheRateIsLearnedThroughHolds) {
  World world = make(Cycle{DataId::everything, us(134)}, us(134), us(60));
  world.ppm = 400;
  Time tick;
  for (int hold = 0; hold < 40; ++hold) {
    for (int ticks = 0; ticks < 12;) ticks += world.step(tick) ? 1 : 0;
    (void)world.scheduler.give_way(world.now + ms(18));
    for (int ticks = 0; ticks < 134;) ticks += world.step(tick) ? 1 : 0;
  }
  EXPECT_NEAR(world.scheduler.servo_lock()->drift_ppm(), 400, 12);
  EXPECT_LE(worst_error(world, us(60), 4), us(1));
}

TEST(ServoLock, WithoutTicksAGridThatWasPutOffIsLostAllTheSame) {
  World world = make(Cycle{DataId::everything, us(125)}, us(125), us(60));
  (void)worst_error(world, us(60), 2'000);
  Time tick;
  (void)world.scheduler.give_way(world.now + ms(18));
  for (int ticks = 0; ticks < 120;) ticks += world.step(tick) ? 1 : 0;
  world.ticking = false;
  for (int ticks = 0; ticks < 70;) ticks += world.step(tick) ? 1 : 0;
  EXPECT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::waiting) << "it heard one in the hold";
  world.ticking = true;
  (void)worst_error(world, us(60), 2'000);
  (void)world.scheduler.give_way(world.now + ms(18));
  world.ticking = false;
  for (int ticks = 0; ticks < 144 + 30;) ticks += world.step(tick) ? 1 : 0;
  EXPECT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::locked) << "it can have heard none";
  for (int ticks = 0; ticks < 40;) ticks += world.step(tick) ? 1 : 0;
  EXPECT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::waiting);
}

// A stolen slot or two are no hold: what the first tick behind them says is hardly of them.
TEST(ServoLock, StolenSlotsDoNotMakeItSwing) {
  for (const int patterns : {1, 4, 8}) {
    for (const int every : {6, 24, 60}) {
      for (const Time span : {us(130), us(200)}) {
        World world = make(Cycle{DataId::everything, us(125)}, us(125) * patterns, us(60));
        world.ppm = -300;
        EXPECT_LE(worst_error(world, us(60), 4'000), ns(100));
        Time tick;
        for (int requests = 1; requests < 20'000;) {
          if (world.step(tick)) continue;
          if (++requests % every == 0) (void)world.scheduler.give_way(world.scheduler.slot() + span);
          if (requests > 2'000) {
            ASSERT_NEAR(world.scheduler.servo_lock()->drift_ppm(), -300, 60)
                << patterns << " patterns a tick, one request stolen in " << every;
          }
        }
        EXPECT_LE(worst_error(world, us(60), 8), us(1));
        EXPECT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::locked);
      }
    }
  }
}

TEST(ServoLock, WithoutTicksStolenSlotsDoNotKeepItLocked) {
  for (const int every : {4, 16, 60}) {
    World world = make(Cycle{DataId::everything, us(70)}, us(70), us(60));
    Time tick;
    for (const bool ticking : {true, false}) {
      world.ticking = ticking;
      for (int requests = 1; requests < (ticking ? 2'000 : 100);) {
        if (!world.step(tick) && ++requests % every == 0)
          (void)world.scheduler.give_way(world.scheduler.slot() + us(130));
      }
      EXPECT_EQ(world.scheduler.servo_lock()->state(),
                ticking ? ServoLock::State::locked : ServoLock::State::waiting)
          << every;
    }
  }
}

// A tick says when it was, not when it is told: one that took its time is no sign of a grid that was put off.
TEST(ServoLock, TicksThatAreDeliveredLateLockItAllTheSame) {
  for (const Time late : {us(100), us(130), us(250)}) {
    Pattern pattern(Cycle{DataId::single_turn, ns(62'500)});
    World world = make(pattern, us(125), us(40));
    world.ppm = 100;
    world.ticking = false;
    std::deque<Time> stamps;
    Time tick;
    for (int ticks = 0; ticks < 8'000;) {
      if (world.step(tick)) {
        ++ticks;
        stamps.push_back(tick);
      }
      for (; !stamps.empty() && stamps.front() + late <= world.now; stamps.pop_front())
        world.scheduler.on_servo_tick(stamps.front(), world.statistics);
    }
    EXPECT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::locked) << late.count();
    EXPECT_NEAR(world.scheduler.servo_lock()->drift_ppm(), 100, 12) << late.count();
    EXPECT_EQ(world.statistics.servo_locks, 1U);
  }
}

TEST(ServoLock, ATickAfterALongSilenceIsTheFirstOfAnotherLock) {
  for (const int silent : {64, 65}) {
    World world = make(Cycle{DataId::everything, us(100)}, us(100), us(60));
    EXPECT_LE(worst_error(world, us(60), 2'000), ns(100));
    // Nobody polls meanwhile, so no slot passes either.
    const Time last{static_cast<std::int64_t>(std::llround(world.tick_at - world.period()))};
    world.scheduler.on_servo_tick(last + us(100) * silent, world.statistics);
    EXPECT_EQ(world.scheduler.servo_lock()->state(),
              silent > 64 ? ServoLock::State::seeking : ServoLock::State::locked);
    EXPECT_EQ(world.statistics.servo_locks, silent > 64 ? 2U : 1U);
  }
}

// Who was silent has stalled, and its first tick is the likeliest to be late: no hold, in which ticks were heard.
TEST(ServoLock, ALateTickBehindASilenceTeachesLittle) {
  for (const int before : {1, 2'000}) {
    World world = make(Cycle{DataId::everything, ms(1)}, ms(1), us(60));
    world.ppm = 20;
    Time tick;
    for (int ticks = 0; ticks < before;) ticks += world.step(tick) ? 1 : 0;
    if (before == 1) {  // and its grid had coasted when it was lost
      (void)world.scheduler.give_way(world.now + ms(70));
      for (int ticks = 0; ticks < 30;) ticks += world.step(tick) ? 1 : 0;
      world.ticking = false;
      for (int ticks = 0; ticks < 130;) ticks += world.step(tick) ? 1 : 0;
      ASSERT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::waiting);
      world.ticking = true;
      while (!world.step(tick)) continue;
      ASSERT_EQ(world.scheduler.servo_lock()->state(), ServoLock::State::seeking);
    }
    world.ticking = false;
    for (int ticks = 0; ticks < 26;) ticks += world.step(tick) ? 1 : 0;
    const std::int32_t drift = world.scheduler.servo_lock()->drift_ppm();
    world.scheduler.on_servo_tick(tick + us(62), world.statistics);
    EXPECT_NEAR(world.scheduler.servo_lock()->drift_ppm(), drift, before == 1 ? 260 : 40) << before;
  }
}

// The servo clock is faster than T1 allows: T1 wins, and slots fall out, one at a time.
TEST(ServoLock, AServoClockFasterThanT1NeverUndercutsIt) {
  World world = make(Cycle{DataId::everything, ns(62'500)}, ns(62'500), us(55), us(1));
  world.ppm = -100;  // 6.25 ns a period: a microsecond, and with it a slot, in 160
  Time tick;
  for (int ticks = 0; ticks < 50'000;) ticks += world.step(tick) ? 1 : 0;
  EXPECT_EQ(world.t1_violations, 0U);
  EXPECT_NEAR(world.statistics.skipped, 312, 10);
  world.host_jitter = 300;  // lateness that nothing can catch up adds up as well
  for (int ticks = 0; ticks < 50'000;) ticks += world.step(tick) ? 1 : 0;
  EXPECT_EQ(world.t1_violations, 0U);
  EXPECT_GT(world.statistics.skipped, 1'000U);
}

TEST(ServoLock, ARandomServoClockNeverUndercutsT1) {
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    World world =
        make(Pattern(us(40), {{DataId::single_turn, 6}, {DataId::everything, 1, 2}}), us(320), us(45), us(1));
    world.rng = test::Rng(seed);
    world.tick_jitter = 200'000;  // nonsense
    world.host_jitter = 1'500;
    world.ppm = 900;
    Time tick;
    for (int ticks = 0; ticks < 3'000;) ticks += world.step(tick) ? 1 : 0;
    EXPECT_EQ(world.t1_violations, 0U) << "seed " << seed;
  }
}

}  // namespace
}  // namespace tm485
