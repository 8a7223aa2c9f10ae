// tm485 reset: errors, multiturn, zero.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cli/process.hpp"
#include "cli/simulator.hpp"
#include "cli/terminal.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;

Json object(const Finished& finished) {
  EXPECT_EQ(finished.lines().size(), 1U) << finished.out << finished.err;
  return finished.lines().empty() ? Json() : Json::parse(finished.lines().at(0));
}

TEST(Reset, ErrorsLeavesThePositionAlone) {
  const Finished finished = run({"reset", "sim:start=3.25", "errors", "--yes", "--virtual", "--json"});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  const Json json = object(finished);
  EXPECT_EQ(json.at("verdict"), "verified");
  EXPECT_EQ(json.at("runs"), 1);
  EXPECT_EQ(json.at("before").at("abs"), 32768);
  EXPECT_EQ(json.at("after").at("abs"), 32768);
  EXPECT_EQ(json.at("before").at("turns"), json.at("after").at("turns"));
  EXPECT_FALSE(json.contains("new_offset"));
}

TEST(Reset, ACauseThatLastsIsNamed) {
  const Finished finished = run({"reset", "sim:almc=04", "errors", "--yes", "--virtual", "--json"});
  EXPECT_EQ(finished.exit_code, 1);
  const Json json = object(finished);
  EXPECT_EQ(json.at("verdict"), "cause_persists");
  EXPECT_FALSE(json.at("persisting").empty());
  EXPECT_NE(finished.err.find("tm485: cause_persists:"), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find(json.at("persisting").at(0).get<std::string>()), std::string::npos)
      << finished.err;
}

TEST(Reset, MultiturnSetsTheTurns) {
  const Finished finished =
      run({"reset", "sim:profile=tm485_17_battery,start=39.25", "multiturn", "--yes", "--virtual", "--json"});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  const Json json = object(finished);
  EXPECT_EQ(json.at("before").at("turns"), 40);
  EXPECT_EQ(json.at("after").at("turns"), 1);
  EXPECT_EQ(json.at("after").at("abs"), 32768);
}

TEST(Reset, ZeroShowsTheOffsets) {
  const Finished finished = run({"reset", "sim:start=0.25", "zero", "--yes-realign", "--virtual"});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_NE(finished.out.find("old 0, new 32768 counts (90.0000 deg)"), std::string::npos) << finished.out;
  EXPECT_NE(finished.out.find("done and verified"), std::string::npos) << finished.out;
  EXPECT_NE(finished.err.find("electrical alignment"), std::string::npos) << finished.err;
  const Json json = object(run({"reset", "sim:start=0.25", "zero", "--yes-realign", "--virtual", "--json"}));
  EXPECT_EQ(json.at("old_offset"), 0);
  EXPECT_EQ(json.at("new_offset"), 32768);
  EXPECT_EQ(json.at("after").at("abs"), 0);
}

TEST(Reset, ZeroIsRefusedWhileTheShaftTurns) {
  const Finished finished = run({"reset", "sim:rpm=10", "zero", "--yes-realign", "--virtual", "--json"});
  EXPECT_EQ(finished.exit_code, 1);
  const Json json = object(finished);
  EXPECT_EQ(json.at("verdict"), "refused");
  EXPECT_EQ(json.at("error"), "shaft_moves");
  EXPECT_FALSE(json.contains("after"));
  EXPECT_EQ(json.at("new_offset"), 0);
  EXPECT_NE(finished.err.find("tm485: shaft_moves:"), std::string::npos) << finished.err;
}

TEST(Reset, NothingHappensUnasked) {
  for (const Process::Arguments& arguments : {Process::Arguments{"reset", "sim:", "errors", "--virtual"},
                                              {"reset", "sim:", "multiturn", "--virtual", "--yes-realign"},
                                              {"reset", "sim:", "zero", "--virtual", "--yes"}}) {
    const Finished finished = run(arguments);
    EXPECT_EQ(finished.exit_code, 2);
    EXPECT_NE(finished.err.find("tm485: not_confirmed:"), std::string::npos) << finished.err;
  }
  EXPECT_EQ(run({"reset", "sim:", "everything"}).exit_code, 2);
  EXPECT_EQ(run({"reset", "sim:"}).exit_code, 2);
}

TEST(Reset, ZeroWantsTheWord) {
  const Process::Arguments zero{"reset", "sim:start=0.25", "zero", "--virtual", "--yes"};
  const Finished yes = run_at_terminal(zero, "(type realign)", "yes");
  EXPECT_EQ(yes.exit_code, 2);
  EXPECT_NE(yes.out.find("tm485: declined:"), std::string::npos) << yes.out;
  const Finished word = run_at_terminal(zero, "(type realign)", "realign");
  EXPECT_EQ(word.exit_code, 0) << word.out;
  EXPECT_NE(word.out.find("done and verified"), std::string::npos) << word.out;
}

TEST(Reset, OverAPseudoTerminal) {
  Simulator simulator({"--pty"});
  const Finished finished = run({"reset", simulator.port(), "errors", "--yes", "--json"});
  // The ten must be at least 62.5 us apart and nothing between them; a host that is held up does not break that.
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_EQ(object(finished).at("verdict"), "verified");
}

}  // namespace
}  // namespace tm485::test
