// The campaign itself: the stack as it is breaks no rule, each broken one is found out, and a failure can be made small and
// played again.
#include "campaign/campaign.hpp"

#include <gtest/gtest.h>

#include <cinttypes>
#include <cstdio>
#include <string>

#include "broken_ports.hpp"
#include "heap_count.hpp"
#include "support/mostly_turns.hpp"

namespace tm485::cli::campaign {
namespace {

using test::TwinPort;

RunResult as_it_is(const RunSetup& setup, RunOptions options) {
  options.allocations = heap_allocations;
  return run(setup, options);
}

template <class Broken>
RunResult with(const RunSetup& setup, RunOptions options) {
  options.allocations = heap_allocations;
  return run<EepromDiscipline>(setup, options, [](sim::SimPort& port) { return Broken(port); });
}

CampaignResult campaign(const Player& play, const char* plan = nullptr, std::uint64_t cycles = 400'000,
                        std::uint64_t seed = 1, unsigned jobs = 1) {
  CampaignOptions options;
  options.cycles = cycles;
  options.seed = seed;
  options.jobs = jobs;
  if (plan != nullptr) options.plan = *sim::FaultPlan::parse(plan);
  return run_campaign(options, play);
}

std::string story(const CampaignResult& result) {
  if (!result.failed) return {};
  return std::string(name(result.violation.rule)) + ": " + describe(result.violation) + "\nseed " +
         std::to_string(result.failed->seed) + ", run " + std::to_string(result.failed->run) + ", cycle " +
         std::to_string(result.violation.cycle) + "\n" + result.failed->text() + "\n" +
         result.failed->plan.to_text();
}

TEST(Campaign, TheStackBreaksNoRule) {
  const CampaignResult result = campaign(as_it_is);
  EXPECT_FALSE(result.failed.has_value()) << story(result);
  EXPECT_GE(result.totals.cycles, 380'000u) << "fewer where the encoder is off, or has the line to itself";
  EXPECT_EQ(result.totals.good + result.totals.failed, result.totals.cycles);
  EXPECT_GT(result.totals.failed, 100u) << "the faults do something";
  EXPECT_GT(result.totals.startups, result.totals.runs);
  EXPECT_GE(result.totals.smallest_t1_margin, Time{0});
  EXPECT_GT(result.totals.eeprom_judged, 50u);
  // Each kind of run is among them.
  EXPECT_GT(result.totals.eeprom_writes, 0u);
  EXPECT_GT(result.totals.resets_verified, 0u);
  EXPECT_GT(result.totals.axis_runs, 0u);
  EXPECT_GT(result.totals.mixed_runs, 0u);
  EXPECT_GT(result.totals.slow_runs, 0u);
  EXPECT_GT(result.totals.loop_reads, 10'000u);
  EXPECT_GT(result.totals.resumed, 0u);
  EXPECT_GT(result.totals.estimates, 0u);
}

TEST(Campaign, AHealthyLineLosesNothing) {
  const CampaignResult result = campaign(as_it_is, "", 100'000);
  EXPECT_FALSE(result.failed.has_value()) << story(result);
  // A run of resets has the line for 6 ms, over which ABS alone loses its turns: that costs a cycle and a start-up.
  EXPECT_LE(result.totals.failed, result.totals.resets);
  EXPECT_EQ(result.totals.resets_verified, result.totals.resets);
  EXPECT_EQ(result.totals.touched, 0u);
}

TEST(Campaign, TheTotalsDoNotDependOnTheJobs) {
  const Totals one = campaign(as_it_is, nullptr, 200'000, 5, 1).totals;
  const Totals three = campaign(as_it_is, nullptr, 200'000, 5, 3).totals;
  EXPECT_EQ(one.cycles, three.cycles);
  EXPECT_EQ(one.good, three.good);
  EXPECT_EQ(one.changed, three.changed);
  EXPECT_EQ(one.startups, three.startups);
  EXPECT_EQ(one.longest_recovery, three.longest_recovery);
}

// tests/campaign_no_gate plays the same without the check, and finds turns that are not the encoder's.
TEST(Campaign, TurnsOfANoisyLineAreTheEncoders) {
  for (std::uint64_t k = 0; k < 20; ++k) {
    const RunResult result = run(test::mostly_turns(k));
    EXPECT_FALSE(result.violation.has_value()) << k << ' ' << describe(*result.violation);
    EXPECT_GT(result.totals.changed, 100U);
  }
}

TEST(BrokenStack, WithoutACrcCheck) {
  const CampaignResult result = campaign(with<test::NoCrcCheck>, "bits replies=1e-4");
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::broken_frame) << story(result);
}

TEST(BrokenStack, WithoutACheckOfCf) {
  const CampaignResult result = campaign(with<test::NoCfCheck>, "wrong-cf p=1e-3");
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::broken_frame) << story(result);
}

TEST(BrokenStack, WithoutSelectingThePageAgain) {
  const Player play = [](const RunSetup& setup, const RunOptions& options) {
    return run<test::NeverLooksAtThePage>(setup, options);
  };
  const CampaignResult result = campaign(play, "restart at=100ms every=200ms");
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::eeprom) << story(result);
  EXPECT_FALSE(campaign(as_it_is, "restart at=100ms every=200ms").failed.has_value());
}

TEST(BrokenStack, WithoutReadingBackWhatWasWritten) {
  const Player play = [](const RunSetup& setup, const RunOptions& options) {
    return run<test::NeverLooksAtWhatItWrote>(setup, options);
  };
  constexpr const char* kNoise = "bits requests=1e-2";
  const CampaignResult result = campaign(play, kNoise, 4'000'000);
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::eeprom) << story(result);
  EXPECT_FALSE(campaign(as_it_is, kNoise, 1'000'000).failed.has_value());
}

TEST(BrokenStack, WithoutTimeouts) {
  const CampaignResult result = campaign(with<test::NoTimeout>, "lose replies=1e-3");
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::recovery) << story(result);
}

TEST(BrokenStack, WithALateTimeout) {
  const CampaignResult result = campaign(with<test::LateTimeout>, "lose replies=1e-3");
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::loss) << story(result);
}

TEST(BrokenStack, WithAShortT1) {
  const CampaignResult result = campaign([](const RunSetup& setup, const RunOptions& options) {
    RunSetup shortest = setup;
    shortest.pattern = Cycle{shortest.pattern.step(0).id};
    return run<EepromDiscipline>(shortest, options, AsItIs{}, test::shorten_t1);
  });
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::t1) << story(result);
}

