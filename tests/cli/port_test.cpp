// info, read, monitor and bench, end to end: on the simulated port in this process, and over a pseudo-terminal and a
// unix socket to another one.
#include <gtest/gtest.h>

#include <memory>
#include <nlohmann/json.hpp>
#include <tuple>

#include "cli/process.hpp"
#include "cli/simulator.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;
using std::chrono::seconds;

std::vector<Json> objects(const Finished& finished) {
  std::vector<Json> result;
  for (const std::string& line : finished.lines()) result.push_back(Json::parse(line));
  return result;
}

/// Fresh samples are in order, and every line is of the kind that the ID has.
void expect_samples(const Finished& finished, std::size_t count) {
  EXPECT_FALSE(finished.timed_out);
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  const std::vector<Json> lines = objects(finished);
  ASSERT_EQ(lines.size(), count) << finished.err;
  std::int64_t last = -1;
  for (const Json& line : lines) {
    for (const char* key : {"t_ns", "sequence", "abs", "abm", "turns", "position", "sf", "almc", "enid"}) {
      ASSERT_TRUE(line.contains(key)) << key << " " << line;
      EXPECT_TRUE(line.at(key).is_number_integer()) << key << " " << line;
    }
    EXPECT_EQ(line.at("enid"), 17);
    if (line.at("quality") != "fresh") continue;
    EXPECT_GT(line.at("t_ns").get<std::int64_t>(), last);
    last = line.at("t_ns").get<std::int64_t>();
    EXPECT_EQ(line.at("position").get<std::int64_t>(),
              (line.at("turns").get<std::int64_t>() - 1) * 131072 + line.at("abs").get<std::int64_t>());
  }
  EXPECT_GE(last, 0) << "not one fresh sample";
}

TEST(Read, EveryCycleOfASimulatedPortIsALine) {
  expect_samples(run({"read", "sim:rpm=3000", "-n", "50", "--json"}), 50);
  EXPECT_EQ(run({"read", "sim:", "--json"}).lines().size(), 10U);
}

TEST(Read, AnIdHasItsOwnKeysAndNoOther) {
  const auto keys = [](const char* id) {
    const Finished finished = run({"read", "sim:rpm=60", "-n", "1", "--id", id, "--json"});
    const Json object = Json::parse(finished.lines().at(0));
    std::vector<std::string> names;
    for (const auto& [name, value] : object.items()) names.push_back(name);
    return names;
  };
  using Names = std::vector<std::string>;
  EXPECT_EQ(keys("0"), (Names{"abs", "half_width", "position", "quality", "sequence", "sf", "t_ns"}));
  EXPECT_EQ(keys("1"), (Names{"abm", "quality", "sequence", "sf", "t_ns", "turns"}));
  EXPECT_EQ(keys("2"), (Names{"enid", "quality", "sequence", "sf", "t_ns"}));
}

TEST(Read, NegativeTurnsAndUnits) {
  const char* const kBackwards = "sim:profile=tformat_17_battery,start=-1.25";
  const Json counts = Json::parse(run({"read", kBackwards, "-n", "1", "--json"}).lines().at(0));
  EXPECT_EQ(counts.at("turns"), -2);
  EXPECT_EQ(counts.at("abm"), 65534);
  EXPECT_EQ(counts.at("position"), -163840);
  const Json turns =
      Json::parse(run({"read", kBackwards, "-n", "1", "--json", "--units", "rev"}).lines().at(0));
  EXPECT_DOUBLE_EQ(turns.at("position").get<double>(), -1.25);
  const Json degrees =
      Json::parse(run({"read", kBackwards, "-n", "1", "--json", "--units", "deg"}).lines().at(0));
  EXPECT_DOUBLE_EQ(degrees.at("position").get<double>(), -450.0);
}

TEST(Read, FailedCyclesAreHeldAndCounted) {
  const Finished finished = run({"read", "sim:lost=0.02,seed=5", "-n", "600", "--json"});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  std::size_t held = 0;
  for (const Json& line : objects(finished)) {
    if (line.at("quality") == "fresh") continue;
    ++held;
    EXPECT_EQ(line.at("quality"), "held");
    EXPECT_TRUE(line.at("error").is_string());
    EXPECT_TRUE(line.at("abs").is_number_integer());
  }
  EXPECT_GT(held, 0U);
  EXPECT_NE(finished.err.find(std::to_string(held) + " of 600 cycles failed:"), std::string::npos)
      << finished.err;
}

