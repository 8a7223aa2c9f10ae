// Statistics of a bus: how many, how often, how late. Every counter saturates; none wraps.
// Written by the bus's own context.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <type_traits>

#include "tm485/errc.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// Adds one, and stays at the largest value.
constexpr void saturating_increment(std::uint32_t& counter, std::uint32_t by = 1) noexcept {
  const std::uint32_t room = std::numeric_limits<std::uint32_t>::max() - counter;
  counter += by < room ? by : room;
}

/// Sixteen equal bins from `origin`, each 2^shift ns wide. What lies outside counts in the first or last bin.
struct Histogram {
  static constexpr std::size_t kBins = 16;
  static constexpr std::uint32_t kMostShift = 31;  ///< 2.1 s a bin
  Time origin{0};
  std::uint32_t shift = 8;  ///< at most kMostShift
  std::uint32_t count = 0;  ///< of all bins, saturates
  std::array<std::uint32_t, kBins> bins{};

  constexpr void add(Time value) noexcept {
    const std::int64_t above = (value - origin).count();
    std::size_t bin = 0;
    if (above >= 0) {  // 64-bit shifts by a variable are long
      const bool long_one = above > UINT32_MAX;
      bin = long_one ? static_cast<std::size_t>(std::min<std::int64_t>(above >> shift, kBins))
                     : static_cast<std::uint32_t>(above) >> shift;
      if (bin >= kBins) bin = kBins - 1;
    }
    saturating_increment(bins[bin]);
    saturating_increment(count);
  }
  /// Lower edge of a bin.
  [[nodiscard]] constexpr Time edge(std::size_t bin) const noexcept {
    return origin + Time{static_cast<std::int64_t>(bin) << shift};
  }
};

/// Minimum, mean, maximum and histogram of a time.
class TimeStatistic {
 public:
  constexpr TimeStatistic() noexcept = default;
  constexpr TimeStatistic(Time origin, std::uint32_t shift) noexcept {
    histogram_.origin = origin;
    histogram_.shift = shift;
  }

  constexpr void add(Time value) noexcept {
    if (histogram_.count == std::numeric_limits<std::uint32_t>::max()) return;
    sum_ += value;
    if (value < minimum_) minimum_ = value;
    if (value > maximum_) maximum_ = value;
    histogram_.add(value);
  }

  [[nodiscard]] constexpr std::uint32_t count() const noexcept { return histogram_.count; }
  /// The three are 0 while count() is 0.
  [[nodiscard]] constexpr Time minimum() const noexcept { return count() == 0 ? Time{0} : minimum_; }
  [[nodiscard]] constexpr Time maximum() const noexcept { return count() == 0 ? Time{0} : maximum_; }
  /// Divides; not for the cycle.
  [[nodiscard]] constexpr Time mean() const noexcept {
    return count() == 0 ? Time{0} : sum_ / std::int64_t{count()};
  }
  [[nodiscard]] constexpr const Histogram& histogram() const noexcept { return histogram_; }

 private:
  Time minimum_ = kNever;
  Time maximum_ = -kNever;
  Time sum_{0};
  Histogram histogram_;
};

/// Everything that a bus counts since it was made.
struct Statistics {
  std::uint32_t cycles = 0;      ///< cyclic slots that were used: good + failed
  std::uint32_t good = 0;        ///< cyclic replies that became a fresh sample
  std::uint32_t failed = 0;      ///< cyclic slots that did not
  std::uint32_t slips = 0;       ///< free grid: starts later than the jitter margin, which moved it
  std::uint32_t skipped = 0;     ///< phase-locked grid: slots that were missed and left out
  std::uint32_t background = 0;  ///< background exchanges, good or failed
  std::uint32_t stolen = 0;      ///< cyclic slots that went to a background exchange (BusConfig::steal_every)
  std::uint32_t displaced =
      0;                      ///< cyclic slots that went to resets, or to an EEPROM write that holds the bus
  std::uint32_t starved = 0;  ///< background requests that waited too long and ended with no_gap
  std::uint32_t longest_wait = 0;  ///< of a background request, in cyclic slots
  std::uint32_t startups = 0;      ///< start-up sequences that succeeded
  std::uint32_t startup_failures = 0;
  std::uint32_t lost = 0;             ///< times that the encoder was given up and start-up began again
  std::uint32_t restarts = 0;         ///< restarts of the encoder, seen or told (on_restart)
  std::uint32_t invalidated = 0;      ///< times that a sample became too old
  std::uint32_t discontinuities = 0;  ///< times that the shaft was found where it cannot have come to
  std::uint32_t stray_bytes = 0;      ///< bytes that belonged to no exchange
  std::uint32_t reserved_status = 0;  ///< good replies with an SF or ALMC bit that the profile calls reserved
  std::uint32_t warnings = 0;         ///< good replies with alarm level warning
  std::uint32_t faults = 0;           ///< good replies with alarm level fault
  std::uint32_t servo_ticks = 0;      ///< ticks of the servo clock that came
  std::uint32_t servo_locks = 0;      ///< times that the grid was moved to the servo clock's phase
  std::array<std::uint32_t, kErrcCount> errors{};  ///< every failure, in any phase, by cause
  std::uint32_t spare = 0;                         ///< no padding

  TimeStatistic t1{Time{0}, 12};  ///< request start to request start of the cycle
  TimeStatistic reply_delay{Time{0},
                            8};  ///< T2 with wire timestamps, otherwise the reply delay seen by the host
  TimeStatistic servo_phase{Time{-2048}, 8};  ///< servo tick less where the grid expected it, once locked

  constexpr void count_error(Errc code) noexcept {
    saturating_increment(errors[static_cast<std::size_t>(code)]);
  }
};
static_assert(std::has_unique_object_representations_v<Statistics> && sizeof(Statistics) % 4 == 0,
              "statistics cross threads as words (SharedLatest)");

}  // namespace tm485
