// ResetTasks: what a campaign has in the background: runs of resets, of errors, turns and zero, each held against what the
// model did. Specification: section 6.
#pragma once

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <cstdlib>
#include <optional>

#include "campaign/dice.hpp"
#include "campaign/judge.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/bus/reset_run.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::cli::campaign {

/// One owner. Nothing allocates.
class ResetTasks {
 public:
  ResetTasks(const RunSetup& setup, const CompiledProfile& profile, sim::SimulatedEncoder& encoder) noexcept
      : profile_(&profile),
        encoder_(&encoder),
        dice_(setup.seed + setup.run + 29),
        stands_(setup.motion.starts_with("motion=constant:0,")),
        alarms_(has(setup, sim::FaultKind::alarm)),
        frozen_(has(setup, sim::FaultKind::frozen)) {}

  /// After each poll. Answers when to poll and call again at the latest.
  template <class B>
  [[nodiscard]] Time drive(B& bus, Judge& judge, Time now) noexcept {
    if (!run_) {
      if (now < next_ || bus.state() != BusState::running) return std::max(next_, now + kLookAgain);
      if (!begin(now)) {
        ok_ = judge.fail(Rule::reset, now, 1, 0, "a new run of resets was refused");
        return now;
      }
    }
    if (bus.state() != BusState::running) interrupted_ = now;
    const bool held = run_->holds_cycle();
    const Time due = tm485::drive(*run_, bus, now);
    if (done() != last_done_) {
      last_done_ = done();
      counts_when_done_ = encoder_->model().shaft_counts(now);
    }
    // A look takes the line for 200 us at most, a run until the cycle goes on; this is called again within a millisecond.
    constexpr Time kOneLook{200'000};
    if (run_->holds_cycle()) {
      judge.pause(now + kLookAgain + kOneLook);
    } else if (run_->under_way()) {
      judge.pause(now + kOneLook);
    }
    if (run_->active()) return within_time(judge, now) ? due : now;
    if (held) {
      judge.end_pause(now);
      if (run_->kind() != ResetKind::errors) judge.on_new_origin();
    }
    ok_ = judged(judge, now);
    run_.reset();
    next_ = now + dice_.span(std::chrono::milliseconds(20), std::chrono::milliseconds(300));
    return now;
  }
  /// False: the judge has found a rule broken.
  [[nodiscard]] bool ok() const noexcept { return ok_; }

 private:
  [[nodiscard]] static bool has(const RunSetup& setup, sim::FaultKind kind) noexcept {
    return std::ranges::any_of(setup.plan.lines(),
                               [kind](const sim::FaultLine& line) { return line.kind == kind; });
  }
  static constexpr Time kLookAgain = std::chrono::milliseconds(1);

  [[nodiscard]] std::uint64_t done() const noexcept { return encoder_->model().statistics().resets_done; }

  [[nodiscard]] bool begin(Time now) noexcept {
    constexpr std::array kKinds{ResetKind::errors, ResetKind::multi_turn, ResetKind::zero};
    run_.emplace(*profile_);
    begun_ = now;
    done_ = done();
    return run_->start(kKinds[static_cast<std::size_t>(dice_.below(kKinds.size()))]).has_value();
  }

  /// Nothing but faults, and a start-up that the loop orders, makes a run last: the ten take less than a millisecond, zero 160 ms more.
  [[nodiscard]] bool within_time(Judge& judge, Time now) noexcept {
    constexpr Time kLongest = std::chrono::milliseconds(500);
    const Time since = now - std::max({begun_, judge.effects().last, interrupted_});
    if (since > kLongest)
      ok_ = judge.fail(Rule::reset, now, since.count(), kLongest.count(), "a run of resets does not end");
    return ok_;
  }

  [[nodiscard]] bool judged(Judge& judge, Time now) noexcept {
    const ResetOutcome& outcome = *run_->outcome();
    const auto did = static_cast<std::int64_t>(done() - done_);
    const bool verified = outcome.verdict == ResetVerdict::verified;
    ++judge.totals().resets;
    judge.totals().resets_verified += verified ? 1 : 0;
    if (did > outcome.runs)
      return judge.fail(Rule::reset, now, did, outcome.runs, "more was reset than was asked for");
    if ((verified || outcome.verdict == ResetVerdict::cause_persists) && did == 0)
      return judge.fail(Rule::reset, now, 0, 1, "a reset was said to be done that was not");
    // A sensor that stands still has its own idea of where the shaft was when it was reset.
    const bool known = !frozen_ || judge.effects().last < begun_;
    if (verified && known && !at_new_origin(now))
      return judge.fail(Rule::reset, now, encoder_->model().shaft_counts(now), 0,
                        "a reset was said to be verified, and the position is not at its origin");
    if (judge.effects().last >= begun_) return true;
    const bool refused = outcome.kind == ResetKind::zero && !stands_;
    const bool persists = outcome.verdict == ResetVerdict::cause_persists && alarms_;
    return refused || persists || verified ||
           judge.fail(Rule::reset, now, static_cast<std::int64_t>(outcome.verdict), 0,
                      "a run of resets failed on a line without a fault");
  }

  /// Turns: in the first ones when it was done; the shaft turns on while noise puts off the read-back. Zero: within the tolerance that the run has itself.
  [[nodiscard]] bool at_new_origin(Time now) const noexcept {
    const unsigned bits = profile_->profile().single_turn_bits;
    const std::int64_t turn = std::int64_t{1} << bits;
    const std::int64_t counts = encoder_->model().shaft_counts(now);
    if (run_->kind() == ResetKind::multi_turn) return std::abs(counts_when_done_) < 3 * turn;
    if (run_->kind() != ResetKind::zero) return true;
    const std::int64_t within = ((counts % turn) + turn) % turn;
    constexpr std::int64_t kPartOfTurn = 4'096;
    return std::min(within, turn - within) <= turn / kPartOfTurn;
  }

  const CompiledProfile* profile_;
  sim::SimulatedEncoder* encoder_;
  Dice dice_;
  bool stands_;  // the shaft, so that a zero reset can be done
  bool alarms_;  // are in the plan
  bool frozen_;  // likewise
  std::optional<ResetRun> run_;
  std::uint64_t done_ = 0;  // when it began
  std::uint64_t last_done_ = 0;
  std::int64_t counts_when_done_ = 0;  // of the shaft, behind the last one; it turns on
  Time begun_{0};
  Time interrupted_{0};  // when last seen in a start-up
  Time next_ = std::chrono::milliseconds(100);
  bool ok_ = true;
};

}  // namespace tm485::cli::campaign
