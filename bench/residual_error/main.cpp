// Residual error: how many samples with a wrong position get through, by CRC alone, by strict parsing, and by the whole
// receiving side of core, from bytes to the sample of the bus. docs/safety.md has the result.
//
//   tm485_residual_error [--frames N] [--seed S] [--jobs J] [--line NAME] [--period US]
//                        [--uncertainty US] [--json]
//
// --period: default 62.5. --uncertainty: by how much the latch is off at most, as the profile says too; default 0.5.
// --frames: ID3 frames on each line as they come (default 10^7); N / 4 more with a pattern that CRC and strict parsing let
// pass put into about one of 64, and N / 4 with one behind each restart. The weight of those: how often the
// line makes such a pattern, by a closed form for independent bits, by counting for bursts. 95 % bounds: Clopper-Pearson.
#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <future>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "judge.hpp"
#include "report.hpp"
#include "run.hpp"
#include "shaft.hpp"

namespace {

using namespace residual;

struct Options {
  std::uint64_t frames = 10'000'000;
  std::uint64_t seed = 1;
  unsigned jobs = 1;
  std::string line;
  std::int64_t period_ns = 62'500;
  std::int64_t uncertainty_ns = 500;
  bool json = false;
};

/// The frames of a plan, shared out among threads, each with a seed of its own.
Counts run_all(Plan plan, unsigned jobs, std::uint64_t& seed) {
  std::vector<std::future<Counts>> parts;
  plan.frames = std::max<std::uint64_t>(plan.frames / jobs, 1'000);
  for (unsigned i = 0; i < jobs; ++i) {
    plan.seed = seed++;
    parts.push_back(std::async(std::launch::async, run, plan));
  }
  Counts counts;
  for (auto& part : parts) counts.add(part.get());
  return counts;
}

bool parse(int argc, char** argv, Options& options) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view name = argv[i];
    if (name == "--json") {
      options.json = true;
      continue;
    }
    if (i + 1 == argc) return false;
    const char* const value = argv[++i];
    if (name == "--line") {
      options.line = value;
      continue;
    }
    const double number = std::strtod(value, nullptr);  // 1e9 is a number of frames as well
    if (!(number >= 0) || number > 1e13) return false;
    if (name == "--frames" && number >= 1'000) {
      options.frames = static_cast<std::uint64_t>(number);
    } else if (name == "--seed") {
      options.seed = static_cast<std::uint64_t>(number);
    } else if (name == "--period" && number >= 62.5 && number <= 4'000) {
      options.period_ns = static_cast<std::int64_t>(number * 1'000);
    } else if (name == "--uncertainty" && number <= 1'000) {
      options.uncertainty_ns = static_cast<std::int64_t>(number * 1'000);
    } else if (name == "--jobs" && number >= 1 && number <= 256) {
      options.jobs = static_cast<unsigned>(number);
    } else {
      return false;
    }
  }
  return true;
}

}  // namespace

int main(int argc, char** argv) {
  Options options;
  if (!parse(argc, argv, options)) {
    std::fputs(
        "usage: tm485_residual_error [--frames N] [--seed S] [--jobs J] [--line NAME] [--period US] "
        "[--uncertainty US] [--json]\n",
        stderr);
    return 2;
  }
  constexpr std::array<NamedLine, 6> kLines{{
      {"1e-5", {.bit_error_rate = 1e-5}},
      {"1e-4", {.bit_error_rate = 1e-4}},
      {"1e-3", {.bit_error_rate = 1e-3}},
      {"1e-2", {.bit_error_rate = 1e-2}},
      {"burst16", {.burst_rate = 1e-3, .burst_bits = 16}},
      {"burst32", {.burst_rate = 1e-3, .burst_bits = 32}},
  }};
  std::uint64_t seed = options.seed * 1'000'000;
  const std::uint64_t patterns = std::min<std::uint64_t>(options.frames / 10, 4'000'000);
  std::vector<Result> results;
  for (const NamedLine& line : kLines) {
    if (!options.line.empty() && options.line != line.name) continue;
    Result result;
    result.line = line;
    result.patterns = count_patterns(line.line, patterns, seed++);
    Plan plan;
    plan.line = line.line;
    plan.frames = options.frames;
    plan.period_ns = options.period_ns;
    plan.uncertainty_ns = options.uncertainty_ns;
    result.natural = run_all(plan, options.jobs, seed);
    plan.frames = options.frames / 4;
    plan.pool = result.patterns.strict.bursts;
    plan.forced = Forced::steady;
    result.steady = run_all(plan, options.jobs, seed);
    plan.forced = Forced::start_up;
    result.start_up = run_all(plan, options.jobs, seed);
    results.push_back(std::move(result));
  }
  if (results.empty()) {
    std::fprintf(stderr, "no line %s\n", options.line.c_str());
    return 2;
  }
  // A clean line, frames missing one at a time: nothing may be held back.
  Plan missing;
  missing.frames = options.frames / 4;
  missing.missing = 0.1;
  missing.period_ns = options.period_ns;
  missing.uncertainty_ns = options.uncertainty_ns;
  const Counts clean = run_all(missing, options.jobs, seed);
  if (options.json)
    print_json(results, clean);
  else
    print_table(results, clean);
  return sound(results, clean) ? 0 : 1;
}
