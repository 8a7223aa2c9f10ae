#include "usage_campaign.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdint>
#include <string>

#include "usage_checks.hpp"

namespace tm485::cli {

namespace {

constexpr std::uint64_t kMostCycles = 1'000'000'000'000'000;

/// "2e8" as people write it: as digits. Whatever is no whole number stays, and is refused as it was typed.
CLI::Validator plain_number() {
  return {[](std::string& text) {
            double value = 0;
            const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
            const bool whole = error == std::errc{} && end == text.data() + text.size() && value >= 0 &&
                               value < 1e18 && value == std::floor(value);
            if (whole && text.find_first_of("eE") != std::string::npos) text = fmt::format("{:.0f}", value);
            return std::string();
          },
          std::string()};
}

}  // namespace

void add_campaign(CLI::App& root, CampaignCommandOptions& options) {
  CLI::App& app = *root.add_subcommand(
      "campaign",
      "The whole stack in virtual time against the encoder model, with random faults, every cycle judged");
  app.add_option("--cycles", options.cycles, "How many in all (1000000); with --replay: of the one run")
      ->transform(plain_number())
      ->check(CLI::Range(std::uint64_t{1}, kMostCycles));
  CLI::Option* seed = app.add_option("--seed", options.seed, "The same seed does the same again")
                          ->check(seed_number)
                          ->capture_default_str();
  app.add_option("--plan", options.plan, "A fault plan, as text or FILE, instead of random ones")
      ->check([](const std::string& text) {
        return text.empty() ? "it is empty; '#' is a plan without a fault" : "";
      });
  app.add_option("--jobs", options.jobs, "Threads; default: one for each processor")
      ->check(CLI::Range(1, 256));
  app.add_option("--replay", options.replay, "SEED:RUN of a failure: this run again, with a trace")
      ->check(not_empty)
      ->excludes(seed);
  app.add_option("--vcd", options.vcd, "With --replay: a new FILE for the waveform around the failing cycle")
      ->check(not_empty);
  app.add_flag("--json", options.json, "One JSON object");
  app.footer(
      "Each run has an encoder, a cycle, a movement and a fault plan of its own, drawn from the seed. Judged "
      "on every "
      "cycle:\n"
      "positions, T1, staleness, detection of loss, recovery, statistics. A failure prints the rule, seed, "
      "run and "
      "cycle, and\n"
      "a plan that is as small as possible. Exit code 1 if a rule was broken, or if no cycle could be "
      "judged. docs/fault-plans.md has the "
      "faults.\n"
      "Examples:\n"
      "  tm485 campaign --cycles 1e8\n"
      "  tm485 campaign --plan 'bits replies=1e-4; restart at=100ms' --seed 7\n"
      "  tm485 campaign --replay 1:42 --vcd failure.vcd");
}

}  // namespace tm485::cli
