#include "plot.hpp"

#include <cairo-svg.h>
#include <cairo.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <system_error>

#include "plot_axis.hpp"
#include "safe_file.hpp"

namespace tm485::cli {
namespace {

// Everything in points of the picture.
constexpr double kWidth = 1280.0;
constexpr double kMargin = 28.0;
constexpr double kTitleSize = 21.0;
constexpr double kSubtitleSize = 13.5;
constexpr double kPanelHeight = 344.0;
constexpr double kPanelGap = 26.0;
constexpr int kPanelsInARow = 2;
constexpr double kLeft = 58.0;    // of a panel: counts
constexpr double kTop = 92.0;     // its title and the names of the marks
constexpr double kBottom = 42.0;  // times

struct Colour {
  double red, green, blue;
};
constexpr double kLabelSize = 11.5;

constexpr Colour kPaper{1.0, 1.0, 1.0};
constexpr Colour kInk{0.13, 0.15, 0.18};
constexpr Colour kFaint{0.45, 0.48, 0.52};
constexpr Colour kGrid{0.90, 0.91, 0.93};
constexpr Colour kBar{0.16, 0.44, 0.72};
constexpr Colour kMark{0.80, 0.27, 0.12};
constexpr Colour kWindow{0.86, 0.94, 0.86};
constexpr Colour kWindowInk{0.22, 0.47, 0.24};

enum class Align { left, centre, right };

struct Rectangle {
  double x, y, width, height;
};

/// A thin cover over cairo: what this picture needs of it.
class Pen {
 public:
  explicit Pen(cairo_surface_t* surface) : cairo_(cairo_create(surface), cairo_destroy) {}

  void fill(const Rectangle& r, Colour colour) {
    set(colour);
    cairo_rectangle(cairo_.get(), r.x, r.y, r.width, r.height);
    cairo_fill(cairo_.get());
  }
  void line(double x1, double y1, double x2, double y2, Colour colour, double width = 1.0,
            bool dashed = false) {
    set(colour);
    const double dashes[]{4.0, 3.0};
    cairo_set_dash(cairo_.get(), dashes, dashed ? 2 : 0, 0.0);
    cairo_set_line_width(cairo_.get(), width);
    cairo_move_to(cairo_.get(), x1, y1);
    cairo_line_to(cairo_.get(), x2, y2);
    cairo_stroke(cairo_.get());
  }
  void text(double x, double y, const std::string& text, double size, Colour colour,
            Align align = Align::left, bool bold = false) {
    const double width = prepare(text, size, bold);
    set(colour);
    cairo_move_to(cairo_.get(),
                  align == Align::left    ? x
                  : align == Align::right ? x - width
                                          : x - width / 2,
                  y);
    cairo_show_text(cairo_.get(), text.c_str());
  }
  double width(const std::string& text, double size) { return prepare(text, size, false); }
  void clip(const Rectangle& r) {
    cairo_save(cairo_.get());
    cairo_rectangle(cairo_.get(), r.x, r.y, r.width, r.height);
    cairo_clip(cairo_.get());
  }
  void unclip() { cairo_restore(cairo_.get()); }
  [[nodiscard]] cairo_status_t status() const { return cairo_status(cairo_.get()); }

 private:
  void set(Colour colour) { cairo_set_source_rgb(cairo_.get(), colour.red, colour.green, colour.blue); }
  double prepare(const std::string& text, double size, bool bold) {
    cairo_select_font_face(cairo_.get(), "sans-serif", CAIRO_FONT_SLANT_NORMAL,
                           bold ? CAIRO_FONT_WEIGHT_BOLD : CAIRO_FONT_WEIGHT_NORMAL);
    cairo_set_font_size(cairo_.get(), size);
    cairo_text_extents_t extents{};
    cairo_text_extents(cairo_.get(), text.c_str(), &extents);
    return extents.x_advance;
  }

  std::unique_ptr<cairo_t, decltype(&cairo_destroy)> cairo_;
};

std::string short_time(Time time) {
  const auto ns = static_cast<double>(time.count());
  if (std::abs(ns) < 1e3) return fmt::format("{} ns", time.count());
  if (std::abs(ns) < 1e6) return fmt::format("{:.4g} µs", ns / 1e3);
  if (std::abs(ns) < 1e9) return fmt::format("{:.4g} ms", ns / 1e6);
  return fmt::format("{:.4g} s", ns / 1e9);
}

std::string grouped(std::uint64_t value) {
  std::string text = std::to_string(value);
  for (std::size_t at = text.size(); at > 3; at -= 3) text.insert(at - 3, " ");
  return text;
}

class Panel {
 public:
  Panel(Pen& pen, const PlotSeries& series, const Rectangle& place)
      : pen_(pen),
        series_(series),
        place_(place),
        area_{place.x + kLeft, place.y + kTop, place.width - kLeft, place.height - kTop - kBottom},
        axis_(series),
        columns_(axis_.columns(series.buckets)) {
    for (const Bucket& column : columns_) {
      highest_ = std::max(highest_, column.count);
      total_ += column.count;
    }
    decades_ = std::max(1.0, std::ceil(std::log10(static_cast<double>(highest_) * 1.2)));
  }

