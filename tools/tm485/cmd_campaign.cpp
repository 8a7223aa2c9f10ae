// tm485 campaign: the whole stack in virtual time against the encoder model, with random faults, every cycle judged.

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <ctime>
#include <thread>

#include "campaign/campaign.hpp"
#include "campaign/recorder.hpp"
#include "commands.hpp"
#include "heap_count.hpp"
#include "json_output.hpp"
#include "output.hpp"
#include "plan_text.hpp"
#include "problem.hpp"
#include "quantity.hpp"
#include "safe_file.hpp"
#include "screen.hpp"
#include "stop_signal.hpp"
#include "tm485/linux/clock.hpp"

namespace tm485::cli {
namespace {

using namespace campaign;

constexpr std::uint64_t kCyclesShown = 20;  ///< of a trace, before the failing one
constexpr unsigned kMostJobs = 256;

/// A recorder allocates; every other run is judged by its allocations too.
RunResult play(const RunSetup& setup, RunOptions options) {
  if (options.recorder == nullptr) options.allocations = heap_allocations;
  return run(setup, options);
}

/// "SEED:RUN"
std::optional<std::pair<std::uint64_t, std::uint64_t>> read_replay(std::string_view text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos) return std::nullopt;
  const auto number = [](std::string_view part) -> std::optional<std::uint64_t> {
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(part.data(), part.data() + part.size(), value);
    if (error != std::errc{} || end != part.data() + part.size()) return std::nullopt;
    return value;
  };
  const auto seed = number(text.substr(0, colon));
  const auto run = number(text.substr(colon + 1));
  if (!seed || !run) return std::nullopt;
  return std::pair(*seed, *run);
}

double in_us(Time time) { return static_cast<double>(time.count()) * 1e-3; }

double cycles_of(const Totals& totals, Recovery kind) {
  return static_cast<double>(totals.longest_recovery[static_cast<std::size_t>(kind)]) * 0.01;
}

JsonObject json_of(const Totals& totals) {
  JsonObject json;
  json.set("runs", totals.runs)
      .set("cycles", totals.cycles)
      .set("good", totals.good)
      .set("failed", totals.failed)
      .set("touched", totals.touched)
      .set("changed", totals.changed)
      .set("changed_and_fresh", totals.changed_and_fresh)
      .set("wrong", totals.wrong)
      .set("dangerous", totals.dangerous)
      .set("frozen_and_wrong", totals.frozen_and_wrong)
      .set("beyond_half_width", totals.beyond)
      .set("startups", totals.startups)
      .set("restarts", totals.restarts)
      .set("lost_turns", totals.lost_turns)
      .set("eeprom_reads", totals.eeprom_reads)
      .set("eeprom_writes", totals.eeprom_writes)
      .set("eeprom_judged", totals.eeprom_judged)
      .set("resets", totals.resets)
      .set("resets_verified", totals.resets_verified)
      .set("axis_runs", totals.axis_runs)
      .set("mixed_runs", totals.mixed_runs)
      .set("slow_port_runs", totals.slow_runs)
      .set("loop_reads", totals.loop_reads)
      .set("let_go", totals.let_go)
      .set("resumed", totals.resumed)
      .set("commands", totals.commands)
      .set("estimates", totals.estimates)
      .set("phases", totals.phases)
      .set("longest_fresh_age_ns", totals.longest_loss.count())
      .set("longest_fresh_age_cycles", static_cast<double>(totals.longest_loss_cycles) * 0.01)
      .set("longest_recovery_cycles", cycles_of(totals, Recovery::plain))
      .set("longest_step_cycles", cycles_of(totals, Recovery::step))
      .set("longest_startup_cycles", cycles_of(totals, Recovery::startup))
      .set("longest_startup_ns", totals.longest_startup.count());
  if (totals.smallest_t1_margin != kNever)
    json.set("smallest_t1_margin_ns", totals.smallest_t1_margin.count());
  return json;
}

JsonObject json_of(const RunSetup& setup, const Violation& violation) {
  JsonObject json;
  json.set("rule", name(violation.rule))
      .set("what", campaign::describe(violation))
      .set("seed", setup.seed)
      .set("run", setup.run)
      .set("cycle", violation.cycle)
      .set("time_ns", violation.time.count())
      .set("setup", setup.text())
      .set("plan", setup.plan.to_text());
  return json;
}

/// How long a campaign took: by the clock, and of processors.
struct Duration {
  double clock = 0.0;
  double processor = 0.0;
};

double millions_a_second(const Totals& totals, double seconds) {
  return seconds > 0.0 ? static_cast<double>(totals.cycles) / seconds * 1e-6 : 0.0;
}

double processor_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

void show(Output& output, const Totals& totals, const Duration& took) {
  const auto row = [&](std::string_view what, const std::string& value) {
    output.write(fmt::format("  {:<58} {:>16}\n", what, value));
  };
  row("cycles", fmt::format("{}", totals.cycles));
  row("runs, start-ups, restarts of the encoder",
      fmt::format("{}, {}, {}", totals.runs, totals.startups, totals.restarts));
  row("runs with a servo loop, several IDs, a slow port",
      fmt::format("{}, {}, {}", totals.axis_runs, totals.mixed_runs, totals.slow_runs));
  row("good and failed cycles", fmt::format("{}, {}", totals.good, totals.failed));
  row("cycles with a fault, with changed bits", fmt::format("{}, {}", totals.touched, totals.changed));
  row("changed frames that became fresh samples", fmt::format("{}", totals.changed_and_fresh));
  row("  of them wrong, by more than 0.18 degrees", fmt::format("{}, {}", totals.wrong, totals.dangerous));
  row("fresh samples of a frozen sensor that were wrong", fmt::format("{}", totals.frozen_and_wrong));
  row("  beyond the half-width: frozen, or wrong again and again", fmt::format("{}", totals.beyond));
  if (totals.lost_turns != 0)
    row("whole turns off, read without turns", fmt::format("{}", totals.lost_turns));
  row("EEPROM reads and writes between the cycles, of both judged",
      fmt::format("{}, {}, {}", totals.eeprom_reads, totals.eeprom_writes, totals.eeprom_judged));
  row("runs of resets, of them verified", fmt::format("{}, {}", totals.resets, totals.resets_verified));
  row("servo loops: reads, let go, taken hold again",
      fmt::format("{}, {}, {}", totals.loop_reads, totals.let_go, totals.resumed));
  row("  estimates, samples in phase with a servo clock",
      fmt::format("{}, {}", totals.estimates, totals.phases));
  row("oldest sample that was called fresh",
      fmt::format("{:.2f} cycles, {:.1f} us", static_cast<double>(totals.longest_loss_cycles) * 0.01,
                  in_us(totals.longest_loss)));
  row("longest until fresh again, without a start-up",
      fmt::format("{:.2f} cycles", cycles_of(totals, Recovery::plain)));
  row("  the same if the last fresh sample was wrong",
      fmt::format("{:.2f} cycles", cycles_of(totals, Recovery::step)));
  row("longest until fresh again, through a start-up",
      fmt::format("{:.2f} cycles, {:.1f} us", cycles_of(totals, Recovery::startup),
                  in_us(totals.longest_startup)));
  if (totals.smallest_t1_margin != kNever)
    row("smallest T1 beyond the minimum", fmt::format("{} ns", totals.smallest_t1_margin.count()));
  row("speed, by the clock; of one processor's time",
      fmt::format("{:.2f}; {:.2f} million cycles/s", millions_a_second(totals, took.clock),
                  millions_a_second(totals, took.processor)));
}

/// One line on a terminal's standard error, drawn again in its place.
class Progress {
 public:
  explicit Progress(std::uint64_t total) : total_(total), terminal_(::isatty(STDERR_FILENO) == 1) {}
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;
  ~Progress() {
    if (drawn_) fmt::print(stderr, "\r\x1b[2K");
  }
  void show(std::uint64_t done) {
    constexpr Time kRedraw = std::chrono::milliseconds(200);
    const Time now = clock_.now();
    if (!terminal_ || now - last_ < kRedraw || done == 0) return;
    last_ = now;
    drawn_ = true;
    const double fraction = static_cast<double>(done) / static_cast<double>(total_);
    const double left = std::chrono::duration<double>(now - begun_).count() * (1.0 - fraction) / fraction;
    fmt::print(stderr, "\r\x1b[2K[{}] {:.1f} of {:.1f} million cycles, {:.0f} s left", gauge(fraction, 30),
               static_cast<double>(done) * 1e-6, static_cast<double>(total_) * 1e-6, std::max(left, 0.0));
    std::fflush(stderr);
  }
  [[nodiscard]] double seconds() const {
    return std::chrono::duration<double>(clock_.now() - begun_).count();
  }

