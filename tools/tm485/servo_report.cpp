#include "servo_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <functional>

#include "json_output.hpp"
#include "quantity.hpp"
#include "statistics_text.hpp"

namespace tm485::cli {
namespace {

constexpr double kArcsecPerRev = 1'296'000.0;
constexpr double kRpmPerRevS = 60.0;
/// Later than this a control instant is said to be late.
constexpr Time kNoticeable{20'000};

double counts_per_rev(const ServoSettings& settings) {
  return static_cast<double>(std::int64_t{1} << settings.profile.profile().single_turn_bits);
}

double seconds(Time time) { return static_cast<double>(time.count()) / 1e9; }

/// A line of the table: a value of each run, and by what factor that of the last is smaller.
std::string row(std::string_view label, std::span<const ServoRun> runs, int digits,
                const std::function<double(const ServoRun&)>& value) {
  std::string text = fmt::format("{:<32}", label);
  bool all = true;
  for (const ServoRun& run : runs) {
    const bool known = run.plant.tracking_rev.count() != 0;
    text += known ? fmt::format("{:>18.{}f}", value(run), digits) : fmt::format("{:>18}", "-");
    all = all && known;
  }
  if (runs.size() == 2 && all && value(runs[1]) > 0.0)
    text += fmt::format("{:>9.1f} x", value(runs[0]) / value(runs[1]));
  return text + '\n';
}

std::string count_row(std::string_view label, std::span<const ServoRun> runs,
                      const std::function<std::uint64_t(const ServoRun&)>& value) {
  std::string text = fmt::format("{:<32}", label);
  for (const ServoRun& run : runs) text += fmt::format("{:>18}", value(run));
  return text + '\n';
}

std::string quality_rows(const ServoSettings& settings, std::span<const ServoRun> runs) {
  const double counts = counts_per_rev(settings);
  std::string text = fmt::format("{:<32}", "");
  for (const ServoRun& run : runs)
    text += fmt::format("{:>18}", run.feedback == Feedback::raw ? "raw differencing" : "estimator");
  text += runs.size() == 2 ? fmt::format("{:>11}\n", "ratio") : "\n";
  const auto tracking = [](const ServoRun& run) -> const Spread& { return run.plant.tracking_rev; };
  text += row("tracking error rms     [counts]", runs, 2,
              [&](const ServoRun& run) { return tracking(run).rms() * counts; });
  text += row("                       [arcsec]", runs, 2,
              [&](const ServoRun& run) { return tracking(run).rms() * kArcsecPerRev; });
  text += row("tracking error max     [counts]", runs, 2,
              [&](const ServoRun& run) { return tracking(run).largest() * counts; });
  text += row("                       [arcsec]", runs, 2,
              [&](const ServoRun& run) { return tracking(run).largest() * kArcsecPerRev; });
  text += row("velocity error rms        [rpm]", runs, 3,
              [](const ServoRun& run) { return run.plant.speed_rev_per_s.rms() * kRpmPerRevS; });
  text += row("velocity error max        [rpm]", runs, 3,
              [](const ServoRun& run) { return run.plant.speed_rev_per_s.largest() * kRpmPerRevS; });
  text += row(fmt::format("current above {:.0f} Hz rms  [mA]", kRippleHz), runs, 2,
              [](const ServoRun& run) { return run.plant.ripple_amperes.rms() * 1e3; });
  text += row(fmt::format("current above {:.0f} Hz max  [mA]", kRippleHz), runs, 2,
              [](const ServoRun& run) { return run.plant.ripple_amperes.largest() * 1e3; });
  return text;
}

std::string period_rows(const ServoSettings& settings, std::span<const ServoRun> runs) {
  std::string text;
  text += count_row("periods   fresh", runs, [](const ServoRun& run) { return run.periods.fresh; });
  text +=
      count_row("          extrapolated", runs, [](const ServoRun& run) { return run.periods.extrapolated; });
  text += count_row("          invalid, torque off", runs,
                    [](const ServoRun& run) { return run.periods.invalid; });
  text +=
      count_row("          of these latched", runs, [](const ServoRun& run) { return run.periods.latched; });
  text += count_row("torque-off", runs, [](const ServoRun& run) { return run.torque_offs; });
  text += count_row("switched on again by command", runs, [](const ServoRun& run) { return run.recoveries; });
  text += count_row("bus cycles", runs, [](const ServoRun& run) { return run.statistics.cycles; });
  text += count_row("          failed", runs, [](const ServoRun& run) { return run.statistics.failed; });
  text += count_row("          skipped", runs, [](const ServoRun& run) { return run.statistics.skipped; });
  text +=
      count_row("T1 violations, by the encoder", runs, [](const ServoRun& run) { return run.t1_violations; });
  if (settings.virtual_time) return text;
  text += count_row("control instants missed", runs, [](const ServoRun& run) { return run.skipped; });
  text +=
      count_row("current off by the watchdog", runs, [](const ServoRun& run) { return run.plant.watchdogs; });
  text += fmt::format("{:<32}", "lateness mean / max       [us]");
  for (const ServoRun& run : runs)
    text += fmt::format("{:>18}", fmt::format("{:.1f} / {:.1f}", seconds(run.lateness.mean()) * 1e6,
                                              seconds(run.lateness.maximum()) * 1e6));
  return text + '\n';
}

void add_spread(JsonObject& json, const Spread& spread, std::string_view unit, double factor) {
  json.set(fmt::format("rms_{}", unit), spread.rms() * factor);
  json.set(fmt::format("max_{}", unit), spread.largest() * factor);
}

JsonObject quality_json(const ServoSettings& settings, const PlantFindings& plant) {
  const double counts = counts_per_rev(settings);
  JsonObject tracking;
  add_spread(tracking, plant.tracking_rev, "counts", counts);
  add_spread(tracking, plant.tracking_rev, "deg", 360.0);
  JsonObject velocity;
  add_spread(velocity, plant.speed_rev_per_s, "rpm", kRpmPerRevS);
  add_spread(velocity, plant.speed_rev_per_s, "counts_s", counts);
  JsonObject current;
  add_spread(current, plant.ripple_amperes, "mA", 1e3);
  JsonObject json;
  json.set("tracking_error", std::move(tracking)).set("velocity_error", std::move(velocity));
  json.set("current_ripple", std::move(current)).set("top_rpm", plant.top_rev_per_s * kRpmPerRevS);
  return json;
}

JsonObject periods_json(const PeriodCounts& periods) {
  JsonObject json;
  json.set("waiting", periods.waiting).set("fresh", periods.fresh).set("extrapolated", periods.extrapolated);
  json.set("invalid", periods.invalid).set("latched", periods.latched);
  return json;
}

JsonObject bus_json(const Statistics& statistics) {
  JsonObject json;
  json.set("cycles", statistics.cycles).set("good", statistics.good).set("failed", statistics.failed);
  json.set("skipped", statistics.skipped).set("lost", statistics.lost);
  json.set("errors", error_counts_json(statistics));
  return json;
}

std::vector<JsonObject> warnings_json(const ServoRun& run) {
  std::vector<JsonObject> warnings;
  for (const linux_hal::RealtimeWarning& warning : run.warnings)
    warnings.emplace_back()
        .set("name", warning.name)
        .set("cause", warning.cause)
        .set("remedy", warning.remedy);
  return warnings;
}

JsonObject run_json(const ServoSettings& settings, const ServoRun& run) {
  JsonObject json;
  json.set("feedback", name(run.feedback)).set("measured_s", seconds(run.measured));
  json.set("quality", quality_json(settings, run.plant)).set("periods", periods_json(run.periods));
  json.set("torque_offs", run.torque_offs).set("recoveries", run.recoveries);
  json.set("lead_ns", run.lead.count()).set("bus", bus_json(run.statistics));
  json.set("t1_violations", run.t1_violations).set("smallest_t1_margin_ns", run.smallest_t1_margin.count());
  if (settings.virtual_time) return json;
  json.set("lateness", to_json(run.lateness)).set("skipped", run.skipped).set("overflows", run.overflows);
  json.set("watchdogs", run.plant.watchdogs);
  json.set("warnings", warnings_json(run));
  return json;
}

std::string_view clock_name(const ServoSettings& settings) {
  return settings.virtual_time ? "virtual time" : "real time";
}

}  // namespace

std::string servo_text(const ServoHead& head, const ServoSettings& settings, std::span<const ServoRun> runs) {
  const ServoRun& last = runs.back();
  std::string text =
      fmt::format("{}, profile {}, {} bits, {:.2f} s in {}\n", head.port, settings.profile.profile().name,
                  settings.profile.profile().single_turn_bits, seconds(last.measured), clock_name(settings));
  text += fmt::format("servo loop every {}, ID{} latched {} before each control instant\n",
                      format_time(settings.servo_period), number(settings.id), format_time(last.lead));
  text += fmt::format("reference: {}, top speed {:.0f} rpm; velocity loop {:g} Hz, estimator {:g} Hz\n\n",
                      head.reference, last.plant.top_rev_per_s * kRpmPerRevS, head.velocity_loop_hz,
                      head.bandwidth_hz);
  text += quality_rows(settings, runs);
  text += fmt::format("(against the true shaft, from {} after each switching-on)\n", format_time(kSettle));
  text += '\n' + period_rows(settings, runs);
  for (const ServoRun& run : runs)
    if (run.statistics.failed != 0)
      text += fmt::format("errors, {}: {}\n", name(run.feedback), error_counts(run.statistics));
  for (const ServoRun& run : runs)
    if (run.overflows != 0)
      text += fmt::format("{} commands did not reach the motor in time ({}): the machine is too busy\n",
                          run.overflows, name(run.feedback));
  if (std::ranges::any_of(runs, [](const ServoRun& run) { return run.lateness.maximum() > kNoticeable; }))
    text += "late control instants: other work has this machine too; tm485 rt-check says what to change\n";
  for (const linux_hal::RealtimeWarning& warning : last.warnings)
    text += fmt::format("warning: {}: {}\n  remedy: {}\n", warning.name, warning.cause, warning.remedy);
  return text;
}

std::string servo_json(const ServoHead& head, const ServoSettings& settings, std::span<const ServoRun> runs) {
  JsonObject json;
  json.set("port", head.port).set("profile", settings.profile.profile().name);
  json.set("single_turn_bits", unsigned{settings.profile.profile().single_turn_bits});
  json.set("clock", clock_name(settings)).set("id", number(settings.id));
  json.set("servo_period_ns", settings.servo_period.count()).set("reference", head.reference);
  json.set("velocity_loop_hz", head.velocity_loop_hz).set("bandwidth_hz", head.bandwidth_hz);
  json.set("hold_ns", settings.hold.count()).set("outage_ns", settings.outage.count());
  std::vector<JsonObject> objects;
  for (const ServoRun& run : runs) objects.push_back(run_json(settings, run));
  json.set("runs", std::move(objects));
  return json.text() + '\n';
}

}  // namespace tm485::cli
