// What earlier campaigns called a fault of the stack, and was one of the judge: each plays what it was found with.
// (What they found in the stack itself is in the tests of its parts: bus_mixed_trust_test, bus_unsent_test, bus_trust_test,
// reset_run_test.)
#include <gtest/gtest.h>

#include "campaign/campaign.hpp"

namespace tm485::cli::campaign {
namespace {

RunResult play(const RunSetup& setup, const RunOptions& options) { return run(setup, options); }

CampaignResult campaign(const char* plan, std::uint64_t cycles) {
  CampaignOptions options;
  options.cycles = cycles;
  options.plan = *sim::FaultPlan::parse(plan);
  return run_campaign(options, play);
}

std::string story(const CampaignResult& result) {
  return !result.failed ? std::string()
                        : std::string(name(result.violation.rule)) + ": " + describe(result.violation) +
                              "\n" + result.failed->text();
}

// After 4.8 * 10^7 cycles: a frame was whole, good and taken; the character behind it came while the host was already done.
// By its length the burst was no frame, and the sample was called one of a broken frame.
TEST(Story, ACharacterBehindAWholeFrameMakesItNoBrokenOne) {
  const CampaignResult result = campaign("extra characters=2e-2 on=replies", 2'000'000);
  EXPECT_FALSE(result.failed.has_value()) << story(result);
  EXPECT_GT(result.totals.changed_and_fresh, 0u) << "it was there";
}

// After 1.5 * 10^7 cycles: a sensor froze as the shaft was slow enough to have stopped, so nobody could know; later the shaft
// passed the place at which the sensor stood, and the sample was right for a moment. From then on each was called a fault.
TEST(Story, AFrozenSensorThatTheShaftPassesAgainIsStillFrozen) {
  const CampaignResult result = campaign("frozen from=60ms for=400ms", 600'000);
  EXPECT_FALSE(result.failed.has_value()) << story(result);
  EXPECT_GT(result.totals.frozen_and_wrong, 0u);
  EXPECT_GT(result.totals.beyond, 0u);
}

}  // namespace
}  // namespace tm485::cli::campaign