  void draw() {
    draw_title();
    if (total_ == 0) {
      pen_.text(area_.x + area_.width / 2, area_.y + area_.height / 2, "no value", 14.0, kFaint,
                Align::centre);
      return;
    }
    if (series_.window) draw_window();
    draw_grid();
    draw_columns();
    draw_marks();
    if (series_.window)
      pen_.text(x(static_cast<double>(series_.window->second.count())) - 6.0, area_.y + 16.0,
                series_.window_label, 12.0, kWindowInk, Align::right);
    pen_.line(area_.x, bottom(), area_.x + area_.width, bottom(), kInk);
  }

 private:
  [[nodiscard]] double x(double ns) const {
    return area_.x + area_.width * std::clamp(axis_.position(ns), 0.0, 1.0);
  }
  [[nodiscard]] double bottom() const { return area_.y + area_.height; }
  /// One value stands a little above the axis, so that it can be seen.
  [[nodiscard]] double y(double count) const {
    constexpr double kOne = 0.06;
    const double height = count <= 0.0 ? 0.0 : kOne + (1.0 - kOne) * std::log10(count) / decades_;
    return bottom() - area_.height * height;
  }

  void draw_title() {
    pen_.text(place_.x, place_.y + 16.0, series_.title, 15.0, kInk, Align::left, true);
    pen_.text(place_.x + place_.width, place_.y + 16.0, grouped(total_) + " values", 12.5, kFaint,
              Align::right);
  }

  void draw_window() {
    const double left = x(static_cast<double>(series_.window->first.count()));
    const double right = x(static_cast<double>(series_.window->second.count()));
    pen_.fill({left, area_.y, right - left, area_.height}, kWindow);
  }

  void draw_grid() {
    for (int decade = 0; decade <= static_cast<int>(decades_); ++decade) {
      const double count = std::pow(10.0, decade);
      pen_.line(area_.x, y(count), area_.x + area_.width, y(count), kGrid);
      pen_.text(area_.x - 8.0, y(count) + 4.0, fmt::format("{}", grouped(static_cast<std::uint64_t>(count))),
                11.5, kFaint, Align::right);
    }
    for (const TimeAxis::Tick& tick : axis_.ticks()) {
      pen_.line(x(tick.ns), area_.y, x(tick.ns), bottom() + 4.0, kGrid);
      pen_.text(x(tick.ns), bottom() + 18.0, tick.label, 11.5, kFaint, Align::centre);
    }
    const std::string unit = axis_.logarithmic() ? "logarithmic" : axis_.unit();
    pen_.text(area_.x + area_.width, bottom() + 35.0, unit, 11.5, kFaint, Align::right);
  }

  void draw_columns() {
    constexpr double kThinnest = 2.0;
    pen_.clip({area_.x, area_.y, area_.width, area_.height});
    for (const Bucket& column : columns_) {
      const double left = x(static_cast<double>(column.first.count()));
      const double right = x(static_cast<double>(column.last.count() + 1));
      const double top = y(static_cast<double>(column.count));
      pen_.fill({left, top, std::max(right - left, kThinnest), bottom() - top}, kBar);
    }
    pen_.unclip();
  }

  struct Label {
    std::string text;
    double at, centre, baseline;
  };

  /// The marks' names above the area, in rows where they would touch; those of the same time in one.
  std::vector<Label> labels() {
    constexpr std::size_t kRows = 4;
    constexpr double kRowHeight = 15.0;
    std::vector<Label> labels;
    std::array<double, kRows> ends;
    ends.fill(-HUGE_VAL);
    std::string names;
    for (std::size_t i = 0; i < series_.marks.size(); ++i) {
      const auto& [name, time] = series_.marks[i];
      names += (names.empty() ? "" : ", ") + name;
      if (i + 1 < series_.marks.size() && short_time(series_.marks[i + 1].second) == short_time(time))
        continue;
      const std::string text = names + " " + short_time(time);
      names.clear();
      const double width = pen_.width(text, kLabelSize);
      const double at = x(static_cast<double>(time.count()));
      const double centre = std::clamp(at, area_.x + width / 2, area_.x + area_.width - width / 2);
      std::size_t row = 0;
      while (row + 1 < kRows && centre - width / 2 < ends.at(row) + kRowHeight) ++row;
      ends.at(row) = centre + width / 2;
      labels.push_back({text, at, centre, area_.y - 8.0 - kRowHeight * static_cast<double>(row)});
    }
    return labels;
  }

  void draw_marks() {
    const std::vector<Label> all = labels();
    for (const Label& label : all)
      pen_.line(label.at, label.baseline + 3.0, label.at, bottom(), kMark, 1.2, true);
    for (const Label& label : all) {  // over the lines of the others
      const double width = pen_.width(label.text, kLabelSize) + 4.0;
      pen_.fill({label.centre - width / 2, label.baseline - 10.0, width, 13.0}, kPaper);
      pen_.text(label.centre, label.baseline, label.text, kLabelSize, kMark, Align::centre);
    }
  }

