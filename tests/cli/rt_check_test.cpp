// tm485 rt-check: its table, its measure and its exit codes; no figure is asserted.
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "cli/process.hpp"
#include "cyclictest.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;

/// PATH as it is given, for the commands that a test starts.
class Path {
 public:
  explicit Path(const std::string& path) : before_(std::getenv("PATH")) { setenv("PATH", path.c_str(), 1); }
  ~Path() { setenv("PATH", before_.c_str(), 1); }
  Path(const Path&) = delete;
  Path& operator=(const Path&) = delete;

 private:
  std::string before_;
};

/// A program named cyclictest that prints `output`.
std::string fake_cyclictest(const TemporaryFolder& folder, const std::string& output, int exit_code = 0) {
  const std::string path = folder.write("cyclictest", "#!/bin/sh\n/bin/cat <<'END'\n" + output +
                                                          "\nEND\nexit " + std::to_string(exit_code) + "\n");
  EXPECT_EQ(std::system(("chmod +x '" + path + "'").c_str()), 0);
  return path.substr(0, path.rfind('/'));
}

constexpr const char* kHistogram =
    "# /dev/cpu_dma_latency set to 0us\n# Histogram\n000003 000050\n000004 000048\n000009 000001\n# Total: "
    "000000099\n"
    "# Min Latencies: 00003\n# Avg Latencies: 00003\n# Max Latencies: 30123\n# Histogram Overflows: 00001\n"
    "# Histogram Overflow at cycle number:\n# Thread 0: 00017";

const std::vector<std::string> kQuick{"rt-check", "--seconds", "50ms", "--period", "1ms"};

std::vector<std::string> quick(std::initializer_list<std::string> more) {
  std::vector<std::string> arguments = kQuick;
  arguments.insert(arguments.end(), more);
  return arguments;
}

TEST(RtCheck, ShowsEverySettingAndTheMeasure) {
  const Path path("/nowhere");
  const Finished finished = run(quick({}));
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  for (const char* expected : {"kernel", "cpus", "isolated", "nohz_full", "governor", "clocksource", "rtprio",
                               "memlock", "rt_throttling", "fair_server", "lateness every 1ms", "p99.9",
                               "spin", "hybrid", "apt install rt-tests"})
    EXPECT_NE(finished.out.find(expected), std::string::npos) << expected << '\n' << finished.out;
  for (const std::string& line : finished.lines()) EXPECT_LE(line.size(), 130U) << line;
}

TEST(RtCheck, JsonHasTheSame) {
  const Path path("/nowhere");
  const Finished finished = run(quick({"--json"}));
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  ASSERT_EQ(finished.lines().size(), 1U);
  const Json json = Json::parse(finished.out);
  EXPECT_EQ(json.at("settings").size(), 10U);
  for (const Json& setting : json.at("settings")) {
    const std::string verdict = setting.at("verdict");
    EXPECT_TRUE(verdict == "good" || verdict == "improvable" || verdict == "bad" || verdict == "unknown")
        << verdict;
    if (verdict == "good") {
      EXPECT_EQ(setting.at("remedy"), "");
    }
  }
  EXPECT_EQ(json.at("period_ns"), 1'000'000);
  for (const char* mode : {"spin", "hybrid"}) {
    const Json& lateness = json.at("lateness").at(mode);
    EXPECT_GE(lateness.at("min_ns"), 0) << mode << ": never early";
    EXPECT_GE(lateness.at("max_ns"), lateness.at("p50_ns")) << mode;
    const std::uint64_t samples = lateness.at("samples");
    EXPECT_LE(samples, 50U) << mode;
    EXPECT_GE(samples + std::uint64_t{lateness.at("skipped")}, 50U)
        << mode << ": every cycle is accounted for";
  }
  EXPECT_EQ(
      json.at("priority") == 0,
      !json.at("warnings").empty() && json.at("warnings").dump().find("\"priority\"") != std::string::npos);
  EXPECT_FALSE(json.at("lateness").contains("cyclictest"));
}

TEST(RtCheck, CyclictestStandsBesideOurs) {
  const TemporaryFolder folder;
  const Path path(fake_cyclictest(folder, kHistogram));
  const Finished finished = run(quick({"--json"}));
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  const Json measured = Json::parse(finished.out).at("lateness").at("cyclictest");
  EXPECT_EQ(measured.at("samples"), 100);
  EXPECT_EQ(measured.at("min_ns"), 3'000);
  EXPECT_EQ(measured.at("p50_ns"), 4'000);
  EXPECT_EQ(measured.at("max_ns"), 30'123'000);
  EXPECT_NE(run(kQuick).out.find("cyclictest              3"), std::string::npos);
}

TEST(RtCheck, AFailingCyclictestIsSaidAndIsNoFailure) {
  const TemporaryFolder folder;
  const Path path(fake_cyclictest(folder, "cannot change the policy", 1));
  const Finished finished = run(kQuick);
  EXPECT_EQ(finished.exit_code, 0);
  EXPECT_NE(finished.out.find("cannot change the policy"), std::string::npos) << finished.out;
}

TEST(RtCheck, StrictFailsExactlyWhenSomethingIsBad) {
  const Path path("/nowhere");
  const Finished finished = run(quick({"--strict", "--json"}));
  const Json json = Json::parse(finished.out);
  const bool bad = json.at("settings").dump().find("\"bad\"") != std::string::npos;
  EXPECT_EQ(finished.exit_code, bad ? 1 : 0);
}

TEST(RtCheck, HasHelpWithExamples) {
  const Finished help = run({"rt-check", "--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_NE(help.out.find("tm485 rt-check --period 62.5us"), std::string::npos) << help.out;
}

TEST(RtCheck, WhatCannotBeUnderstoodIsExitCode2) {
  for (const auto& [option, value] : {std::pair{"--period", "soon"},
                                      {"--period", "0us"},
                                      {"--period", "1us"},
                                      {"--seconds", "0"},
                                      {"--seconds", "x"}}) {
    const Finished finished = run({"rt-check", option, value});
    EXPECT_EQ(finished.exit_code, 2) << option << ' ' << value;
    EXPECT_NE(finished.err.find("remedy:"), std::string::npos) << finished.err;
  }
}

TEST(Cyclictest, HistogramsAreRead) {
  const auto result = cli::parse_cyclictest(kHistogram);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->count(), 100U);
  EXPECT_EQ(result->minimum(), Time{3'000});
  EXPECT_EQ(result->percentile(0.25), Time{3'000});
  EXPECT_EQ(result->percentile(0.5), Time{4'000});
  EXPECT_EQ(result->percentile(0.98), Time{9'000});
  EXPECT_EQ(result->percentile(0.999), Time{30'123'000}) << "beyond the histogram";
  for (const char* text : {"", "nonsense", "# Max Latencies: 00001\n"})
    EXPECT_FALSE(cli::parse_cyclictest(text)) << text;
}

}  // namespace
}  // namespace tm485::test
