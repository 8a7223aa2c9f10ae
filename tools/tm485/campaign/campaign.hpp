// The campaign: many runs on many threads, and what to do with the first that fails.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <optional>

#include "campaign/run.hpp"
#include "campaign/run_setup.hpp"

namespace tm485::cli::campaign {

struct CampaignOptions {
  std::uint64_t cycles = 1'000'000;
  std::uint64_t seed = 1;
  unsigned jobs = 1;
  std::optional<sim::FaultPlan> plan;  ///< instead of random ones
  std::uint64_t run_cycles = 20'000;
  const std::atomic<bool>* stop = nullptr;
  /// Called by one of the threads now and then: cycles done.
  std::function<void(std::uint64_t)> progress;
};

/// Plays one run; the tests put broken ones here.
using Player = std::function<RunResult(const RunSetup&, const RunOptions&)>;

struct CampaignResult {
  Totals totals;
  std::optional<RunSetup> failed;  ///< the failing run of the smallest number
  Violation violation;
  bool stopped = false;
};

/// Runs until so many cycles are done, or one fails. Without a failure the totals do not depend on the number of jobs.
[[nodiscard]] CampaignResult run_campaign(const CampaignOptions& options, const Player& play);

/// A smaller run that breaks the same rule: without the lines of its plan that it does not need, with narrower windows and
/// fewer cycles. `tries` bounds the runs that it may cost.
struct Shrunk {
  RunSetup setup;
  Violation violation;
  unsigned tries = 0;
};
[[nodiscard]] Shrunk shrink(const RunSetup& failed, const Violation& violation, const Player& play,
                            const std::atomic<bool>* stop, unsigned most_tries = 400);

/// One sentence: what was broken, by how much.
[[nodiscard]] std::string describe(const Violation& violation);

}  // namespace tm485::cli::campaign
