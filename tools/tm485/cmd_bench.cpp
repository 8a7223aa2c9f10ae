// tm485 bench: how well port and host hold the cycle.

#include <fmt/format.h>

#include <algorithm>

#include "commands.hpp"
#include "confirm.hpp"
#include "direction_view.hpp"
#include "json_output.hpp"
#include "output.hpp"
#include "percentiles.hpp"
#include "plot.hpp"
#include "quantity.hpp"
#include "sample_text.hpp"
#include "session.hpp"
#include "statistics_text.hpp"
#include "stop_signal.hpp"
#include "time_buckets.hpp"

namespace tm485::cli {
namespace {

/// 4 series of 8 bytes a value: at most 32 MB. At 25 kHz this is 40 s of every value.
constexpr std::size_t kMostSamples = 1'000'000;

/// One time of each cycle: its percentiles and its histogram.
struct Series {
  explicit Series(std::size_t capacity) : values(capacity) {}

  void add(Time value) noexcept {
    values.add(value);
    buckets.add(value);
  }
  [[nodiscard]] std::uint64_t count() const noexcept { return values.count(); }

  Reservoir values;
  TimeBuckets buckets;
};

JsonObject series_json(Series& series) {
  JsonObject json = to_json(series.values);
  json.set("histogram", to_json(series.buckets.filled()));
  return json;
}

class Recorder {
 public:
  explicit Recorder(std::size_t capacity)
      : period(capacity), lateness(capacity), reply_delay(capacity), round_trip(capacity) {}

  void add(const CycleRecord& record) noexcept {
    if (record.kind != CycleRecord::Kind::cyclic) {
      in_sequence_ = false;  // the gap of a start-up is no period
      return;
    }
    if (in_sequence_) {
      period.add(record.start - last_start_);
      span_ += record.start - last_start_;
    }
    in_sequence_ = true;
    last_start_ = record.start;
    lateness.add(record.start - record.slot);
    if (record.has_reply_delay) reply_delay.add(record.reply_delay);
    if (record.result == Errc::ok) round_trip.add(record.seen - record.start);
  }

  /// Good cycles a second, over the time in which cycles ran.
  [[nodiscard]] double rate(const Statistics& statistics) const noexcept {
    if (span_ == Time{0} || statistics.cycles == 0) return 0.0;
    const double good = static_cast<double>(statistics.good) / static_cast<double>(statistics.cycles);
    return good * static_cast<double>(period.count()) * 1e9 / static_cast<double>(span_.count());
  }

  Series period, lateness, reply_delay, round_trip;

