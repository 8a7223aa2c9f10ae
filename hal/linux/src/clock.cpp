#include "tm485/linux/clock.hpp"

#include <cerrno>
#include <ctime>

namespace tm485::linux_hal {
namespace {

constexpr std::int64_t kSecond = 1'000'000'000;

Time monotonic() noexcept {
  timespec at{};
  clock_gettime(CLOCK_MONOTONIC, &at);  // cannot fail: the clock exists and the pointer is good
  return Time{std::int64_t{at.tv_sec} * kSecond + at.tv_nsec};
}

}  // namespace

MonotonicClock::MonotonicClock() noexcept : epoch_(monotonic()) {}

Time MonotonicClock::now() const noexcept { return monotonic() - epoch_; }

Time MonotonicClock::wait_until(Time target) const noexcept {
  (void)sleep_until(target - kSpinMargin);
  return spin_until(target);
}

Time MonotonicClock::sleep_until(Time target) const noexcept {
  if (now() < target) {
    const std::int64_t absolute = (epoch_ + target).count();
    timespec at{};
    at.tv_sec = static_cast<std::time_t>(absolute / kSecond);
    at.tv_nsec = static_cast<long>(absolute % kSecond);
    // An absolute time: a sleep that a signal has cut short goes on towards the same instant.
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr) == EINTR) {
    }
  }
  return now();
}

Time MonotonicClock::spin_until(Time target) const noexcept {
  Time at = now();
  while (at < target) at = now();
  return at;
}

}  // namespace tm485::linux_hal
