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

JsonObject to_json(Reservoir& reservoir) {
  JsonObject json;
  json.set("min_ns", reservoir.minimum().count())
      .set("p50_ns", reservoir.percentile(0.5).count())
      .set("p99_ns", reservoir.percentile(0.99).count())
      .set("p99_9_ns", reservoir.percentile(0.999).count())
      .set("max_ns", reservoir.maximum().count())
      .set("samples", reservoir.count());
  if (reservoir.kept() < reservoir.count()) json.set("kept", reservoir.kept());
  return json;
}

std::string row_header() {
  return fmt::format("{:<14} {:>10} {:>10} {:>10} {:>10} {:>10}   [us]\n", "", "min", "p50", "p99", "p99.9",
                     "max");
}

std::string to_row(std::string_view label, Reservoir& reservoir) {
  if (reservoir.count() == 0) return fmt::format("{:<14} {:>10}\n", label, "none");
  const auto us = [](Time time) { return static_cast<double>(time.count()) / 1e3; };
  return fmt::format("{:<14} {:>10.2f} {:>10.2f} {:>10.2f} {:>10.2f} {:>10.2f}\n", label,
                     us(reservoir.minimum()), us(reservoir.percentile(0.5)), us(reservoir.percentile(0.99)),
                     us(reservoir.percentile(0.999)), us(reservoir.maximum()));
}

}  // namespace tm485::cli
