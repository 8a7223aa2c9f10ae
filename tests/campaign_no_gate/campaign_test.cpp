// The campaign aimed at a stack whose plausibility gate is open (open_gate.cpp): it fails at once.
#include "campaign/campaign.hpp"

#include <gtest/gtest.h>

#include "support/mostly_turns.hpp"

namespace tm485::cli::campaign {
namespace {

RunResult play(const RunSetup& setup, const RunOptions& options) { return run(setup, options); }

TEST(WithoutTheGate, AWrongPositionIsFound) {
  CampaignOptions options;
  options.cycles = 4'000'000;
  const CampaignResult random = run_campaign(options, play);
  ASSERT_TRUE(random.failed.has_value());
  EXPECT_EQ(random.violation.rule, Rule::position) << describe(random.violation);

  options.plan = *sim::FaultPlan::parse("bits replies=1e-3");
  const CampaignResult noise = run_campaign(options, play);
  ASSERT_TRUE(noise.failed.has_value());
  EXPECT_EQ(noise.violation.rule, Rule::position) << describe(noise.violation);
  EXPECT_LT(noise.totals.cycles, 200'000u);
}

TEST(WithoutTheGate, WrongTurnsAreFound) {
  unsigned found = 0;
  for (std::uint64_t k = 0; k < 20; ++k) {
    const RunResult result = play(test::mostly_turns(k), {});
    found += result.violation && result.violation->rule == Rule::turns ? 1U : 0U;
  }
  EXPECT_GT(found, 5U);
}

// And not for another reason.
TEST(WithoutTheGate, AHealthyLineIsHealthy) {
  CampaignOptions options;
  options.cycles = 100'000;
  options.plan = sim::FaultPlan{};
  const CampaignResult result = run_campaign(options, play);
  EXPECT_FALSE(result.failed.has_value()) << describe(result.violation);
}

}  // namespace
}  // namespace tm485::cli::campaign
