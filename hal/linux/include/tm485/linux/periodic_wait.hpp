// PeriodicWait: waits for the instants of a cycle and says how late each one was met.
//
// An overrun (the caller comes after the instant) skips to the next instant of the same grid: cycles that were missed
// are counted, never made up for in a burst, and the phase stays.
#pragma once

#include <cstdint>

#include "tm485/bus/statistics.hpp"
#include "tm485/linux/clock.hpp"
#include "tm485/time.hpp"

namespace tm485::linux_hal {

enum class WaitMode : std::uint8_t {
  spin,    ///< uses a whole core; the most exact, and the only one for periods near the wake-up time
  hybrid,  ///< sleeps until `spin_margin` before the instant, then spins
  sleep,   ///< sleeps only: late by a wake-up, 25 to 75 us on a quiet machine
};

struct PeriodicOptions {
  Time period{1'000'000};  ///< 1 ns or longer; a shorter one counts as 1 ns
  WaitMode mode = WaitMode::hybrid;
  Time spin_margin = MonotonicClock::kSpinMargin;  ///< hybrid: longer than the usual wake-up
  std::uint8_t histogram_shift = 12;               ///< lateness(): bins of 2^shift ns, 4.1 us by default
};

/// One thread. `Clock` has now(), sleep_until(Time) and spin_until(Time), as MonotonicClock has. Never allocates.
template <class Clock = MonotonicClock>
class PeriodicWait {
 public:
  /// The first instant of the grid is one period from now. `clock` must outlive this.
  PeriodicWait(const Clock& clock, const PeriodicOptions& options) noexcept
      : clock_(&clock), options_(options), lateness_(Time{0}, options.histogram_shift) {
    if (options_.period < Time{1}) options_.period = Time{1};
    due_ = clock.now() + options_.period;
  }

  /// The next instant that wait() waits for.
  [[nodiscard]] Time due() const noexcept { return due_; }
  [[nodiscard]] Time period() const noexcept { return options_.period; }

  /// Waits for due() and moves it on by one period. Returns the lateness: 0 or more. If due() has passed by a whole
  /// period or more, the instants that were missed are skipped and counted.
  Time wait() noexcept {
    const Time late = wait_for(due_);
    due_ += options_.period;
    if (late >= options_.period) {
      const std::int64_t missed = late / options_.period;
      due_ += missed * options_.period;
      skipped_ += static_cast<std::uint64_t>(missed);
    }
    return late;
  }

  /// Waits for an instant of the caller's own, for example the one that Bus::poll() answers; leaves the grid alone. One
  /// that has passed already counts as an overrun and is not waited for. Blocks until `instant`, so not for kNever.
  Time wait_for(Time instant) noexcept {
    Time reached = clock_->now();
    if (reached > instant) {
      saturating_increment(overruns_);
    } else {
      reached = reach(instant);
    }
    const Time late = reached - instant;
    lateness_.add(late);
    return late;
  }

  /// Instants that had passed when the caller came to wait for them.
  [[nodiscard]] std::uint32_t overruns() const noexcept { return overruns_; }
  /// Instants of the grid that were left out.
  [[nodiscard]] std::uint64_t skipped() const noexcept { return skipped_; }
  /// Of every instant that was waited for, overruns included.
  [[nodiscard]] const TimeStatistic& lateness() const noexcept { return lateness_; }

 private:
  [[nodiscard]] Time reach(Time instant) const noexcept {
    if (options_.mode == WaitMode::sleep) return clock_->sleep_until(instant);
    if (options_.mode == WaitMode::hybrid) (void)clock_->sleep_until(instant - options_.spin_margin);
    return clock_->spin_until(instant);
  }

  const Clock* clock_;
  PeriodicOptions options_;
  Time due_{0};
  std::uint32_t overruns_ = 0;
  std::uint64_t skipped_ = 0;
  TimeStatistic lateness_;
};

}  // namespace tm485::linux_hal
