// The time axis of a panel: linear, or logarithmic if the values spread far; its ticks in round numbers.
#pragma once

#include <string>
#include <vector>

#include "plot.hpp"

namespace tm485::cli {

class TimeAxis {
 public:
  /// Holds every bucket, mark and the window of the series, with a margin.
  explicit TimeAxis(const PlotSeries& series);

  /// 0..1 for a time on the axis; less or more beyond its ends.
  [[nodiscard]] double position(double ns) const noexcept;
  [[nodiscard]] bool logarithmic() const noexcept { return logarithmic_; }

  struct Tick {
    double ns;
    std::string label;
  };
  [[nodiscard]] std::vector<Tick> ticks() const;
  /// "ns", "µs", "ms" or "s": of the tick labels; empty if each label has its own.
  [[nodiscard]] const std::string& unit() const noexcept { return unit_; }

  /// The buckets put together into columns that are wide enough to be seen and never narrower than a bucket.
  [[nodiscard]] std::vector<Bucket> columns(const std::vector<Bucket>& buckets) const;

 private:
  double low_ = 0.0;
  double high_ = 1.0;
  bool logarithmic_ = false;
  double unit_ns_ = 1.0;
  std::string unit_;
};

}  // namespace tm485::cli
