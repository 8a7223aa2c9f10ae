// tm485 rt-check: what the machine's settings allow a real-time thread, and how late one is on it.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <optional>

#include "commands.hpp"
#include "cyclictest.hpp"
#include "json_output.hpp"
#include "output.hpp"
#include "percentiles.hpp"
#include "problem.hpp"
#include "quantity.hpp"
#include "stop_signal.hpp"
#include "text_wrap.hpp"
#include "tm485/linux/periodic_wait.hpp"
#include "tm485/linux/realtime_thread.hpp"
#include "tm485/linux/rt_settings.hpp"

namespace tm485::cli {
namespace {

using linux_hal::RtSetting;
using linux_hal::Verdict;
using linux_hal::WaitMode;

constexpr std::size_t kMostSamples = 1'000'000;
constexpr int kPriority = 80;
constexpr Time kShortest{10'000};

struct Measure {
  std::string_view name;
  Reservoir lateness;
  std::uint32_t overruns = 0;
  std::uint64_t skipped = 0;
  std::vector<linux_hal::RealtimeWarning> warnings;
};

/// The first isolated core; without one, any.
int chosen_cpu() {
  std::ifstream file("/sys/devices/system/cpu/isolated");
  int cpu = -1;
  return file >> cpu ? cpu : -1;
}

std::expected<Measure, Problem> measure(std::string_view name, WaitMode mode, Time period, Time duration,
                                        int cpu) {
  const auto expected = static_cast<std::size_t>(duration / period) + 2;
  Measure result{name, Reservoir(std::min(expected, kMostSamples)), 0, 0, {}};
  const auto body = [&](const std::atomic<bool>& stop) {
    const linux_hal::MonotonicClock clock;
    linux_hal::PeriodicWait wait(clock, {.period = period, .mode = mode});
    const auto cycles = static_cast<std::uint64_t>(duration / period);
    while (!stop.load(std::memory_order_relaxed) && !stop_requested() &&
           result.lateness.count() + wait.skipped() < cycles)
      result.lateness.add(wait.wait());
    result.overruns = wait.overruns();
    result.skipped = wait.skipped();
  };
  auto thread =
      linux_hal::RealtimeThread::start({.name = "tm485_rt_check", .priority = kPriority, .cpu = cpu}, body);
  if (!thread)
    return std::unexpected(Problem{"no_thread", thread.error().what, thread.error().remedy, kExitFailure});
  thread->join();
  result.warnings = thread->warnings();
  if (!thread->failure().empty())
    return std::unexpected(Problem{"internal_error", thread->failure(), "report this", kExitFailure});
  return result;
}

bool real_time(const Measure& measure) {
  return std::none_of(measure.warnings.begin(), measure.warnings.end(),
                      [](const auto& warning) { return warning.name == "priority"; });
}

std::string settings_text(const std::vector<RtSetting>& settings) {
  constexpr std::size_t kIndent = 27;
  std::string text;
  for (const RtSetting& setting : settings) {
    text += fmt::format("{:<14} {:<11} {}\n", setting.name, linux_hal::verdict_name(setting.verdict),
                        wrapped(setting.value, kIndent));
    if (!setting.remedy.empty()) text += std::string(kIndent, ' ') + wrapped(setting.remedy, kIndent) + '\n';
  }
  return text;
}

JsonObject to_json(const CyclictestResult& result) {
  JsonObject json;
  json.set("min_ns", result.minimum().count())
      .set("p50_ns", result.percentile(0.5).count())
      .set("p99_ns", result.percentile(0.99).count());
  json.set("p99_9_ns", result.percentile(0.999).count())
      .set("max_ns", result.maximum().count())
      .set("samples", result.count());
  return json;
}

std::string to_row(const CyclictestResult& result) {
  const auto us = [](Time time) { return time.count() / 1'000; };
  return fmt::format("{:<14} {:>10} {:>10} {:>10} {:>10} {:>10}\n", "cyclictest", us(result.minimum()),
                     us(result.percentile(0.5)), us(result.percentile(0.99)), us(result.percentile(0.999)),
                     us(result.maximum()));
}

struct Report {
  std::vector<RtSetting> settings;
  std::vector<Measure> measures;
  std::optional<CyclictestResult> cyclictest;
  std::string no_cyclictest;  ///< why there is none
  Time period{0};
  int cpu = -1;
};

std::string report_json(Report& report) {
  std::vector<JsonObject> settings;
  for (const RtSetting& each : report.settings) {
    JsonObject setting;
    setting.set("name", each.name)
        .set("value", each.value)
        .set("verdict", linux_hal::verdict_name(each.verdict))
        .set("remedy", each.remedy);
    settings.push_back(std::move(setting));
  }
  std::vector<JsonObject> warnings;
  JsonObject lateness;
  for (Measure& each : report.measures) {
    JsonObject measure = to_json(each.lateness);
    measure.set("overruns", each.overruns).set("skipped", each.skipped);
    lateness.set(each.name, std::move(measure));
  }
  if (report.cyclictest) lateness.set("cyclictest", to_json(*report.cyclictest));
  for (const linux_hal::RealtimeWarning& each : report.measures.front().warnings) {
    JsonObject warning;
    warning.set("name", each.name).set("cause", each.cause).set("remedy", each.remedy);
    warnings.push_back(std::move(warning));
  }
  JsonObject json;
  json.set("settings", std::move(settings)).set("period_ns", report.period.count()).set("cpu", report.cpu);
  json.set("priority", real_time(report.measures.front()) ? kPriority : 0)
      .set("warnings", std::move(warnings));
  json.set("lateness", std::move(lateness));
  if (!report.no_cyclictest.empty()) json.set("no_cyclictest", report.no_cyclictest);
  return json.text() + '\n';
}

std::string report_text(Report& report) {
  constexpr std::size_t kIndent = 2;
  const bool fifo = real_time(report.measures.front());
  std::string text = settings_text(report.settings);
  text += fmt::format("\nlateness every {}, {}{}, one after the other\n", format_time(report.period),
                      fifo ? fmt::format("SCHED_FIFO {}", kPriority) : std::string("ordinary scheduling"),
                      report.cpu < 0 ? std::string() : fmt::format(", core {}", report.cpu));
  text += row_header();
  for (Measure& each : report.measures) text += to_row(each.name, each.lateness);
  if (report.cyclictest) text += to_row(*report.cyclictest);
  for (const Measure& each : report.measures)
    if (each.overruns != 0)
      text += fmt::format("{}: {} overruns, {} cycles skipped\n", each.name, each.overruns, each.skipped);
  for (const linux_hal::RealtimeWarning& each : report.measures.front().warnings)
    text += fmt::format("warning: {}\n  {}\n", wrapped(each.cause, kIndent), wrapped(each.remedy, kIndent));
  if (!report.no_cyclictest.empty()) text += "cyclictest: " + wrapped(report.no_cyclictest, kIndent) + '\n';
  return text;
}

std::expected<Report, Problem> check(Time period, Time duration) {
  Report report;
  report.settings = linux_hal::read_rt_settings();
  report.period = period;
  report.cpu = chosen_cpu();
  for (const auto& [name, mode] :
       {std::pair{"spin", WaitMode::spin}, std::pair{"hybrid", WaitMode::hybrid}}) {
    auto measured = measure(name, mode, period, duration, report.cpu);
    if (!measured) return std::unexpected(measured.error());
    report.measures.push_back(std::move(*measured));
  }
  const std::string path = find_cyclictest();
  if (path.empty()) {
    report.no_cyclictest = "not installed; to compare with it: sudo apt install rt-tests";
  } else if (!stop_requested()) {
    const int priority = real_time(report.measures.front()) ? kPriority : 0;
    if (auto result = run_cyclictest(path, {period, duration, priority, report.cpu}))
      report.cyclictest = std::move(*result);
    else
      report.no_cyclictest = result.error().cause + "; " + result.error().remedy;
  }
  return report;
}

}  // namespace

int run_rt_check(const RtCheckOptions& options) {
  const auto period = parse_period(options.period);
  if (!period || *period < kShortest)
    return report(usage_problem(
        "bad_period",
        fmt::format("--period {}: {}", options.period, period ? "it is shorter than 10us" : period.error()),
        "write a time (62.5us) or a rate (16kHz)"));
  const auto seconds = parse_time(options.seconds, PlainNumber::seconds);
  if (!seconds || *seconds < *period)
    return report(usage_problem("bad_duration",
                                fmt::format("--seconds {}: {}", options.seconds,
                                            seconds ? "it is shorter than a period" : seconds.error()),
                                "write seconds (2.5) or a time (500ms)"));
  auto checked = check(*period, *seconds);
  if (!checked) return report(checked.error());
  Output output;
  output.write(options.json ? report_json(*checked) : report_text(*checked));
  const int result = finish(output, kExitGood);
  const bool bad = std::any_of(checked->settings.begin(), checked->settings.end(),
                               [](const RtSetting& each) { return each.verdict == Verdict::bad; });
  return result == kExitGood && options.strict && bad ? kExitFailure : result;
}

}  // namespace tm485::cli
