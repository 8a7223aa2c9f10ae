// TimeHistogram: how often a time was how long, from one nanosecond to a minute, in fixed memory.
//
// Buckets grow with the value: exact below 16 ns, above it sixteen in each octave, so a bucket is at most 6.25 % wide.
// The histogram of the core (bus/statistics.hpp) has sixteen equal bins, enough for a window that is known before and
// small enough for a microcontroller; the times of an operating system spread over six decades and are judged by
// percentiles. That is why this one stands with hal/linux, and tools and benchmarks may use it as well.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>

#include "tm485/time.hpp"

namespace tm485::linux_hal {

/// One owner. Never allocates; 2.2 kB.
class TimeHistogram {
 public:
  static constexpr std::size_t kStepsPerOctave = 16;
  /// Longer times count in the last bucket; maximum() stays exact.
  static constexpr Time kRange{std::int64_t{1} << 36};

  /// O(1). A time below zero counts in the first bucket; minimum() stays exact.
  constexpr void add(Time value) noexcept {
    if (count_ == UINT32_MAX) return;
    ++count_;
    minimum_ = std::min(minimum_, value);
    maximum_ = std::max(maximum_, value);
    ++buckets_[bucket_of(value)];
  }

  constexpr void clear() noexcept { *this = {}; }

  /// At most 2^32 - 1; what comes after is not counted.
  [[nodiscard]] constexpr std::uint32_t count() const noexcept { return count_; }
  /// Exact; 0 while count() is 0.
  [[nodiscard]] constexpr Time minimum() const noexcept { return count_ == 0 ? Time{0} : minimum_; }
  [[nodiscard]] constexpr Time maximum() const noexcept { return count_ == 0 ? Time{0} : maximum_; }

  /// The time that `fraction` (0 to 1) of the values do not exceed (nearest rank): the upper edge of its bucket, so it
  /// is never too small, and at most 6.25 % too large. 0 while count() is 0. Walks over the buckets: not for the cycle.
  [[nodiscard]] constexpr Time percentile(double fraction) const noexcept {
    if (count_ == 0) return Time{0};
    const double wanted = std::clamp(fraction, 0.0, 1.0) * static_cast<double>(count_);
    std::uint64_t seen = 0;
    for (std::size_t at = 0; at < kBuckets; ++at) {
      seen += buckets_[at];
      if (seen != 0 && static_cast<double>(seen) >= wanted)
        return std::clamp(at + 1 == kBuckets ? maximum_ : last_of(at), minimum_, maximum_);
    }
    return maximum_;
  }

  static constexpr std::size_t kBuckets = (36 - 4 + 1) * kStepsPerOctave;
  [[nodiscard]] constexpr std::uint32_t bucket(std::size_t at) const noexcept { return buckets_[at]; }
  /// The shortest and the longest time of a bucket.
  [[nodiscard]] static constexpr Time first_of(std::size_t at) noexcept {
    if (at < kStepsPerOctave) return Time{static_cast<std::int64_t>(at)};
    const std::size_t octave = at / kStepsPerOctave - 1;
    return Time{static_cast<std::int64_t>(kStepsPerOctave + at % kStepsPerOctave) << octave};
  }
  [[nodiscard]] static constexpr Time last_of(std::size_t at) noexcept { return first_of(at + 1) - Time{1}; }

 private:
  [[nodiscard]] static constexpr std::size_t bucket_of(Time value) noexcept {
    if (value < Time{0}) return 0;
    if (value >= kRange) return kBuckets - 1;
    const auto ns = static_cast<std::uint64_t>(value.count());
    if (ns < kStepsPerOctave) return static_cast<std::size_t>(ns);
    const auto octave = static_cast<std::size_t>(std::bit_width(ns)) - 5;
    return octave * kStepsPerOctave + static_cast<std::size_t>(ns >> octave);
  }

  std::array<std::uint32_t, kBuckets> buckets_{};
  std::uint32_t count_ = 0;
  Time minimum_ = kNever;
  Time maximum_ = -kNever;
};

}  // namespace tm485::linux_hal
