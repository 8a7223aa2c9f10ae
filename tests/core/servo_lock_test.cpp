// The lock to a servo clock: drift is followed, jitter is not, T1 is kept whatever the servo clock does.
// (What holds of the line do to it: servo_lock_hold_test.)
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>

#include "support/servo_world.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::ns;
using test::us;
using test::servo::make;
using test::servo::profile;
using test::servo::World;
using test::servo::worst_error;

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
