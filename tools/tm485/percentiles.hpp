// Percentiles of many times, in a bounded store.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "json_output.hpp"
#include "tm485/linux/time_histogram.hpp"
#include "tm485/time.hpp"

namespace tm485::cli {

/// Keeps every value up to its capacity; after that a uniform random choice of all of them (reservoir sampling, with a
/// fixed seed). Minimum and maximum are always exact. Allocates in the constructor only.
class Reservoir {
 public:
  explicit Reservoir(std::size_t capacity);

  void add(Time value) noexcept;

  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] std::size_t kept() const noexcept { return values_.size(); }
  [[nodiscard]] Time minimum() const noexcept { return count_ == 0 ? Time{0} : minimum_; }
  [[nodiscard]] Time maximum() const noexcept { return count_ == 0 ? Time{0} : maximum_; }
  /// The value below which the fraction 0..1 lies (nearest rank). Sorts: after the run.
  [[nodiscard]] Time percentile(double fraction);

 private:
  std::vector<std::int64_t> values_;
  std::size_t capacity_;
  std::uint64_t count_ = 0;
  std::uint64_t random_ = 0x9E3779B97F4A7C15U;
  Time minimum_ = kNever;
  Time maximum_ = -kNever;
};

/// {"min_ns", "p50_ns", "p99_ns", "p99_9_ns", "max_ns", "samples"}; "kept" if not all were kept.
[[nodiscard]] JsonObject to_json(Reservoir& reservoir);
[[nodiscard]] JsonObject to_json(const linux_hal::TimeHistogram& histogram);
/// A row of a table in microseconds, and its head.
[[nodiscard]] std::string to_row(std::string_view label, const linux_hal::TimeHistogram& histogram);
[[nodiscard]] std::string to_row(std::string_view label, Reservoir& reservoir);
[[nodiscard]] std::string row_header();

}  // namespace tm485::cli
