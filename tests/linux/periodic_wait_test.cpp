// PeriodicWait against a clock that stands still unless it is waited on, and once against the real one.
#include "tm485/linux/periodic_wait.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <vector>

namespace tm485::linux_hal {
namespace {

/// Waiting takes it to the target, and later by what the test says.
class FakeClock {
 public:
  [[nodiscard]] Time now() const noexcept { return now_; }
  Time sleep_until(Time target) const noexcept {
    slept_to.push_back(target);
    return now_ = std::max(now_, target + wake_up);
  }
  Time spin_until(Time target) const noexcept {
    spun_to.push_back(target);
    return now_ = std::max(now_, target + glance);
  }
  void pass(Time time) { now_ += time; }

  Time wake_up{0};
  Time glance{0};
  mutable std::vector<Time> slept_to;
  mutable std::vector<Time> spun_to;

 private:
  mutable Time now_{1'000};
};

PeriodicOptions options(WaitMode mode) {
  return {.period = Time{100'000}, .mode = mode, .spin_margin = Time{30'000}};
}

TEST(PeriodicWait, EachModeWaitsInItsWay) {
  FakeClock clock;
  clock.wake_up = Time{20'000};
  clock.glance = Time{7};
  PeriodicWait spin(clock, options(WaitMode::spin));
  EXPECT_EQ(spin.wait(), Time{7});
  EXPECT_TRUE(clock.slept_to.empty());
  EXPECT_EQ(clock.spun_to, std::vector{Time{101'000}});

  clock.spun_to.clear();
  PeriodicWait hybrid(clock, options(WaitMode::hybrid));
  const Time due = hybrid.due();
  EXPECT_EQ(hybrid.wait(), Time{7}) << "the wake-up is shorter than the margin";
  EXPECT_EQ(clock.slept_to, std::vector{due - Time{30'000}});
  EXPECT_EQ(clock.spun_to, std::vector{due});
  clock.wake_up = Time{45'000};
  EXPECT_EQ(hybrid.wait(), Time{15'000}) << "and now longer";

  clock.spun_to.clear();
  PeriodicWait sleep(clock, options(WaitMode::sleep));
  EXPECT_EQ(sleep.wait(), Time{45'000});
  EXPECT_TRUE(clock.spun_to.empty());
}

TEST(PeriodicWait, KeepsItsGridHoweverLateEachCycleIs) {
  FakeClock clock;
  PeriodicWait wait(clock, options(WaitMode::spin));
  for (int i = 1; i <= 50; ++i) {
    ASSERT_EQ(wait.due(), Time{1'000 + i * 100'000});
    clock.glance = Time{(i * 37) % 99'000};
    ASSERT_EQ(wait.wait(), clock.glance);
  }
  EXPECT_EQ(wait.overruns(), 0U);
  EXPECT_EQ(wait.skipped(), 0U);
}

TEST(PeriodicWait, AnOverrunWithinThePeriodIsCountedAndNotWaitedFor) {
  FakeClock clock;
  PeriodicWait wait(clock, options(WaitMode::hybrid));
  clock.pass(Time{130'000});
  EXPECT_EQ(wait.wait(), Time{30'000});
  EXPECT_EQ(wait.overruns(), 1U);
  EXPECT_EQ(wait.skipped(), 0U);
  EXPECT_TRUE(clock.slept_to.empty());
  EXPECT_TRUE(clock.spun_to.empty());
  EXPECT_EQ(wait.due(), Time{201'000});
  EXPECT_EQ(wait.wait(), Time{0});
  EXPECT_EQ(wait.overruns(), 1U);
}

TEST(PeriodicWait, MissedInstantsAreSkippedAndThePhaseStays) {
  FakeClock clock;
  PeriodicWait wait(clock, options(WaitMode::spin));
  clock.pass(Time{470'000});  // 3.7 periods beyond the instant
  EXPECT_EQ(wait.wait(), Time{370'000});
  EXPECT_EQ(wait.overruns(), 1U);
  EXPECT_EQ(wait.skipped(), 3U);
  EXPECT_EQ(wait.due(), Time{501'000});
  EXPECT_EQ(wait.wait(), Time{0}) << "no burst";
  EXPECT_EQ(wait.skipped(), 3U);
}

TEST(PeriodicWait, ExactlyOnePeriodLateIsOneMissed) {
  FakeClock clock;
  PeriodicWait wait(clock, options(WaitMode::spin));
  clock.pass(Time{200'000});
  EXPECT_EQ(wait.wait(), Time{100'000});
  EXPECT_EQ(wait.skipped(), 1U);
  EXPECT_EQ(wait.due(), Time{301'000});
}

TEST(PeriodicWait, AnInstantOfTheCallersOwnLeavesTheGridAlone) {
  FakeClock clock;
  PeriodicWait wait(clock, options(WaitMode::spin));
  EXPECT_EQ(wait.wait_for(Time{42'000}), Time{0});
  EXPECT_EQ(clock.now(), Time{42'000});
  EXPECT_EQ(wait.wait_for(Time{42'000}), Time{0}) << "just in time is no overrun";
  EXPECT_EQ(wait.overruns(), 0U);
  EXPECT_EQ(wait.wait_for(Time{41'000}), Time{1'000});
  EXPECT_EQ(wait.overruns(), 1U);
  EXPECT_EQ(wait.due(), Time{101'000});
}

TEST(PeriodicWait, KeepsAHistogramOfTheLateness) {
  FakeClock clock;
  PeriodicOptions settings = options(WaitMode::spin);
  settings.histogram_shift = 10;
  PeriodicWait wait(clock, settings);
  for (const std::int64_t late : {0, 1'023, 1'024, 5'000, 90'000}) {
    clock.glance = Time{late};
    (void)wait.wait();
  }
  const TimeStatistic& lateness = wait.lateness();
  EXPECT_EQ(lateness.count(), 5U);
  EXPECT_EQ(lateness.minimum(), Time{0});
  EXPECT_EQ(lateness.maximum(), Time{90'000});
  EXPECT_EQ(lateness.histogram().bins[0], 2U);
  EXPECT_EQ(lateness.histogram().bins[1], 1U);
  EXPECT_EQ(lateness.histogram().bins[4], 1U);
  EXPECT_EQ(lateness.histogram().bins.back(), 1U);
}

TEST(PeriodicWait, APeriodOfNothingStillMovesOn) {
  FakeClock clock;
  PeriodicOptions settings = options(WaitMode::spin);
  settings.period = Time{0};
  PeriodicWait wait(clock, settings);
  const Time due = wait.due();
  (void)wait.wait();
  EXPECT_GT(wait.due(), due);
}

TEST(PeriodicWait, NeverReturnsTooEarlyByTheRealClock) {
  const MonotonicClock clock;
  for (const WaitMode mode : {WaitMode::spin, WaitMode::hybrid, WaitMode::sleep}) {
    PeriodicWait wait(clock, {.period = std::chrono::microseconds(200), .mode = mode});
    for (int i = 0; i < 50; ++i) {
      const Time due = wait.due();
      ASSERT_GE(wait.wait(), Time{0});
      ASSERT_GE(clock.now(), due);
    }
    EXPECT_EQ(wait.lateness().count(), 50U);
  }
}

}  // namespace
}  // namespace tm485::linux_hal