  Pen& pen_;
  const PlotSeries& series_;
  Rectangle place_;
  Rectangle area_;
  TimeAxis axis_;
  std::vector<Bucket> columns_;
  std::uint64_t highest_ = 1;
  std::uint64_t total_ = 0;
  double decades_ = 1.0;
};

double header_height(const Plot& plot) {
  return kMargin + kTitleSize + static_cast<double>(plot.subtitles.size()) * (kSubtitleSize + 6.0) + 22.0;
}

double height_of(const Plot& plot) {
  const auto rows = std::ceil(static_cast<double>(plot.series.size()) / kPanelsInARow);
  return header_height(plot) + rows * (kPanelHeight + kPanelGap) + kMargin - kPanelGap;
}

void draw_all(Pen& pen, const Plot& plot) {
  pen.fill({0.0, 0.0, kWidth, height_of(plot)}, kPaper);
  double y = kMargin + kTitleSize - 4.0;
  pen.text(kMargin, y, plot.title, kTitleSize, kInk, Align::left, true);
  for (const std::string& subtitle : plot.subtitles) {
    y += kSubtitleSize + 6.0;
    pen.text(kMargin, y, subtitle, kSubtitleSize, kFaint);
  }
  const double width = (kWidth - 2 * kMargin - kPanelGap * (kPanelsInARow - 1)) / kPanelsInARow;
  for (std::size_t i = 0; i < plot.series.size(); ++i) {
    const auto column = static_cast<double>(i % kPanelsInARow);
    const std::size_t whole_rows = i / kPanelsInARow;
    const auto row = static_cast<double>(whole_rows);
    Panel(pen, plot.series[i],
          {kMargin + column * (width + kPanelGap), header_height(plot) + row * (kPanelHeight + kPanelGap),
           width, kPanelHeight})
        .draw();
  }
}

bool is_svg(const std::string& path) { return path.ends_with(".svg"); }

/// Takes what cairo has drawn.
cairo_status_t append(void* picture, const unsigned char* bytes, unsigned count) {
  static_cast<std::string*>(picture)->append(reinterpret_cast<const char*>(bytes), count);
  return CAIRO_STATUS_SUCCESS;
}

Problem failed(const std::string& path, std::string_view why) {
  return {"plot_failed", fmt::format("cannot draw {}: {}", path, why),
          "check the folder and the space on its disk", kExitFailure};
}

}  // namespace

std::expected<void, Problem> check_plot_file(const std::string& path) {
  if (!path.ends_with(".png") && !is_svg(path))
    return std::unexpected(usage_problem("bad_plot", fmt::format("--plot {}: neither .png nor .svg", path),
                                         "give a name that ends in .png or .svg"));
  const auto refusal = [&path](std::string_view why) {
    return std::unexpected(usage_problem("bad_plot", fmt::format("--plot {}: {}", path, why),
                                         "choose a file in a folder that exists and that you may write"));
  };
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path real = fs::weakly_canonical(fs::absolute(path, error), error);  // where a link leads
  if (error) return refusal(error.message());
  const bool replaces = fs::exists(real, error);
  if (replaces && !fs::is_regular_file(real, error)) return refusal("it is not a regular file");
  for (const fs::path& needed : {real.parent_path(), replaces ? real : real.parent_path()})
    if (::access(needed.c_str(), W_OK) != 0) return refusal(std::generic_category().message(errno));
  return {};
}

std::expected<void, Problem> draw(const Plot& plot, const std::string& path) {
  using Surface = std::unique_ptr<cairo_surface_t, decltype(&cairo_surface_destroy)>;
  const double height = height_of(plot);
  const bool svg = is_svg(path);
  constexpr double kPixels = 1.5;  // of a PNG a point
  std::string picture;             // outlives the surface, which writes into it
  const Surface surface(
      svg ? cairo_svg_surface_create_for_stream(append, &picture, kWidth, height)
          : cairo_image_surface_create(CAIRO_FORMAT_RGB24, static_cast<int>(kWidth * kPixels),
                                       static_cast<int>(height * kPixels)),
      cairo_surface_destroy);
  if (!svg) cairo_surface_set_device_scale(surface.get(), kPixels, kPixels);
  cairo_status_t status = CAIRO_STATUS_SUCCESS;
  {
    Pen pen(surface.get());
    draw_all(pen, plot);
    status = pen.status();
  }
  if (svg) {
    cairo_surface_finish(surface.get());
    if (status == CAIRO_STATUS_SUCCESS) status = cairo_surface_status(surface.get());
  } else if (status == CAIRO_STATUS_SUCCESS) {
    status = cairo_surface_write_to_png_stream(surface.get(), append, &picture);
  }
  if (status != CAIRO_STATUS_SUCCESS) return std::unexpected(failed(path, cairo_status_to_string(status)));
  if (const auto replaced = replace_file(path, picture); !replaced)
    return std::unexpected(failed(path, replaced.error().cause));
  return {};
}

}  // namespace tm485::cli