 private:
  bool in_sequence_ = false;
  Time last_start_{0};
  Time span_{0};
};

struct Rates {
  double achieved, limit, percent;
};

Rates rates(const Session& session, const Recorder& recorder, const Statistics& statistics) {
  const double limit = 1e9 / static_cast<double>(session.profile().t1(session.scheduler().id()).count());
  const double achieved = recorder.rate(statistics);
  return {achieved, limit, achieved * 100.0 / limit};
}

std::string bench_json(Session& session, Recorder& recorder, Time measured) {
  const Statistics& statistics = session.bus().statistics();
  const Rates rate = rates(session, recorder, statistics);
  JsonObject json;
  json.set("port", session.port().text())
      .set("profile", session.profile().profile().name)
      .set("clock", session.clock_name());
  json.set("id", number(session.scheduler().id())).set("period_ns", session.scheduler().period().count());
  json.set("measured_s", static_cast<double>(measured.count()) / 1e9);
  json.set("cycles", statistics.cycles).set("good", statistics.good).set("failed", statistics.failed);
  json.set("errors", error_counts_json(statistics)).set("lost", statistics.lost);
  json.set("slips", statistics.slips).set("skipped", statistics.skipped);
  json.set("port_returns", session.port_returns());
  json.set("rate_hz", rate.achieved).set("limit_hz", rate.limit).set("rate_percent", rate.percent);
  json.set("period", series_json(recorder.period)).set("lateness", series_json(recorder.lateness));
  json.set(reply_delay_key(session.capability()), series_json(recorder.reply_delay));
  json.set("round_trip", series_json(recorder.round_trip)).set("capability", to_json(session.capability()));
  json.set("direction", direction_json(session.port()));
  return json.text() + '\n';
}

std::string bench_text(Session& session, Recorder& recorder, Time measured) {
  const Statistics& statistics = session.bus().statistics();
  const Rates rate = rates(session, recorder, statistics);
  std::string text =
      fmt::format("{}, profile {}, in {}\n{}\n", session.port().text(), session.profile().profile().name,
                  session.clock_name(), capability_text(session.capability()));
  text += direction_line(session.port());
  text += fmt::format("ID{} every {}{}, {} cycles in {:.2f} s\n\n", number(session.scheduler().id()),
                      format_time(session.scheduler().period()),
                      session.scheduler().free_running() ? " (free-running)" : "", statistics.cycles,
                      static_cast<double>(measured.count()) / 1e9);
  text += row_header();
  text += to_row("period", recorder.period.values);
  text += to_row("lateness", recorder.lateness.values);
  text += to_row(reply_delay_name(session.capability()), recorder.reply_delay.values);
  text += to_row("round trip", recorder.round_trip.values);
  text += release_row(session.port());
  text += fmt::format("\nrate     {:.2f} Hz, {:.3f} % of the T1 limit ({:.2f} Hz)\n", rate.achieved,
                      rate.percent, rate.limit);
  text +=
      fmt::format("cycles   {} good, {} failed, {} slips, {} skipped, encoder lost {} times\n",
                  statistics.good, statistics.failed, statistics.slips, statistics.skipped, statistics.lost);
  text += fmt::format("errors   {}\n", error_counts(statistics));
  text += direction_warning_lines(session.port());
  if (session.port_returns() != 0)
    text += fmt::format("port     unplugged and back {} times\n", session.port_returns());
  if (recorder.period.values.kept() < recorder.period.count())
    text += fmt::format("percentiles from {} values chosen at random out of {}\n",
                        recorder.period.values.kept(), recorder.period.count());
  return text;
}

PlotSeries panel(std::string title, Series& series) {
  PlotSeries panel;
  panel.title = std::move(title);
  panel.buckets = series.buckets.filled();
  if (series.count() == 0) return panel;
  panel.marks = {{"p50", series.values.percentile(0.5)},
                 {"p99", series.values.percentile(0.99)},
                 {"p99.9", series.values.percentile(0.999)},
                 {"max", series.values.maximum()}};
  return panel;
}

Plot bench_plot(Session& session, Recorder& recorder, Time measured) {
  const Statistics& statistics = session.bus().statistics();
  const Profile& profile = session.profile().profile();
  const Rates rate = rates(session, recorder, statistics);
  Plot plot;
  plot.title = fmt::format("tm485 bench {}: profile {}, ID{} every {}", session.port().text(), profile.name,
                           number(session.scheduler().id()), format_time(session.scheduler().period()));
  plot.subtitles = {fmt::format("{} cycles in {:.2f} s of {}: {} good, {} failed ({}), {} slips, {} skipped",
                                statistics.cycles, static_cast<double>(measured.count()) / 1e9,
                                session.clock_name(), statistics.good, statistics.failed,
                                error_counts(statistics), statistics.slips, statistics.skipped),
                    fmt::format("{:.1f} Hz, {:.2f} % of the T1 limit; {}", rate.achieved, rate.percent,
                                capability_text(session.capability()))};
  PlotSeries delay =
      panel(session.capability().wire_timestamps ? "T2: request's end to reply's start, on the wire"
                                                 : "Reply delay: request's end to first byte seen",
            recorder.reply_delay);
  if (session.capability().wire_timestamps) {
    delay.window = {profile.t2_min, profile.t2_max};
    delay.window_label = "window of the profile";
  }
  plot.series.push_back(std::move(delay));
  plot.series.push_back(panel("Lateness of the requests", recorder.lateness));
  plot.series.push_back(panel("Round trip: request's start to reply seen", recorder.round_trip));
  plot.series.push_back(panel("Period: request's start to the next one's", recorder.period));
  if (const linux_hal::TimeHistogram* const release = session.port().release_times()) {
    PlotSeries direction;
    direction.title = "Release: request's end to driver off the line";
    direction.buckets = buckets_of(*release);
    direction.marks = {{"p50", release->percentile(0.5)},
                       {"p99", release->percentile(0.99)},
                       {"p99.9", release->percentile(0.999)},
                       {"max", release->maximum()}};
    direction.window = {profile.t2_min, profile.t2_max};
    direction.window_label = "a reply may begin";
    plot.series.push_back(std::move(direction));
  }
  return plot;
}

std::expected<Time, Problem> duration(const std::string& text) {
  const auto time = parse_time(text, PlainNumber::seconds);
  if (time && *time > Time{0}) return *time;
  return std::unexpected(
      usage_problem("bad_duration", fmt::format("--seconds {}: {}", text, time ? "it is zero" : time.error()),
                    "write seconds (2.5) or a time (500ms)"));
}

/// Steps until `end`, also while the port is unplugged. The problem that ended the run before, if there is one, or that
/// the port is still gone.
std::optional<Problem> measure(Session& session, Time end, Recorder& recorder) {
  while (!stop_requested() && session.now() < end) {
    if (session.step(end)) recorder.add(session.bus().last_record());
    if (session.tend_port()) continue;
    if (auto problem = session.failure()) return problem;
  }
  return session.port().gone() ? session.failure() : std::nullopt;
}

}  // namespace

int run_bench(const BenchOptions& options) {
  SessionOptions settings;
  settings.port = options.port;
  settings.cycle.id = static_cast<DataId>(options.id);
  settings.virtual_time = options.virtual_time;
  const auto period = parse_period_option(options.period.empty() ? "min" : options.period);
  if (!period) return report(period.error());
  settings.cycle.period = *period;
  const auto seconds = duration(options.seconds);
  if (!seconds) return report(seconds.error());
  if (!options.plot.empty()) {
    if (const auto file = check_plot_file(options.plot); !file) return report(file.error());
    if (const auto free = may_replace(options.yes, options.plot); !free) return report(free.error());
  }

  const auto opened = Session::open(settings);
  if (!opened) return report(opened.error());
  Session& session = **opened;
  const auto expected = static_cast<std::size_t>(*seconds / session.scheduler().period()) + 2;
  Recorder recorder(std::min(expected, kMostSamples));
  if (const auto started = session.wait_for_startup(); !started)
    return started.error().exit_code == kExitGood ? kExitGood : report(started.error());
  const Time begin = session.now();
  const auto problem = measure(session, begin + *seconds, recorder);
  const Time measured = session.now() - begin;

  Output output;
  output.write(options.port.json ? bench_json(session, recorder, measured)
                                 : bench_text(session, recorder, measured));
  const int result = finish(output, kExitGood);
  if (!options.plot.empty())
    if (const auto drawn = draw(bench_plot(session, recorder, measured), options.plot); !drawn)
      return report(drawn.error());
  if (problem) return report(*problem);
  if (result != kExitGood || session.bus().statistics().good != 0 || session.bus().statistics().cycles == 0)
    return result;
  return report({"no_sample", "not one cycle brought a sample", "see the errors by cause", kExitFailure});
}

}  // namespace tm485::cli
