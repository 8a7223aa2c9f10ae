// Fault plans as text: what is taken, what is refused and how, and that what is written reads back.
#include "tm485/sim/fault_plan.hpp"

#include <gtest/gtest.h>

#include <string>

#include "ask.hpp"
#include "tm485/sim/random.hpp"
#include "tm485/sim/sim_options.hpp"

namespace tm485::sim {
namespace {

FaultPlan plan_of(std::string_view text) {
  const auto plan = FaultPlan::parse(text);
  EXPECT_TRUE(plan.has_value()) << text << ": " << (plan ? "" : plan.error().text());
  return plan.value_or(FaultPlan{});
}

PlanError error_of(std::string_view text) {
  const auto plan = FaultPlan::parse(text);
  EXPECT_FALSE(plan.has_value()) << text;
  return plan ? PlanError{} : plan.error();
}

TEST(FaultPlan, NothingIsAPlanWithoutFaults) {
  EXPECT_TRUE(plan_of("").empty());
  EXPECT_TRUE(plan_of("  # a comment\n\n ; ;\r\n").empty());
}

TEST(FaultPlan, UnitsAsPeopleWriteThem) {
  const FaultPlan plan = plan_of(
      "# the whole of it\n"
      "bits requests=1e-5 replies=1e-4   # noise\n"
      "late bytes=30us p=0.5; t2 8\u00B5s every=10ms\n"
      "baud drift=+300ppm/s max=2%\n"
      "alarm almc=04 at=1.5s for=250ms\n"
      "stuck column=3 value=1 cycles=100..120 seed=7\n");
  ASSERT_EQ(plan.lines().size(), 6u);
  EXPECT_EQ(plan.lines()[0].kind, FaultKind::bits);
  EXPECT_DOUBLE_EQ(plan.lines()[0].values[1], 1e-4);
  EXPECT_DOUBLE_EQ(plan.lines()[1].values[0], 30'000.0);
  EXPECT_DOUBLE_EQ(plan.lines()[1].probability, 0.5);
  EXPECT_DOUBLE_EQ(plan.lines()[2].values[0], 8'000.0);
  EXPECT_EQ(plan.lines()[2].every, ms(10));
  EXPECT_DOUBLE_EQ(plan.lines()[3].values[0], 300e-6);
  EXPECT_DOUBLE_EQ(plan.lines()[3].values[2], 0.02);
  EXPECT_DOUBLE_EQ(plan.lines()[4].values[0], 4.0);
  EXPECT_EQ(plan.lines()[4].from, ms(1'500));
  EXPECT_EQ(plan.lines()[4].until, ms(1'750));
  EXPECT_EQ(plan.lines()[5].first_cycle, 100u);
  EXPECT_EQ(plan.lines()[5].last_cycle, 120u);
  EXPECT_EQ(plan.lines()[5].seed, 7u);
}

TEST(FaultPlan, EveryMistakeHasANameALineACauseAndARemedy) {
  const struct {
    const char* text;
    const char* name;
    std::size_t line;
    const char* says;
  } kCases[] = {
      {"bits\n\nbitz replies=1", "plan_unknown_fault", 3, "bitz"},
      {"lose sometimes=1", "plan_unknown_key", 1, "sometimes"},
      {"lose replies", "plan_unknown_key", 1, "replies"},
      {"bits p=0.5", "plan_unknown_key", 1, "p"},
      {"lose replies=1 replies=1", "plan_unknown_key", 1, "twice"},
      {"lose replies=1.1", "plan_bad_value", 1, "1.1"},
      {"lose replies=-0.1", "plan_bad_value", 1, "-0.1"},
      {"lose replies=nan", "plan_bad_value", 1, "nan"},
      {"stuck column=8 value=0", "plan_bad_value", 1, "column=8"},
      {"burst bits=1.5", "plan_bad_value", 1, "bits=1.5"},
      {"t2 8", "plan_bad_value", 1, "8"},
      {"t2 2s", "plan_bad_value", 1, "1ms"},
      {"t2 3us p=2", "plan_bad_value", 1, "p=2"},
      {"late bytes=1us every=0s", "plan_bad_value", 1, "every=0s"},
      {"alarm almc=100", "plan_bad_value", 1, "almc=100"},
      {"baud drift=3ppm", "plan_bad_value", 1, "drift=3ppm"},
      {"baud drift=3ppm", "plan_bad_value", 1, "-20%/s to 20%/s"},
      {"burst bits=1 on=left", "plan_bad_value", 1, "on=left"},
      {"lose from=-1s", "plan_bad_value", 1, "from=-1s"},
      {"lose from=9999h", "plan_bad_value", 1, "from=9999h"},
      {"lose cycles=5..x", "plan_bad_value", 1, "cycles=5..x"},
      {"lose seed=-1", "plan_bad_value", 1, "seed=-1"},
      {"stuck column=1", "plan_missing_value", 1, "value"},
      {"burst", "plan_missing_value", 1, "bits"},
      {"lose until=1s from=1s", "plan_bad_window", 1, "ends"},
      {"lose cycles=9..8", "plan_bad_window", 1, "ends"},
      {"lose until=1s for=1s", "plan_bad_window", 1, "until="},
      {"lose =1", "plan_unknown_key", 1, "takes no"},
  };
  for (const auto& c : kCases) {
    const PlanError error = error_of(c.text);
    EXPECT_EQ(error.name, c.name) << c.text;
    EXPECT_EQ(error.line, c.line) << c.text;
    EXPECT_NE(error.text().find(c.says), std::string::npos) << c.text << ": " << error.text();
    EXPECT_FALSE(error.remedy.empty()) << c.text;
  }
}

TEST(FaultPlan, SizeAndNumberAreBounded) {
  std::string text;
  for (std::size_t k = 0; k < FaultPlan::kMostLines; ++k) text += "echo\n";
  EXPECT_EQ(plan_of(text).lines().size(), FaultPlan::kMostLines);
  EXPECT_EQ(error_of(text + "echo").name, "plan_too_large");
  const std::string blanks(FaultPlan::kMostBytes, ' ');
  EXPECT_TRUE(plan_of(blanks).empty());
  EXPECT_EQ(error_of(blanks + ' ').name, "plan_too_large");
  EXPECT_LT(error_of(std::string(10'000, 'x')).text().size(), 1'000u) << "a message does not repeat it all";
}

TEST(FaultPlan, EveryKindReadsBackWhatItWrites) {
  for (const FaultInfo& info : fault_kinds()) {
    FaultLine line;
    line.kind = info.kind;
    for (std::size_t k = 0; k < info.parameters.size(); ++k) {
      const FaultParameter& row = info.parameters[k];
      if (row.name.empty()) continue;
      const bool whole = row.unit != FaultUnit::probability && row.unit != FaultUnit::ratio &&
                         row.unit != FaultUnit::ratio_rate;
      line.values[k] = whole ? row.high : row.high / 7.0;
    }
    line.from = Time{1};
    line.until = Time{1'234'567'890'123};
    line.first_cycle = 17;
    if (info.by_chance) {
      line.probability = 1.0 / 3.0;
      line.every = us(62) + Time{500};
    }
    line.seed = UINT64_MAX;
    const std::string text = FaultPlan::to_text(line);
    const FaultPlan plan = plan_of(text);
    ASSERT_EQ(plan.lines().size(), 1u) << text;
    EXPECT_EQ(plan.lines()[0], line) << text << '\n' << plan.to_text();
    EXPECT_EQ(plan_of(plan.to_text()), plan);
  }
}

// Found by a fuzzer: -1.11155 % is no number of ppm that becomes the same when it is read.
TEST(FaultPlan, EveryRatioThatCanBeWrittenReadsBackTheSame) {
  Random random{12};
  for (int k = -1; k < 100'000; ++k) {
    const std::int64_t digits = random.below(10'000'000);
    const char* const unit = random.below(2) == 0 ? "%" : "ppm";
    const std::string number =
        (random.below(2) == 0 ? "-" : "") + std::to_string(digits % 20) + "." + std::to_string(digits / 20);
    const FaultPlan plan = plan_of(k < 0 ? "baud drift=-1.11155%/s"
                                         : "baud drift=" + number + unit + "/s offset=" + number + unit);
    ASSERT_EQ(plan_of(plan.to_text()), plan) << number << unit << ' ' << plan.to_text();
  }
}

// A lost character more or less must not crash it; what is taken must read back.
TEST(FaultPlan, AnyTextIsRefusedOrReadsBack) {
  Random random{11};
  const std::string_view good =
      "bits replies=1e-4 from=1s; t2 8us p=0.5 every=1ms cycles=3..9\nbaud drift=-2%/s seed=4";
  unsigned taken = 0;
  for (int k = 0; k < 20'000; ++k) {
    std::string text(good);
    for (auto edits = 1 + random.below(4); edits > 0; --edits) {
      const auto at = static_cast<std::size_t>(random.below(static_cast<std::int64_t>(text.size())));
      switch (random.below(3)) {
        case 0:
          text.erase(at, 1 + static_cast<std::size_t>(random.below(6)));
          break;
        case 1:
          text[at] = static_cast<char>(random.below(256));
          break;
        default:
          text.insert(at, 1, "=.e;#\n -0"[random.below(9)]);
          break;
      }
      if (text.empty()) break;
    }
    const auto plan = FaultPlan::parse(text);
    if (!plan) continue;
    ++taken;
    const auto again = FaultPlan::parse(plan->to_text());
    ASSERT_TRUE(again.has_value()) << text << '\n' << plan->to_text();
    EXPECT_EQ(*again, *plan) << text;
  }
  EXPECT_GT(taken, 200u);
}

TEST(FaultPlan, IsPartOfTheSetUpAndItsTextToo) {
  const auto options = parse_sim_options("ber=0.1,lost=0.2,seed=5,plan=echo from=1s; t2 8us");
  ASSERT_TRUE(options.has_value()) << options.error();
  const FaultPlan plan = fault_plan_of(*options);
  ASSERT_EQ(plan.lines().size(), 4u);
  EXPECT_EQ(plan.lines()[0].kind, FaultKind::bits);
  EXPECT_EQ(plan.lines()[1].kind, FaultKind::lose);
  EXPECT_EQ(plan.lines()[2].kind, FaultKind::echo);
  EXPECT_EQ(plan.lines()[3].kind, FaultKind::t2);
  const auto refused = parse_sim_options("plan=nothing");
  ASSERT_FALSE(refused.has_value());
  EXPECT_NE(refused.error().find("no fault is called 'nothing'"), std::string::npos);
}

}  // namespace
}  // namespace tm485::sim
