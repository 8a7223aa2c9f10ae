#include "tm485/linux/clock.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/time.h>

#include <atomic>
#include <chrono>

namespace tm485::linux_hal {
namespace {

using std::chrono::milliseconds;

TEST(MonotonicClock, BeginsAtItsConstructionAndNeverGoesBack) {
  const MonotonicClock clock;
  Time previous = clock.now();
  EXPECT_GE(previous, Time{0});
  for (int i = 0; i < 100'000; ++i) {
    const Time now = clock.now();
    ASSERT_GE(now, previous);
    previous = now;
  }
}

TEST(MonotonicClock, CopiesShareTheEpoch) {
  const MonotonicClock clock;
  clock.spin_until(milliseconds(2));
  const MonotonicClock copy = clock;
  EXPECT_GE(copy.now(), milliseconds(2));
  EXPECT_LT(MonotonicClock().now(), copy.now());
}

TEST(MonotonicClock, NeverWaitsTooShort) {
  const MonotonicClock clock;
  for (const Time span : {Time{0}, Time{1}, Time{500}, MonotonicClock::kSpinMargin, Time{milliseconds(3)}}) {
    const Time target = clock.now() + span;
    const Time reached = clock.wait_until(target);
    EXPECT_GE(reached, target);
    EXPECT_GE(clock.now(), reached);
    const Time spun = clock.now() + span;
    EXPECT_GE(clock.spin_until(spun), spun);
  }
}

TEST(MonotonicClock, ReturnsAtOnceForAPastTarget) {
  const MonotonicClock clock;
  clock.spin_until(milliseconds(1));
  EXPECT_GE(clock.wait_until(Time{0}), milliseconds(1));
  EXPECT_GE(clock.wait_until(Time{-1'000'000'000}), milliseconds(1));
}

std::atomic<int> alarms{0};

TEST(MonotonicClock, ASignalDoesNotEndTheWait) {
  alarms = 0;
  struct sigaction action{};
  struct sigaction before{};
  action.sa_handler = [](int) { ++alarms; };
  ASSERT_EQ(sigaction(SIGALRM, &action, &before), 0);
  const itimerval every_five{{0, 5'000}, {0, 5'000}};
  const itimerval none{};
  const MonotonicClock clock;
  ASSERT_EQ(setitimer(ITIMER_REAL, &every_five, nullptr), 0);
  const Time reached = clock.wait_until(milliseconds(60));
  setitimer(ITIMER_REAL, &none, nullptr);
  sigaction(SIGALRM, &before, nullptr);
  EXPECT_GE(reached, milliseconds(60));
  EXPECT_GT(alarms, 0);
}

}  // namespace
}  // namespace tm485::linux_hal
