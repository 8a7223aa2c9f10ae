#include "percentiles.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace tm485::cli {

Reservoir::Reservoir(std::size_t capacity) : capacity_(capacity) { values_.reserve(capacity); }

void Reservoir::add(Time value) noexcept {
  ++count_;
  minimum_ = std::min(minimum_, value);
  maximum_ = std::max(maximum_, value);
  if (values_.size() < capacity_) {
    values_.push_back(value.count());
    return;
  }
  random_ ^= random_ << 13;
  random_ ^= random_ >> 7;
  random_ ^= random_ << 17;
  if (const std::uint64_t at = random_ % count_; at < values_.size()) values_[at] = value.count();
}

Time Reservoir::percentile(double fraction) {
  if (values_.empty()) return Time{0};
  const auto rank = static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(values_.size())));
  const auto at =
      values_.begin() + static_cast<std::ptrdiff_t>(std::clamp<std::size_t>(rank, 1, values_.size()) - 1);
  std::ranges::nth_element(values_, at);
  return Time{*at};
}

namespace {

/// Both stores of times, in the same words: `percentile` is their own.
template <class Times>
JsonObject json_of(Times& times) {
  JsonObject json;
  json.set("min_ns", times.minimum().count())
      .set("p50_ns", times.percentile(0.5).count())
      .set("p99_ns", times.percentile(0.99).count())
      .set("p99_9_ns", times.percentile(0.999).count())
      .set("max_ns", times.maximum().count())
      .set("samples", times.count());
  return json;
}

template <class Times>
std::string row_of(std::string_view label, Times& times) {
  if (times.count() == 0) return fmt::format("{:<14} {:>10}\n", label, "none");
  const auto us = [](Time time) { return static_cast<double>(time.count()) / 1e3; };
  return fmt::format("{:<14} {:>10.2f} {:>10.2f} {:>10.2f} {:>10.2f} {:>10.2f}\n", label, us(times.minimum()),
                     us(times.percentile(0.5)), us(times.percentile(0.99)), us(times.percentile(0.999)),
                     us(times.maximum()));
}

}  // namespace

JsonObject to_json(Reservoir& reservoir) {
  JsonObject json = json_of(reservoir);
  if (reservoir.kept() < reservoir.count()) json.set("kept", reservoir.kept());
  return json;
}

JsonObject to_json(const linux_hal::TimeHistogram& histogram) { return json_of(histogram); }

std::string row_header() {
  return fmt::format("{:<14} {:>10} {:>10} {:>10} {:>10} {:>10}   [us]\n", "", "min", "p50", "p99", "p99.9",
                     "max");
}

std::string to_row(std::string_view label, Reservoir& reservoir) { return row_of(label, reservoir); }

std::string to_row(std::string_view label, const linux_hal::TimeHistogram& histogram) {
  return row_of(label, histogram);
}

}  // namespace tm485::cli