TEST(Read, NoEncoderEndsInANamedErrorOfItsStage) {
  const Finished finished = run({"read", "sim:boot=3600s", "-n", "5"});
  EXPECT_FALSE(finished.timed_out);
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_TRUE(finished.out.empty());
  EXPECT_NE(finished.err.find("tm485: timeout:"), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("stage 'answer'"), std::string::npos) << finished.err;
}

TEST(Read, TheProfileMustFitTheEncoder) {
  const Finished finished = run({"read", "sim:profile=tm485_23,start=0.9", "--profile", "tm485_17"});
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_NE(finished.err.find("tm485: enid_unexpected:"), std::string::npos) << finished.err;
  EXPECT_EQ(run({"read", "sim:profile=tm485_23,start=0.9", "-n", "2"}).exit_code, 0);
}

TEST(Read, APositionBeyondTheSpeedOfTheShaftIsRefused) {
  const Finished finished = run({"read", "sim:rpm=9000", "-n", "5"});
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_NE(finished.err.find("tm485: frames_inconsistent:"), std::string::npos) << finished.err;
  EXPECT_EQ(run({"read", "sim:rpm=9000", "-n", "5", "--max-speed", "200rev/s"}).exit_code, 0);
}

TEST(Monitor, ASampleSaysByHowMuchItCanBeWrongAndLessWithATighterAcceleration) {
  const auto half_width = [](const Process::Arguments& more) {
    Process::Arguments arguments{"monitor", "sim:rpm=300", "--seconds", "1", "--virtual", "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    const Finished finished = run(arguments);
    EXPECT_EQ(finished.exit_code, 0) << finished.err;
    return objects(finished).back().at("half_width").get<int>();
  };
  const int by_default = half_width({});
  EXPECT_GT(by_default, 0);
  EXPECT_LT(by_default, 200);
  EXPECT_LT(half_width({"--max-accel", "1000rad/s2"}), by_default);
}

TEST(Bench, TheLatencyAllowanceIsAnOption) {
  const auto allowance = [](const Process::Arguments& more) {
    Process::Arguments arguments{"bench", "sim:", "--virtual", "--seconds", "1ms", "--json"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return Json::parse(run(arguments).out).at("capability").at("latency_allowance_ns").get<std::int64_t>();
  };
  EXPECT_EQ(allowance({"--latency", "100ms"}), 100'000'000);
  EXPECT_NE(allowance({}), 100'000'000);
}

TEST(Read, AnImpossiblePeriodNamesTheNearest) {
  const Finished finished = run({"read", "sim:", "--period", "50us"});
  EXPECT_EQ(finished.exit_code, 2);
  EXPECT_NE(finished.err.find("tm485: period_below_t1:"), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("62.5us"), std::string::npos) << finished.err;
  EXPECT_EQ(run({"read", "sim:", "--period", "16kHz", "-n", "3"}).exit_code, 0);
  EXPECT_EQ(run({"read", "sim:", "--period", "min", "-n", "3"}).exit_code, 0);
  for (const char* period : {"62.5", "-1ms", "0us", "fast", "1 parsec"})
    EXPECT_EQ(run({"read", "sim:", "--period", period}).exit_code, 2) << period;
}

TEST(Read, OverAPseudoTerminal) {
  const TemporaryFolder folder;
  const std::string link = folder.path("encoder");
  Simulator simulator({"--pty", "--link", link, "--rpm", "3000"});
  EXPECT_EQ(simulator.port(), link);
  expect_samples(run({"read", link, "-n", "40", "--period", "2ms", "--json"}), 40);
  expect_samples(run({"read", link, "-n", "40", "--json"}), 40);
  const Finished ended = simulator.stop();
  EXPECT_EQ(ended.exit_code, 0);
  EXPECT_NE(ended.err.find(" requests, "), std::string::npos) << ended.err;
}

TEST(Read, OverAUnixSocket) {
  const TemporaryFolder folder;
  Simulator simulator({"--unix", folder.path("socket"), "--rpm", "-600rpm"});
  EXPECT_EQ(simulator.port(), "unix:" + folder.path("socket"));
  expect_samples(run({"read", simulator.port(), "-n", "40", "--json"}), 40);
  expect_samples(run({"read", folder.path("socket"), "-n", "4", "--json"}), 4);
  EXPECT_EQ(simulator.stop().exit_code, 0);
}

TEST(Read, AnEncoderThatIsKilledEndsTheRunWithANamedError) {
  const TemporaryFolder folder;
  for (const bool pty : {true, false}) {
    Simulator simulator(pty ? Process::Arguments{"--link", folder.path("killed")}
                            : Process::Arguments{"--unix", folder.path("killed_socket")});
    Process reader({"read", simulator.port(), "-n", "0", "--json"});
    ASSERT_FALSE(reader.read_line().empty());
    simulator.process().send_signal(SIGKILL);
    const Finished finished = reader.wait(seconds(30));
    EXPECT_FALSE(finished.timed_out);
    EXPECT_EQ(finished.exit_code, 1);
    EXPECT_NE(finished.err.find("tm485: "), std::string::npos) << finished.err;
    EXPECT_NE(finished.err.find("remedy:"), std::string::npos) << finished.err;
  }
}

TEST(Read, AnEncoderThatFallsSilentEndsTheRunWithANamedError) {
  const TemporaryFolder folder;
  Simulator simulator({"--link", folder.path("silent")});
  Process reader({"read", simulator.port(), "-n", "0", "--json"});
  ASSERT_FALSE(reader.read_line().empty());
  simulator.process().send_signal(SIGSTOP);
  const Finished finished = reader.wait(seconds(30));
  simulator.process().send_signal(SIGCONT);
  EXPECT_FALSE(finished.timed_out);
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_NE(finished.err.find("tm485: timeout:"), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("cycles failed: "), std::string::npos) << finished.err;
}

TEST(Read, AnEchoIsForTheProfileToSay) {
  const TemporaryFolder folder;
  const std::string with_echo = folder.write("echo.toml", "base = \"tm485_17\"\necho = true\n");
  Simulator simulator({"--link", folder.path("echo"), "--echo"});
  expect_samples(run({"read", simulator.port(), "-n", "10", "--profile", with_echo, "--json"}), 10);
  expect_samples(run({"read", simulator.port(), "-n", "10", "--echo", "--json"}), 10);
  EXPECT_EQ(run({"read", simulator.port(), "-n", "10"}).exit_code, 1);
  expect_samples(run({"read", "sim:echo", "-n", "10", "--echo", "--json"}), 10);
  EXPECT_EQ(run({"read", "sim:", "-n", "10", "--echo"}).exit_code, 1);
}

TEST(Read, CtrlCAndAReaderThatLeavesEndItQuietly) {
  Process interrupted({"read", "sim:", "-n", "0"});
  ASSERT_FALSE(interrupted.read_line().empty());
  interrupted.send_signal(SIGINT);
  EXPECT_EQ(interrupted.wait(seconds(30)).exit_code, 0);

  Process piped({"read", "sim:", "-n", "0"});
  ASSERT_FALSE(piped.read_line().empty());
  piped.close_output();
  const Finished finished = piped.wait(seconds(30));
  EXPECT_FALSE(finished.timed_out);
  EXPECT_EQ(finished.exit_code, 0);
  EXPECT_EQ(finished.err.find("tm485: output_failed"), std::string::npos) << finished.err;
}

TEST(Ports, WhatCannotBeOpenedIsNamed) {
  const TemporaryFolder folder;
  const auto expect = [](const std::string& port, int exit_code, const std::string& name) {
    const Finished finished = run({"info", port});
    EXPECT_EQ(finished.exit_code, exit_code) << port;
    EXPECT_NE(finished.err.find("tm485: " + name + ":"), std::string::npos) << port << ": " << finished.err;
    EXPECT_NE(finished.err.find("remedy:"), std::string::npos) << port << ": " << finished.err;
  };
  expect("/dev/no_such_device", 1, "port_gone");
  expect("unix:" + folder.path("nothing"), 1, "port_gone");
  expect(folder.write("file", "text"), 1, "open_failed");
  expect("nonsense", 2, "bad_port");
  expect("unix:", 2, "bad_port");
  expect("sim:speed=1", 2, "bad_port");
  expect("sim:profile=nobody", 2, "unknown_profile");
}

TEST(Info, SaysWhoAndWhereAndHow) {
  const Finished finished = run({"info", "sim:profile=tformat_17_battery,almc=80,start=2.5", "--json"});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  const Json info = Json::parse(finished.lines().at(0));
  EXPECT_EQ(info.at("profile"), "tformat_17_battery");
  EXPECT_EQ(info.at("enid"), 17);
  EXPECT_EQ(info.at("single_turn_bits"), 17);
  EXPECT_EQ(info.at("turns"), 2);
  EXPECT_EQ(info.at("position"), 2 * 131072 + 65536);
  EXPECT_EQ(info.at("alarm"), "warning");
  ASSERT_EQ(info.at("alarms").size(), 2U);
  EXPECT_EQ(info.at("alarms")[1].at("name"), "battery_alarm");
  EXPECT_TRUE(info.at("alarms")[1].at("remedy").is_string());
  EXPECT_TRUE(info.at("t2").at("mean_ns").is_number_integer());
  EXPECT_EQ(info.at("capability").at("wire_timestamps"), true);

  const Finished people = run({"info", "sim:almc=80"});
  for (const char* text : {"ENID", "17 bit single-turn", "battery_alarm", "T2"})
    EXPECT_NE(people.out.find(text), std::string::npos) << text << "\n" << people.out;
}

TEST(Info, AFaultOfTheEncoderIsAFailure) {
  const Finished finished = run({"info", "sim:almc=04"});
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_NE(finished.err.find("tm485: alarm_fault:"), std::string::npos) << finished.err;
  EXPECT_NE(finished.out.find("counting_error (fault)"), std::string::npos) << finished.out;
}

TEST(Bench, VirtualTimeReachesTheLimit) {
  for (const auto& [id, period, hz] : {std::tuple{"3", "62.5us", 16000.0}, {"0", "40us", 25000.0}}) {
    const Finished finished = run(
        {"bench", "sim:rpm=3000", "--id", id, "--period", period, "--seconds", "3", "--virtual", "--json"});
    EXPECT_EQ(finished.exit_code, 0) << finished.err;
    const Json bench = Json::parse(finished.lines().at(0));
    EXPECT_EQ(bench.at("clock"), "virtual time");
    EXPECT_GE(bench.at("rate_percent").get<double>(), 99.9);
    EXPECT_LE(bench.at("rate_percent").get<double>(), 100.0001);
    EXPECT_DOUBLE_EQ(bench.at("limit_hz").get<double>(), hz);
    EXPECT_GE(bench.at("good").get<double>(), 0.999 * 3 * hz);
    EXPECT_EQ(bench.at("failed"), 0);
    EXPECT_EQ(bench.at("skipped"), 0);
    for (const char* series : {"period", "lateness", "t2", "round_trip"})
      for (const char* key : {"min_ns", "p50_ns", "p99_ns", "p99_9_ns", "max_ns", "samples"})
        EXPECT_TRUE(bench.at(series).at(key).is_number_integer()) << series << " " << key;
    EXPECT_GE(bench.at("t2").at("min_ns"), 2800);
    EXPECT_LE(bench.at("t2").at("max_ns"), 3200);
  }
}

TEST(Bench, CountsErrorsByCause) {
  const Json bench = Json::parse(
      run({"bench", "sim:ber=0:1e-4,seed=3", "--seconds", "1", "--virtual", "--json"}).lines().at(0));
  EXPECT_GT(bench.at("failed").get<int>(), 0);
  EXPECT_EQ(bench.at("good").get<int>() + bench.at("failed").get<int>(), bench.at("cycles").get<int>());
  EXPECT_TRUE(bench.at("errors").at("crc_error").is_number_integer());
}

TEST(Bench, RealTimeSaysSoAndARealPortRefusesVirtualTime) {
  const TemporaryFolder folder;
  EXPECT_NE(run({"bench", "sim:", "--seconds", "0.2"}).out.find("in real time"), std::string::npos);
  Simulator simulator({"--link", folder.path("bench")});
  const Finished refused = run({"bench", simulator.port(), "--virtual"});
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_NE(refused.err.find("tm485: bad_virtual:"), std::string::npos) << refused.err;
  const Json bench =
      Json::parse(run({"bench", simulator.port(), "--seconds", "500ms", "--json"}).lines().at(0));
  EXPECT_EQ(bench.at("clock"), "real time");
  EXPECT_TRUE(bench.contains("reply_delay"));
  EXPECT_FALSE(bench.contains("t2"));
  EXPECT_GT(bench.at("good").get<int>(), 0);
}

TEST(Monitor, WithoutATerminalALineASecond) {
  const Finished finished = run({"monitor", "sim:rpm=3000", "--seconds", "1"});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  ASSERT_EQ(finished.lines().size(), 1U) << finished.out;
  EXPECT_EQ(finished.out.find('\x1b'), std::string::npos);
  for (const char* text : {"position", "turns", "rate", "T1", "T2", "errors"})
    EXPECT_NE(finished.out.find(text), std::string::npos) << text << "\n" << finished.out;
}

TEST(Monitor, VirtualTimeShowsSpeedAndRate) {
  const Finished finished = run({"monitor", "sim:rpm=3000,almc=04", "--seconds", "5", "--virtual", "--json"});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  const std::vector<Json> lines = objects(finished);
  ASSERT_EQ(lines.size(), 5U);
  EXPECT_EQ(lines.back().at("clock"), "virtual time");
  EXPECT_NEAR(lines.back().at("speed_rpm").get<double>(), 3000.0, 1.0);
  EXPECT_NEAR(lines.back().at("rate_percent").get<double>(), 100.0, 0.1);
  EXPECT_EQ(lines.back().at("alarms"), Json({"single_turn_error", "counting_error"}));
  EXPECT_EQ(lines.back().at("alarms_latched"), Json({"single_turn_error", "counting_error"}));
  EXPECT_EQ(lines.back().at("link").at("state"), "good");
  EXPECT_EQ(lines.back().at("link").at("damage_ppm"), 0);
}

TEST(Monitor, ANoisyLineIsADegradedLinkAndSaysWhatFails) {
  const Finished finished =
      run({"monitor", "sim:rpm=3000,ber=0:5e-4,seed=4", "--seconds", "2", "--virtual", "--json"});
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  const Json link = objects(finished).back().at("link");
  EXPECT_EQ(link.at("state"), "degraded");
  EXPECT_GT(link.at("damage_ppm").get<int>(), 10'000);
  const Finished block = run({"monitor", "sim:ber=0:5e-4,seed=4", "--seconds", "2", "--virtual"});
  EXPECT_NE(block.out.find("link degraded, "), std::string::npos) << block.out;
}

TEST(Monitor, SurvivesAnEncoderThatIsLost) {
  const TemporaryFolder folder;
  auto simulator = std::make_unique<Simulator>(Process::Arguments{"--link", folder.path("lost")});
  Process monitor({"monitor", simulator->port(), "--period", "1ms", "--json"});
  const auto state_until = [&monitor](const std::string& wanted) {
    for (int line = 0; line < 30; ++line) {
      const std::string text = monitor.read_line();
      if (text.empty()) return false;
      const Json moment = Json::parse(text);
      if (moment.contains("error") ? wanted == "error"
                                   : moment.at("state") == wanted && moment.at("rate_hz") > 0.0)
        return true;
    }
    return false;
  };
  EXPECT_TRUE(state_until("running"));
  EXPECT_EQ(simulator->stop().exit_code, 0);
  simulator.reset();
  EXPECT_TRUE(state_until("error"));
  simulator = std::make_unique<Simulator>(Process::Arguments{"--link", folder.path("lost")});
  EXPECT_TRUE(state_until("running"));
  monitor.send_signal(SIGTERM);
  EXPECT_EQ(monitor.wait(seconds(30)).exit_code, 0);
}

}  // namespace
}  // namespace tm485::test
