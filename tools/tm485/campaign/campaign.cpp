#include "campaign/campaign.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "quantity.hpp"

namespace tm485::cli::campaign {
namespace {

/// What the threads share.
struct Shared {
  std::mutex mutex;
  CampaignResult result;
  std::uint64_t next_run = 0;
  std::uint64_t given = 0;  // cycles of the runs handed out
  bool failed = false;
};

void work(const CampaignOptions& options, const Player& play, Shared& shared) {
  for (;;) {
    RunSetup setup;
    {
      const std::scoped_lock lock(shared.mutex);
      if (shared.failed || shared.result.stopped || shared.given >= options.cycles) return;
      const std::uint64_t cycles = std::min(options.run_cycles, options.cycles - shared.given);
      setup.run = shared.next_run++;
      setup.cycles = cycles;
      shared.given += cycles;
    }
    setup = draw_run(options.seed, setup.run, setup.cycles, options.plan);
    RunResult run = play(setup, {.stop = options.stop});
    const std::scoped_lock lock(shared.mutex);
    shared.result.totals.add(run.totals);
    shared.result.stopped = shared.result.stopped || run.stopped;
    if (run.violation && (!shared.result.failed || setup.run < shared.result.failed->run)) {
      shared.failed = true;
      shared.result.violation = *run.violation;
      shared.result.failed = std::move(setup);
    }
    if (options.progress) options.progress(shared.result.totals.cycles);
  }
}

/// Tries changes of a failing run and keeps those with which it still fails.
class Shrinker {
 public:
  Shrinker(Shrunk& best, const Player& play, const std::atomic<bool>* stop, unsigned most)
      : best_(&best), play_(&play), stop_(stop), most_(most), rule_(best.violation.rule) {}

  /// True if the run still breaks the rule with this set-up, which is then the best.
  bool keep_if_fails(RunSetup candidate) {
    if (best_->tries >= most_ || (stop_ != nullptr && stop_->load(std::memory_order_relaxed))) return false;
    ++best_->tries;
    const RunResult result = (*play_)(candidate, {.stop = stop_});
    if (!result.violation || result.violation->rule != rule_) return false;
    best_->setup = std::move(candidate);
    best_->violation = *result.violation;
    return true;
  }

  void shorten() {
    // A rule that is judged at the end of a run, or between two cycles, needs a few more.
    constexpr std::uint64_t kMore = 2;
    RunSetup shorter = best_->setup;
    shorter.cycles = std::min(shorter.cycles, best_->violation.cycle + kMore);
    (void)keep_if_fails(shorter);
    while (best_->setup.cycles > 16) {
      shorter = best_->setup;
      shorter.cycles /= 2;
      if (!keep_if_fails(shorter)) return;
    }
  }

  void drop_lines() {
    for (std::size_t k = best_->setup.plan.lines().size(); k > 0; --k) {
      RunSetup fewer = best_->setup;
      fewer.plan = without(best_->setup.plan, k - 1);
      (void)keep_if_fails(std::move(fewer));
    }
  }

  void narrow() {
    for (std::size_t k = 0; k < best_->setup.plan.lines().size(); ++k) {
      bound_window(k);
      while (halve(k, true)) {
      }
      while (halve(k, false)) {
      }
    }
  }

