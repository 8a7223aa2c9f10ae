#include "plot_axis.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace tm485::cli {
namespace {

constexpr int kColumns = 110;
/// Beyond this ratio of the longest time to the median a linear axis shows one bar at its left end.
constexpr double kFarSpread = 20.0;

struct Unit {
  double ns;
  const char* name;
};
constexpr std::array<Unit, 4> kUnits{{{1.0, "ns"}, {1e3, "µs"}, {1e6, "ms"}, {1e9, "s"}}};

const Unit& unit_for(double ns) {
  const Unit* best = &kUnits[0];
  for (const Unit& unit : kUnits)
    if (ns >= unit.ns) best = &unit;
  return *best;
}

double count_of(Time time) { return static_cast<double>(time.count()); }

/// 1, 2 or 5 times a power of ten, about `wish`.
double round_step(double wish) {
  const double power = std::pow(10.0, std::floor(std::log10(wish)));
  const double digit = wish / power;
  return power * (digit < 1.5 ? 1.0 : digit < 3.5 ? 2.0 : digit < 7.5 ? 5.0 : 10.0);
}

}  // namespace

TimeAxis::TimeAxis(const PlotSeries& series) {
  double low = HUGE_VAL;
  double high = 0.0;
  const auto include = [&](Time first, Time last) {
    low = std::min(low, count_of(first));
    high = std::max(high, count_of(last));
  };
  std::uint64_t total = 0;
  for (const Bucket& bucket : series.buckets) {
    include(bucket.first, bucket.last);
    total += bucket.count;
  }
  double median = 0.0;
  std::uint64_t seen = 0;
  for (const Bucket& bucket : series.buckets) {
    seen += bucket.count;
    if (seen * 2 >= total) {
      median = std::max(count_of(bucket.last), 1.0);
      break;
    }
  }
  if (series.window) include(series.window->first, series.window->second);
  for (const auto& mark : series.marks) include(mark.second, mark.second);
  if (low > high) low = high = 0.0;
  logarithmic_ = high > kFarSpread * median && median > 0.0;
  if (logarithmic_) {
    low_ = std::max(low * 0.9, std::max(1.0, median / 1e3));
    high_ = high * 1.3;
    return;
  }
  constexpr double kNarrowest = 20.0;  // ns: a model's times do not vary at all
  constexpr double kMargin = 0.06;
  const double spread = std::max({high - low, kNarrowest, 4e-3 * high}) * (1.0 + 2 * kMargin);
  const double middle = (low + high) / 2;
  low_ = std::max(middle - spread / 2, -kMargin * spread);
  high_ = low_ + spread;
  const Unit& unit = unit_for(high_);
  unit_ns_ = unit.ns;
  unit_ = unit.name;
}

double TimeAxis::position(double ns) const noexcept {
  if (!logarithmic_) return (ns - low_) / (high_ - low_);
  return std::log(std::max(ns, low_) / low_) / std::log(high_ / low_);
}

std::vector<TimeAxis::Tick> TimeAxis::ticks() const {
  std::vector<Tick> ticks;
  if (logarithmic_) {
    const bool dense = high_ / low_ < 1e3;
    const auto last = static_cast<int>(std::floor(std::log10(high_)));
    for (auto power = static_cast<int>(std::floor(std::log10(low_))); power <= last; ++power) {
      const double decade = std::pow(10.0, power);
      for (const double digit : {1.0, 2.0, 5.0}) {
        const double at = decade * digit;
        if (at < low_ || at > high_ || (!dense && digit != 1.0)) continue;
        const Unit& unit = unit_for(at * 1.0001);
        ticks.push_back({at, fmt::format("{:g} {}", at / unit.ns, unit.name)});
      }
    }
    return ticks;
  }
  constexpr double kWished = 6.0;
  const double step = round_step((high_ - low_) / kWished);
  const auto last = static_cast<std::int64_t>(std::floor(high_ / step));
  for (auto k = static_cast<std::int64_t>(std::ceil(low_ / step)); k <= last; ++k) {
    const double at = static_cast<double>(k) * step;
    ticks.push_back({at, fmt::format("{:.7g}", at / unit_ns_)});
  }
  return ticks;
}

std::vector<Bucket> TimeAxis::columns(const std::vector<Bucket>& buckets) const {
  double widest = 1.0 / kColumns;
  for (const Bucket& bucket : buckets)
    widest = std::max(widest, position(count_of(bucket.last) + 1.0) - position(count_of(bucket.first)));
  std::vector<Bucket> columns;
  double end = -1.0;
  for (const Bucket& bucket : buckets) {
    const double at = position(count_of(bucket.first));
    if (columns.empty() || at >= end - 1e-9) {
      // Columns stand on a grid, so that their widths are equal.
      end = (std::floor(at / widest + 1e-9) + 1.0) * widest;
      columns.push_back(bucket);
    } else {
      columns.back().last = bucket.last;
      columns.back().count += bucket.count;
    }
  }
  return columns;
}

}  // namespace tm485::cli
