// MonotonicClock: the time of a bus on Linux.
//
// CLOCK_MONOTONIC through the vdso: tens of nanoseconds, no system call, on every architecture. Its
// epoch is its construction, so that times are small; copies share the epoch of the original.
#pragma once

#include "tm485/time.hpp"

namespace tm485::linux_hal {

/// Any thread: reading changes nothing.
class MonotonicClock {
 public:
  /// How long before its target wait_until() stops sleeping. A wake-up costs 25 to 75 us on a quiet
  /// machine, so a sleep that ends later than this would often end too late.
  static constexpr Time kSpinMargin{80'000};

  /// The epoch is now.
  MonotonicClock() noexcept;

  /// Time since the epoch; never goes back.
  [[nodiscard]] Time now() const noexcept;

  /// Sleeps until kSpinMargin before `target`, then spins. Returns now(): at `target` or later, at once if it
  /// has passed. A signal does not end it. Blocks until `target`, so not for kNever.
  Time wait_until(Time target) const noexcept;

  /// Sleeps until `target` and returns now(): as late as the wake-up is. A signal does not end it.
  Time sleep_until(Time target) const noexcept;

  /// The same without sleeping: uses a whole core until `target`.
  Time spin_until(Time target) const noexcept;

 private:
  Time epoch_;
};

}  // namespace tm485::linux_hal