TEST(BrokenStack, ThatNeverThinksOfARestart) {
  const CampaignResult result = campaign(
      [](const RunSetup& setup, const RunOptions& options) {
        RunSetup alone = setup;  // what is in the background notices by itself
        alone.background = Background::none;
        return run<EepromDiscipline>(alone, options, AsItIs{}, test::never_think_of_a_restart);
      },
      "restart at=20ms off=2ms every=150ms");
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::restart) << story(result);
}

TEST(BrokenStack, ThatRepeatsTheLastReply) {
  const CampaignResult result = campaign(with<test::RepeatsTheLastReply>, "lose replies=1e-3");
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::broken_frame) << story(result);
}

TEST(BrokenStack, WithWrongTimestamps) {
  const CampaignResult result = campaign(with<test::WrongTimestamps>, "");
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::position) << story(result);
}

TEST(BrokenStack, WhoseRequestsAreLateByMoreThanItSays) {
  const CampaignResult result = campaign(with<test::StartsLate>, "", 4'000'000);
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::axis) << story(result);
  EXPECT_EQ(result.violation.what, "latched out of phase with the servo clock");
}

TEST(BrokenStack, WhoseEstimatorIsSlow) {
  const CampaignResult result = campaign(
      [](const RunSetup& setup, const RunOptions& options) {
        RunSetup slow = setup;
        if (slow.bandwidth != 0.0) slow.bandwidth = 1.0 / 2'000.0;
        return run(slow, options);
      },
      "", 4'000'000);
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::axis) << story(result);
  EXPECT_EQ(result.violation.what, "the shaft is not where the estimate says");
}

TEST(BrokenStack, ThatUsesTheHeap) {
  const CampaignResult result = campaign(with<test::UsesTheHeap>, "");
  ASSERT_TRUE(result.failed.has_value());
  EXPECT_EQ(result.violation.rule, Rule::heap) << story(result);
}

