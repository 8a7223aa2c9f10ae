#include "statistics_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "quantity.hpp"

namespace tm485::cli {
namespace {

struct ErrorCount {
  Errc code;
  std::uint32_t count;
};

std::vector<ErrorCount> counted(const Statistics& statistics) {
  std::vector<ErrorCount> result;
  for (std::size_t i = 1; i < statistics.errors.size(); ++i)
    if (statistics.errors[i] != 0) result.push_back({static_cast<Errc>(i), statistics.errors[i]});
  std::ranges::sort(result, [](const ErrorCount& a, const ErrorCount& b) {
    return a.count != b.count ? a.count > b.count : a.code < b.code;
  });
  return result;
}

double us(Time time) { return static_cast<double>(time.count()) / 1e3; }

std::string_view name(TimingClass timing) {
  switch (timing) {
    case TimingClass::hard:
      return "hard";
    case TimingClass::soft:
      return "soft";
    case TimingClass::best_effort:
      break;
  }
  return "best_effort";
}

}  // namespace

std::string error_counts(const Statistics& statistics) {
  std::string text;
  for (const ErrorCount& error : counted(statistics))
    text += fmt::format("{}{} {}", text.empty() ? "" : ", ", tm485::name(error.code), error.count);
  return text.empty() ? "none" : text;
}

JsonObject error_counts_json(const Statistics& statistics) {
  JsonObject json;
  for (const ErrorCount& error : counted(statistics)) json.set(tm485::name(error.code), error.count);
  return json;
}

std::string min_mean_max(const TimeStatistic& statistic) {
  if (statistic.count() == 0) return "-";
  return fmt::format("{:.1f} / {:.1f} / {:.1f} us", us(statistic.minimum()), us(statistic.mean()),
                     us(statistic.maximum()));
}

JsonObject to_json(const TimeStatistic& statistic) {
  JsonObject json;
  json.set("min_ns", statistic.minimum().count())
      .set("mean_ns", statistic.mean().count())
      .set("max_ns", statistic.maximum().count())
      .set("samples", statistic.count());
  return json;
}

std::string bars(const Histogram& histogram) {
  constexpr std::array<std::string_view, 9> kBars{" ",      "\u2581", "\u2582", "\u2583", "\u2584",
                                                  "\u2585", "\u2586", "\u2587", "\u2588"};
  const std::uint32_t highest = std::max(1U, *std::ranges::max_element(histogram.bins));
  std::string text;
  for (const std::uint32_t bin : histogram.bins) {
    // Whatever happened at all is at least one eighth high.
    const auto height = (std::uint64_t{bin} * 8 + highest - 1) / highest;
    text += kBars[height];
  }
  return text;
}

std::string capability_text(const PortCapability& capability) {
  return fmt::format(
      "timing {}, {}, shortest exchange {}, jitter margin {}, latency allowance {}", name(capability.timing),
      capability.wire_timestamps ? "wire timestamps" : "no wire timestamps",
      capability.shortest_exchange == Time{0} ? "T1" : format_time(capability.shortest_exchange),
      format_time(capability.jitter_margin), format_time(capability.latency_allowance));
}

JsonObject to_json(const PortCapability& capability) {
  JsonObject json;
  json.set("timing", name(capability.timing))
      .set("wire_timestamps", capability.wire_timestamps)
      .set("shortest_exchange_ns", capability.shortest_exchange.count())
      .set("jitter_margin_ns", capability.jitter_margin.count())
      .set("latency_allowance_ns", capability.latency_allowance.count())
      .set("release_bound_ns", capability.release_bound.count());
  return json;
}

std::string_view reply_delay_name(const PortCapability& capability) {
  return capability.wire_timestamps ? "T2" : "reply delay";
}
std::string_view reply_delay_key(const PortCapability& capability) {
  return capability.wire_timestamps ? "t2" : "reply_delay";
}

}  // namespace tm485::cli
