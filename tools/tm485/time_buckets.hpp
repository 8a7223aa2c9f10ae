// TimeBuckets: how often a time was how long, every value counted, in buckets of at most 0.2 % of the value. For
// pictures: the buckets of the bus's statistics are sixteen, and a Reservoir forgets.
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "json_output.hpp"
#include "tm485/linux/time_histogram.hpp"
#include "tm485/time.hpp"

namespace tm485::cli {

/// Times first..last, both included, and how many there were.
struct Bucket {
  Time first{0};
  Time last{0};
  std::uint64_t count = 0;
};

/// One owner. Allocates in the constructor only (120 kB); add() is O(1).
class TimeBuckets {
 public:
  TimeBuckets() : counts_(kBuckets) {}

  /// What is below 0 counts in the first bucket, what is above a minute in the last.
  void add(Time value) noexcept { ++counts_[bucket_of(value)]; }

  /// Those that are not empty, in their order.
  [[nodiscard]] std::vector<Bucket> filled() const;

 private:
  static constexpr unsigned kLinearBits = 9;  // exact below 2^9 ns, from there on 2^9 buckets an octave
  static constexpr unsigned kRangeBits = 36;
  static constexpr std::size_t kSteps = std::size_t{1} << kLinearBits;
  static constexpr std::size_t kBuckets = (kRangeBits - kLinearBits + 1) * kSteps;

  [[nodiscard]] static constexpr std::size_t bucket_of(Time value) noexcept {
    if (value < Time{0}) return 0;
    const auto ns = static_cast<std::uint64_t>(value.count());
    if (ns >> kRangeBits != 0) return kBuckets - 1;
    if (ns < kSteps) return static_cast<std::size_t>(ns);
    const auto octave = static_cast<std::size_t>(std::bit_width(ns)) - (kLinearBits + 1);
    return octave * kSteps + static_cast<std::size_t>(ns >> octave);
  }
  [[nodiscard]] static constexpr Time first_of(std::size_t bucket) noexcept {
    if (bucket < kSteps) return Time{static_cast<std::int64_t>(bucket)};
    const std::size_t octave = bucket / kSteps - 1;
    return Time{static_cast<std::int64_t>(kSteps + bucket % kSteps) << octave};
  }

  std::vector<std::uint64_t> counts_;
};

/// Those of a port's histogram that are not empty.
[[nodiscard]] std::vector<Bucket> buckets_of(const linux_hal::TimeHistogram& histogram);

/// {"first_ns": [...], "last_ns": [...], "count": [...]}.
[[nodiscard]] JsonObject to_json(const std::vector<Bucket>& buckets);

}  // namespace tm485::cli
