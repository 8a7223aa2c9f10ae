// tm485 campaign as it is typed.
#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "cli/process.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;
namespace fs = std::filesystem;

class CampaignCommand : public testing::Test {
 protected:
  void SetUp() override {
    std::string name = (fs::temp_directory_path() / "tm485-campaign-XXXXXX").string();
    folder_ = ::mkdtemp(name.data());
  }
  void TearDown() override { fs::remove_all(folder_); }
  fs::path folder_;
};

TEST_F(CampaignCommand, SaysWhatItHasSeen) {
  const Finished text = run({"campaign", "--cycles", "100000", "--jobs", "1"});
  EXPECT_EQ(text.exit_code, 0) << text.out << text.err;
  EXPECT_NE(text.out.find("no rule is broken"), std::string::npos);
  const Finished once = run({"campaign", "--cycles", "1e5", "--jobs", "2", "--json"});
  const Finished again = run({"campaign", "--cycles", "100000", "--jobs", "1", "--json"});
  ASSERT_EQ(once.exit_code, 0) << once.err;
  Json first = Json::parse(once.out);
  Json second = Json::parse(again.out);
  EXPECT_EQ(first.at("cycles").get<int>(), first.at("good").get<int>() + first.at("failed").get<int>());
  for (const char* machine : {"seconds", "processor_seconds", "jobs"}) {
    first.erase(machine);
    second.erase(machine);
  }
  EXPECT_EQ(first, second);
}

TEST_F(CampaignCommand, TakesAPlanAsTextOrFile) {
  const fs::path file = folder_ / "plan";
  std::ofstream(file) << "# the cable\nlose replies=1 cycles=400..410\n";
  for (const std::string& plan : {std::string("lose replies=1 cycles=400..410"), file.string()}) {
    const Finished finished = run({"campaign", "--cycles", "20000", "--plan", plan, "--json"});
    ASSERT_EQ(finished.exit_code, 0) << finished.err << finished.out;
    EXPECT_EQ(Json::parse(finished.out).at("touched"), 11);
  }
  std::ofstream(file) << "\xEF\xBB\xBF" << "lose replies=1 cycles=400..410\r\n";
  EXPECT_EQ(run({"campaign", "--cycles", "20000", "--plan", file.string()}).exit_code, 0)
      << "as some editors write";
  const Finished neither = run({"campaign", "--plan", "loose"});
  EXPECT_EQ(neither.exit_code, 2);
  EXPECT_NE(neither.err.find("'loose' is no fault"), std::string::npos) << neither.err;
  std::ofstream(file) << "lose replies=1\nloose replies=1\n";
  const Finished refused = run({"campaign", "--plan", file.string()});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.err.find("plan_unknown_fault"), std::string::npos);
  EXPECT_NE(refused.err.find("line 2"), std::string::npos);
}

TEST_F(CampaignCommand, WhatCannotBeIsExitCode2) {
  for (const Process::Arguments& wrong : {Process::Arguments{"--cycles", "0"},
                                          {"--cycles", "1.5e0"},
                                          {"--cycles", "99999999999999999999999"},
                                          {"--jobs", "0"},
                                          {"--jobs", "257"},
                                          {"--seed", "-1"},
                                          {"--plan", ""},
                                          {"--plan", "no such file"},
                                          {"--seed", ""},
                                          {"--seed", "1e3"},
                                          {"--vcd", ""},
                                          {"--replay", ""},
                                          {"--replay", "1"},
                                          {"--replay", "1:2:3"},
                                          {"--vcd", "x.vcd"}}) {
    Process::Arguments arguments{"campaign"};
    arguments.insert(arguments.end(), wrong.begin(), wrong.end());
    const Finished finished = run(arguments);
    EXPECT_EQ(finished.exit_code, 2) << wrong[0] << ' ' << wrong[1];
    EXPECT_LT(finished.err.size(), 400u) << "says what is possible, and no more: " << finished.err;
  }
}