 private:
  static sim::FaultPlan without(const sim::FaultPlan& plan, std::size_t place) {
    sim::FaultPlan rest;
    for (std::size_t k = 0; k < plan.lines().size(); ++k)
      if (k != place) (void)rest.add(plan.lines()[k]);
    return rest;
  }
  bool with_line(std::size_t place, const sim::FaultLine& line) {
    RunSetup changed = best_->setup;
    changed.plan = {};
    for (std::size_t k = 0; k < best_->setup.plan.lines().size(); ++k)
      (void)changed.plan.add(k == place ? line : best_->setup.plan.lines()[k]);
    return keep_if_fails(std::move(changed));
  }
  /// A window without an end gets one: the instant of the failure.
  void bound_window(std::size_t place) {
    sim::FaultLine line = best_->setup.plan.lines()[place];
    if (line.until <= best_->violation.time || line.from >= best_->violation.time) return;
    line.until = std::chrono::ceil<std::chrono::microseconds>(best_->violation.time);
    (void)with_line(place, line);
  }
  /// Takes the first or the last half of its window away.
  bool halve(std::size_t place, bool first) {
    constexpr Time kNarrowest = std::chrono::microseconds(10);
    sim::FaultLine line = best_->setup.plan.lines()[place];
    if (line.until == kNever || line.until - line.from < kNarrowest) return false;
    // In whole microseconds: the plan is to be read.
    const Time middle =
        std::chrono::floor<std::chrono::microseconds>(line.from + (line.until - line.from) / 2);
    (first ? line.from : line.until) = middle;
    return with_line(place, line);
  }

  Shrunk* best_;
  const Player* play_;
  const std::atomic<bool>* stop_;
  unsigned most_;
  Rule rule_;
};

}  // namespace

CampaignResult run_campaign(const CampaignOptions& options, const Player& play) {
  Shared shared;
  std::vector<std::jthread> threads;
  for (unsigned k = 1; k < options.jobs; ++k) threads.emplace_back([&] { work(options, play, shared); });
  work(options, play, shared);
  threads.clear();
  return std::move(shared.result);
}

Shrunk shrink(const RunSetup& failed, const Violation& violation, const Player& play,
              const std::atomic<bool>* stop, unsigned most_tries) {
  Shrunk best{.setup = failed, .violation = violation};
  Shrinker shrinker(best, play, stop, most_tries);
  unsigned before = 0;
  do {
    before = best.tries;
    const RunSetup last = best.setup;
    shrinker.shorten();
    shrinker.drop_lines();
    shrinker.narrow();
    if (last.plan == best.setup.plan && last.cycles == best.setup.cycles) break;
  } while (best.tries != before && best.tries < most_tries);
  return best;
}

std::string describe(const Violation& violation) {
  const auto time = [](std::int64_t ns) { return format_time(Time{ns}); };
  switch (violation.rule) {
    case Rule::position:
      return fmt::format("a fresh sample is {} counts from where the shaft was, allowed are {}",
                         violation.seen, violation.allowed);
    case Rule::turns:
      return fmt::format("turns without a position are {} off, allowed are {}", violation.seen,
                         violation.allowed);
    case Rule::broken_frame:
      return "a frame that is broken by its length, CF or CRC became a fresh sample";
    case Rule::stale:
      return fmt::format("a fresh sample was latched {} after its request began, not within {}",
                         time(violation.seen), time(violation.allowed));
    case Rule::failed_and_fresh:
      return violation.seen != 0 ? "a failed cycle shows a fresh sample"
                                 : "a good cycle shows no fresh sample";
    case Rule::loss:
      return fmt::format("a sample is called fresh at an age of {}, allowed are {}", time(violation.seen),
                         time(violation.allowed));
    case Rule::recovery:
      return fmt::format("no fresh sample for {} without a fault, allowed are {}", time(violation.seen),
                         time(violation.allowed));
    case Rule::t1:
      return fmt::format("T1 was undercut by {}", time(-violation.seen));
    case Rule::statistics:
      return fmt::format("the bus counts {}, seen were {}", violation.seen, violation.allowed);
    case Rule::eeprom:
    case Rule::restart:
    case Rule::reset:
    case Rule::axis:
    case Rule::command:
      return fmt::format("{} ({}, allowed {})", violation.what, violation.seen, violation.allowed);
    case Rule::heap:
      return fmt::format("{} allocations in the cycles", violation.seen);
    case Rule::refused:
      return "the bus refuses to start";
  }
  return {};
}

}  // namespace tm485::cli::campaign
