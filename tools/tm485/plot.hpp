// A picture of histograms: one panel a series, counts on a logarithmic scale, percentiles marked. Drawn by cairo, as PNG
// or SVG by the file's name.
#pragma once

#include <expected>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "problem.hpp"
#include "time_buckets.hpp"
#include "tm485/time.hpp"

namespace tm485::cli {

struct PlotSeries {
  std::string title;
  std::vector<Bucket> buckets;
  std::vector<std::pair<std::string, Time>> marks;  ///< percentiles and the maximum, in rising order
  std::optional<std::pair<Time, Time>> window;      ///< shaded
  std::string window_label;
};

struct Plot {
  std::string title;
  std::vector<std::string> subtitles;
  std::vector<PlotSeries> series;
};

/// Problem bad_plot (exit code 2): the name ends in neither .png nor .svg, its folder cannot be written, or what is there is
/// not a regular file.
[[nodiscard]] std::expected<void, Problem> check_plot_file(const std::string& path);

/// Draws it; an existing file is replaced at the end, whole. Problem: plot_failed (exit code 1).
[[nodiscard]] std::expected<void, Problem> draw(const Plot& plot, const std::string& path);

}  // namespace tm485::cli