 private:
  linux_hal::MonotonicClock clock_;
  Time begun_ = clock_.now();
  Time last_ = -kNever;
  std::uint64_t total_;
  bool terminal_;
  bool drawn_ = false;
};

/// No rule can be broken where no cycle is.
Problem nothing_judged() {
  return {
      "nothing_judged", "no start-up has succeeded, so there was no cycle to judge",
      "give the encoder a chance to answer: tm485 monitor 'sim:plan=...' shows what becomes of its replies",
      kExitFailure};
}

std::string_view verdict_of(bool stopped, const Totals& totals) {
  if (totals.cycles == 0) return "nothing was judged";
  return stopped ? "stopped; until then no rule was broken" : "no rule is broken";
}

int replay(const CampaignCommandOptions& options, const RunSetup& setup) {
  if (!options.vcd.empty()) {  // its name is taken before a run that may be long
    if (auto taken = create_file(options.vcd, ""); !taken) {
      taken.error().exit_code = kExitUsage;
      return report(taken.error());
    }
  }
  const RunResult first = play(setup, {.stop = &stop_flag()});
  const std::uint64_t around = first.violation ? first.violation->cycle : 0;
  Recorder recorder(around > kCyclesShown ? around - kCyclesShown : 0);
  const RunSetup shown = [&] {
    RunSetup part = setup;  // without a failure the first cycles tell what the run is like
    if (!first.violation) part.cycles = std::min(part.cycles, 2 * kCyclesShown);
    return part;
  }();
  (void)play(shown, {.stop = first.violation ? &stop_flag() : nullptr, .recorder = &recorder});
  std::expected<void, Problem> drawn;
  if (!options.vcd.empty()) drawn = replace_file(options.vcd, recorder.vcd(), Links::refuse);
  Output output;
  if (options.json) {
    JsonObject json = json_of(first.totals);
    json.set("seed", setup.seed)
        .set("run", setup.run)
        .set("setup", setup.text())
        .set("plan", setup.plan.to_text())
        .set("stopped", first.stopped);
    if (first.violation) json.set("failure", json_of(setup, *first.violation));
    output.write(json.text() + "\n");
  } else {
    output.write(fmt::format("run {} of seed {}: {}\n{}\n", setup.run, setup.seed, setup.text(),
                             setup.plan.to_text()));
    output.write(recorder.table());
    output.write(first.violation ? fmt::format("\n{}: cycle {}, {}: {}\n", name(first.violation->rule),
                                               first.violation->cycle, format_time(first.violation->time),
                                               campaign::describe(*first.violation))
                                 : fmt::format("\n{} in {} cycles\n", verdict_of(first.stopped, first.totals),
                                               first.totals.cycles));
    if (!options.vcd.empty() && drawn) output.write(fmt::format("waveform: {}\n", options.vcd));
  }
  const int exit_code = finish(output, first.violation ? kExitFailure : kExitGood);
  if (!drawn) return report(drawn.error());
  if (!first.violation && !first.stopped && first.totals.cycles == 0) return report(nothing_judged());
  return exit_code;
}

/// How it was played, beside what it has seen.
void add_account(JsonObject& json, const CampaignCommandOptions& options, unsigned jobs, const Duration& took,
                 bool stopped) {
  json.set("seed", options.seed)
      .set("jobs", jobs)
      .set("seconds", took.clock)
      .set("processor_seconds", took.processor)
      .set("stopped", stopped);
}

int failed(const CampaignCommandOptions& options, Output& output, const CampaignResult& result, unsigned jobs,
           const Duration& took) {
  const Shrunk least = shrink(*result.failed, result.violation, play, &stop_flag());
  if (options.json) {
    JsonObject json = json_of(result.totals);
    add_account(json, options, jobs, took, result.stopped);
    json.set("failure", json_of(*result.failed, result.violation))
        .set("minimal", json_of(least.setup, least.violation))
        .set("replay", result.failed->replay_command())
        .set("replay_minimal", least.setup.replay_command());
    output.write(json.text() + "\n");
    return finish(output, kExitFailure);
  }
  output.write(fmt::format("FAILED: {}: {}\n  seed {}, run {}, cycle {}, at {}\n  {}\n",
                           name(result.violation.rule), campaign::describe(result.violation),
                           result.failed->seed, result.failed->run, result.violation.cycle,
                           format_time(result.violation.time), result.failed->text()));
  output.write(fmt::format("plan:\n{}", result.failed->plan.to_text()));
  output.write(fmt::format("\nfails as well ({} runs tried), at cycle {}, with the plan:\n{}", least.tries,
                           least.violation.cycle,
                           least.setup.plan.empty() ? "(no fault)\n" : least.setup.plan.to_text()));
  output.write(fmt::format("\nagain, with a trace:\n  {}\n  {}\n", result.failed->replay_command(),
                           least.setup.replay_command()));
  return finish(output, kExitFailure);
}

}  // namespace

