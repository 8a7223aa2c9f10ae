// A fault plan, as text or in a file: refused with a line, or it reads back; and whatever it does to a line, the line goes on.
#include <algorithm>
#include <chrono>
#include <string>

#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "tm485/sim/fault_plan.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::fuzz {
namespace {

/// Many inputs are looked at as text only: that goes a hundred times as fast.
constexpr unsigned kPlayedOnceIn = 16;

void play(const sim::FaultPlan& plan) {
  sim::SimOptions options;
  options.faults = plan;
  sim::SimulatedEncoder encoder(options);
  constexpr std::uint8_t kRequests[] = {0x1A, 0x02, 0x8A, 0x92};
  Time now{0};  // later, whatever has spoken before would have to be played first
  for (const std::uint8_t request : kRequests) {
    (void)encoder.port().try_send(std::span(&request, 1), now);
    std::uint8_t buffer[64];
    for (int step = 0; step < 10; ++step) {
      now += std::chrono::microseconds(50);
      (void)encoder.port().transmission(now);
      const Reception got = encoder.port().try_receive(buffer, now);
      require(got.count <= sizeof buffer, "what was received fits");
    }
  }
}

}  // namespace

int fuzz_plan(std::span<const std::uint8_t> bytes) {
  Input input(bytes);
  const bool played = input.below(kPlayedOnceIn) == 0;
  const std::string_view text = input.text();
  const auto plan = sim::FaultPlan::parse(text);
  if (!plan) {
    const sim::PlanError& error = plan.error();
    require(!error.name.empty() && !error.cause.empty() && !error.remedy.empty(), "a refusal with a remedy");
    const auto separators = std::ranges::count_if(text, [](char c) { return c == '\n' || c == ';'; });
    require(error.line <= static_cast<std::size_t>(separators) + 1, "of a line that is there");
    return 0;
  }
  require(text.size() <= sim::FaultPlan::kMostBytes && plan->lines().size() <= sim::FaultPlan::kMostLines,
          "bounded");
  const auto again = sim::FaultPlan::parse(plan->to_text());
  require(again && *again == *plan, "what was written is read again");
  if (played) play(*plan);
  return 0;
}

}  // namespace tm485::fuzz