// As it is found: by random plans, not by one that was written for it.
TEST(BrokenStack, IsFoundByRandomPlansMadeSmallAndPlayedAgain) {
  const Player play = with<test::NoCrcCheck>;
  const CampaignResult result = campaign(play, nullptr, 4'000'000);
  ASSERT_TRUE(result.failed.has_value());
  const RunSetup again =
      draw_run(result.failed->seed, result.failed->run, result.failed->cycles, std::nullopt);
  EXPECT_EQ(again.plan, result.failed->plan);
  const RunResult replayed = play(again, {});
  ASSERT_TRUE(replayed.violation.has_value());
  EXPECT_EQ(replayed.violation->cycle, result.violation.cycle);
  EXPECT_EQ(replayed.violation->time, result.violation.time);

  const Shrunk least = shrink(*result.failed, result.violation, play, nullptr);
  EXPECT_EQ(least.violation.rule, result.violation.rule);
  EXPECT_EQ(least.setup.plan.lines().size(), 1u) << least.setup.plan.to_text();
  EXPECT_LE(least.setup.cycles, result.violation.cycle + 2);
  // What was printed is enough: the plan through its text.
  const auto plan = sim::FaultPlan::parse(least.setup.plan.to_text());
  ASSERT_TRUE(plan.has_value());
  const RunSetup printed = draw_run(least.setup.seed, least.setup.run, least.setup.cycles, *plan);
  const RunResult minimal = play(printed, {});
  ASSERT_TRUE(minimal.violation.has_value());
  EXPECT_EQ(minimal.violation->cycle, least.violation.cycle);
}

// What a failure prints repeats it, also if its plan is none of those that are drawn.
TEST(Campaign, APlanThatWasGivenIsPartOfTheCommandThatPlaysItAgain) {
  const Player play = with<test::NoTimeout>;
  const CampaignResult result = campaign(play, "lose replies=1e-3; bits replies=1e-5", 9'000);
  ASSERT_TRUE(result.failed.has_value());
  const std::string command = result.failed->replay_command();
  std::uint64_t seed = 0;
  std::uint64_t number = 0;
  std::uint64_t cycles = 0;
  ASSERT_EQ(std::sscanf(command.c_str(), "tm485 campaign --replay %" SCNu64 ":%" SCNu64 " --cycles %" SCNu64,
                        &seed, &number, &cycles),
            3)
      << command;
  const std::size_t from = command.find("--plan '") + 8;
  const auto plan = sim::FaultPlan::parse(command.substr(from, command.rfind('\'') - from));
  ASSERT_TRUE(plan.has_value()) << command;
  const RunResult again = play(draw_run(seed, number, cycles, *plan), {});
  ASSERT_TRUE(again.violation.has_value()) << command;
  EXPECT_EQ(again.violation->cycle, result.violation.cycle);
  EXPECT_EQ(again.violation->time, result.violation.time);
}

TEST(Recorder, WritesATableAndAWaveform) {
  RunSetup setup = draw_run(1, 0, 60, *sim::FaultPlan::parse("lose replies=1 from=58ms for=500us"));
  setup.pattern = Cycle{DataId::everything, setup.pattern.slot()};
  Recorder recorder(5);
  const RunResult result = run(setup, {.recorder = &recorder});
  EXPECT_FALSE(result.violation.has_value());
  const std::string table = recorder.table();
  EXPECT_NE(table.find(" timeout "), std::string::npos) << table;
  EXPECT_NE(table.find(" held "), std::string::npos);
  EXPECT_NE(table.find("changed"), std::string::npos);

  const std::string vcd = recorder.vcd();
  EXPECT_TRUE(vcd.starts_with("$comment"));
  for (const char* signal : {" line ", " de ", " request ", " reply ", " valid ", " quality ", " position "})
    EXPECT_NE(vcd.find(signal), std::string::npos) << signal;
  std::size_t instants = 0;
  long long last = -1;
  for (std::size_t at = vcd.find("\n#"); at != std::string::npos; at = vcd.find("\n#", at + 1)) {
    const long long time = std::stoll(vcd.substr(at + 2));
    EXPECT_GT(time, last) << "instants rise";
    last = time;
    ++instants;
  }
  EXPECT_GT(instants, 25u * 12u * 5u);
}

}  // namespace
}  // namespace tm485::cli::campaign