int run_campaign_command(const CampaignCommandOptions& options) {
  std::optional<sim::FaultPlan> plan;
  if (!options.plan.empty()) {
    auto read = plan_from(options.plan);
    if (!read) return report(read.error());
    plan = std::move(*read);
  }
  if (!options.replay.empty()) {
    const auto place = read_replay(options.replay);
    if (!place)
      return report(usage_problem("bad_replay",
                                  fmt::format("--replay {}: this is no seed and run", options.replay),
                                  "write two whole numbers, as the failure printed them: 1:42"));
    return replay(options, draw_run(place->first, place->second, options.cycles.value_or(0), plan));
  }
  if (!options.vcd.empty())
    return report(usage_problem("bad_option", "--vcd draws one run", "add --replay SEED:RUN"));

  CampaignOptions settings;
  settings.cycles = options.cycles.value_or(settings.cycles);
  settings.seed = options.seed;
  settings.jobs =
      std::clamp(options.jobs != 0 ? options.jobs : std::thread::hardware_concurrency(), 1U, kMostJobs);
  settings.plan = plan;
  settings.stop = &stop_flag();
  Duration took;
  const double processor_before = processor_seconds();
  CampaignResult result;
  {
    Progress progress(settings.cycles);
    settings.progress = [&](std::uint64_t done) { progress.show(done); };
    result = run_campaign(settings, play);
    took = {.clock = progress.seconds(), .processor = processor_seconds() - processor_before};
  }
  Output output;
  if (result.failed) return failed(options, output, result, settings.jobs, took);
  if (options.json) {
    JsonObject json = json_of(result.totals);
    add_account(json, options, settings.jobs, took, result.stopped);
    output.write(json.text() + "\n");
  } else {
    output.write(fmt::format("{}, seed {}, {} job{}\n", verdict_of(result.stopped, result.totals),
                             options.seed, settings.jobs, settings.jobs == 1 ? "" : "s"));
    show(output, result.totals, took);
  }
  const int exit_code = finish(output, kExitGood);
  return result.totals.cycles == 0 && !result.stopped ? report(nothing_judged()) : exit_code;
}

}  // namespace tm485::cli