TEST_F(CampaignCommand, PlaysARunAgainWithATraceAndAWaveform) {
  const fs::path wave = folder_ / "run.vcd";
  const Process::Arguments arguments{"campaign", "--replay", "3:5",        "--cycles",
                                     "1000",     "--vcd",    wave.string()};
  const Finished finished = run(arguments);
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_NE(finished.out.find("run 5 of seed 3"), std::string::npos);
  EXPECT_NE(finished.out.find("start-up"), std::string::npos) << finished.out;
  std::ifstream file(wave);
  const std::string vcd{std::istreambuf_iterator<char>(file), {}};
  EXPECT_TRUE(vcd.starts_with("$comment tm485"));
  EXPECT_EQ(run(arguments).exit_code, 2) << "the file is there already";
}

TEST_F(CampaignCommand, AReplayHasTheSeedOfItsRun) {
  const Finished finished = run({"campaign", "--replay", "3:5", "--seed", "4"});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_NE(finished.err.find("--replay"), std::string::npos) << finished.err;
}

// Such a run takes hours; what it cannot write it says before.
TEST_F(CampaignCommand, AWaveformThatCannotBeWrittenIsRefusedBeforeTheRun) {
  const fs::path there = folder_ / "there.vcd";
  std::ofstream(there) << "mine";
  const fs::path dangling = folder_ / "dangling.vcd";
  fs::create_symlink(folder_ / "nowhere", dangling);
  for (const fs::path& wave : {there, dangling, folder_, folder_ / "none" / "x.vcd"}) {
    Process process({"campaign", "--replay", "3:5", "--cycles", "1e12", "--vcd", wave.string()});
    const Finished finished = process.wait(std::chrono::seconds(20));
    EXPECT_FALSE(finished.timed_out) << wave;
    EXPECT_EQ(finished.exit_code, 2) << wave;
    EXPECT_NE(finished.err.find(wave.string()), std::string::npos) << finished.err;
  }
  std::ifstream file(there);
  EXPECT_EQ((std::string{std::istreambuf_iterator<char>(file), {}}), "mine");
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_), fs::directory_iterator{}), 2) << "nothing is left";
}

// An echo that nobody has told the bus of: no start-up succeeds, and no rule can be broken.
TEST_F(CampaignCommand, ACampaignThatJudgesNothingIsNoSuccess) {
  for (const Process::Arguments& more : {Process::Arguments{}, {"--json"}, {"--replay", "1:0"}}) {
    Process::Arguments arguments{"campaign", "--cycles", "20000", "--jobs", "1", "--plan", "echo"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Finished finished = run(arguments);
    EXPECT_EQ(finished.exit_code, 1) << finished.out;
    EXPECT_NE(finished.err.find("nothing_judged"), std::string::npos) << finished.err;
    EXPECT_EQ(finished.out.find("no rule is broken"), std::string::npos) << finished.out;
    if (!more.empty() && more[0] == "--json") {
      EXPECT_EQ(Json::parse(finished.out).at("cycles"), 0);
    }
  }
}

TEST_F(CampaignCommand, CtrlCEndsAReplayInOrderToo) {
  const fs::path wave = folder_ / "run.vcd";
  Process process({"campaign", "--replay", "1:3", "--cycles", "1e12", "--json", "--vcd", wave.string()});
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  process.send_signal(SIGINT);
  const Finished finished = process.wait();
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  ASSERT_FALSE(finished.out.empty());
  const Json json = Json::parse(finished.out);
  EXPECT_TRUE(json.at("stopped"));
  EXPECT_GT(json.at("cycles").get<std::uint64_t>(), 0U);
  EXPECT_GT(fs::file_size(wave), 0U);
}

TEST_F(CampaignCommand, CtrlCEndsItInOrder) {
  Process process({"campaign", "--cycles", "100000000000", "--jobs", "1", "--json"});
  // Its handlers are installed before it does anything; a moment later it is in its cycles.
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  process.send_signal(SIGINT);
  const Finished finished = process.wait();
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_TRUE(Json::parse(finished.out).at("stopped"));
}

}  // namespace
}  // namespace tm485::test
