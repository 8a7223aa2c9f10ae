// tm485 doctor as a command: its output, its exit codes, what it does to a real port, and that it only reads.
#include <gtest/gtest.h>

#include <atomic>
#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "cli/process.hpp"
#include "cli/simulator.hpp"
#include "tm485/sim/server.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;

std::vector<std::string> names(const Json& json) {
  std::vector<std::string> found;
  for (const Json& finding : json.at("findings"))
    if (finding.at("severity") == "fault") found.push_back(finding.at("name"));
  return found;
}

/// The verdict and detail of one check.
Json check(const Json& json, const std::string& name) {
  for (const Json& each : json.at("checks"))
    if (each.at("name") == name) return each;
  ADD_FAILURE() << "no check " << name << " in " << json;
  return Json{{"verdict", ""}, {"detail", ""}};
}

TEST(Doctor, SaysInWordsWhatItSawWhyAndWhatToDo) {
  const Finished finished = run({"doctor", "sim:almc=04,t2=8us"});
  EXPECT_EQ(finished.exit_code, 1);
  for (const char* expected :
       {"sim:almc=04,t2=8us, profile tm485_17", "fault t2_outside", "fault alarm_fault",
        "ALMC.2 counting_error", "seen", "cause", "remedy", "tm485 reset", "errors"})
    EXPECT_NE(finished.out.find(expected), std::string::npos) << expected << '\n' << finished.out;
  for (const std::string& line : finished.lines()) EXPECT_LE(line.size(), 120U) << line;
}

TEST(Doctor, SaysThatAHealthyPortIsHealthy) {
  const Finished finished = run({"doctor", "sim:"});
  EXPECT_EQ(finished.exit_code, 0);
  EXPECT_NE(finished.out.find("healthy: nothing found"), std::string::npos) << finished.out;
}

TEST(Doctor, TheLatencyAllowanceIsAnOption) {
  const Json json = Json::parse(run({"doctor", "--json", "sim:", "--latency", "7ms"}).out);
  EXPECT_NE(check(json, "port").at("detail").get<std::string>().find("latency allowance 7ms"),
            std::string::npos)
      << json;
  for (const char* wrong : {"7", "11s", "soon"}) {
    const Finished finished = run({"doctor", "sim:", "--latency", wrong});
    EXPECT_EQ(finished.exit_code, 2) << wrong;
    EXPECT_NE(finished.err.find("tm485: bad_latency:"), std::string::npos) << finished.err;
    EXPECT_EQ(finished.out, "");
  }
}

TEST(Doctor, TheFiguresAreThoseOfTheLine) {
  const Json json = Json::parse(run({"doctor", "--json", "sim:t2=3us..3.5us,release=300ns"}).out);
  EXPECT_EQ(check(json, "direction").at("detail"), "driver off the line within 300ns");
  EXPECT_NE(
      check(json, "T2").at("detail").get<std::string>().find("3us to 3.5us; the profile allows 2us to 6us"),
      std::string::npos);
  // None of 4000: 1 - 0.05^(1/4000) = 0.0749 %.
  EXPECT_EQ(check(json, "noise").at("detail"),
            "0 of 4000 exchanges failed; with 95 % certainty at most 0.0749 % do");
  EXPECT_EQ(check(json, "latency timer").at("verdict"), "skipped");
}

TEST(Doctor, NamesTheRateAtWhichTheEncoderAnswers) {
  const Json json = Json::parse(run({"doctor", "--json", "sim:baud=1250000"}).out);
  EXPECT_NE(json.at("findings").at(0).at("seen").get<std::string>().find("good replies at 1250000 bit/s"),
            std::string::npos);
}

TEST(Doctor, NamesTheProfileThatFits) {
  const auto remedy = [](const std::vector<std::string>& arguments) {
    return Json::parse(run(arguments).out).at("findings").at(0).at("remedy").get<std::string>();
  };
  EXPECT_NE(remedy({"doctor", "--json", "sim:profile=tm485_23", "--profile", "tm485_17"})
                .find("--profile tm485_23,"),
            std::string::npos);
  EXPECT_NE(remedy({"doctor", "--json", "sim:profile=tformat_23_battery,start=0.5", "--profile",
                    "tformat_17_battery"})
                .find("--profile tformat_23_battery,"),
            std::string::npos);
  EXPECT_NE(remedy({"doctor", "--json", "sim:enid=42"}).find("enids = [0x42]"), std::string::npos);
}

TEST(Doctor, APortThatDoesNotOpenIsAFinding) {
  const Finished finished = run({"doctor", "--json", "/dev/ttyNobodyHasThis"});
  EXPECT_EQ(finished.exit_code, 1);
  const Json json = Json::parse(finished.out);
  EXPECT_EQ(names(json), std::vector<std::string>{"cannot_open"});
  EXPECT_NE(json.at("findings").at(0).at("seen").get<std::string>().find("/dev/ttyNobodyHasThis"),
            std::string::npos);
}

TEST(Doctor, WhatMeansNoPortIsAUsageError) {
  EXPECT_EQ(run({"doctor"}).exit_code, 2);
  for (const char* port : {"nonsense", "sim:spin=1"}) {
    const Finished finished = run({"doctor", port});
    EXPECT_EQ(finished.exit_code, 2) << port;
    EXPECT_EQ(finished.out, "") << port;
    EXPECT_NE(finished.err.find("bad_port"), std::string::npos) << finished.err;
  }
  EXPECT_EQ(run({"doctor", "sim:", "--profile", "endat"}).exit_code, 2);
}

/// An encoder in this process, behind a unix socket: the kernel hands the bytes of pseudo-terminals over by a worker
/// that a busy machine stops for seconds, and a doctor rightly calls that a fault.
class Served {
 public:
  explicit Served(const std::string& options)
      : server_(*sim::Server::open_unix(*sim::parse_sim_options(options), folder_.path("line"))),
        thread_([this] { EXPECT_TRUE(server_.serve(stop_).has_value()); }) {}
  ~Served() { end(); }
  Served(const Served&) = delete;
  Served& operator=(const Served&) = delete;

  [[nodiscard]] std::string port() const { return "unix:" + server_.path(); }
  /// Stops it; then its model can be looked at.
  const sim::EncoderModel& end() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    return server_.model();
  }

 private:
  TemporaryFolder folder_;
  sim::Server server_;
  std::atomic<bool> stop_ = false;
  std::thread thread_;
};

TEST(Doctor, ARealPortIsExaminedOnTheRealClock) {
  Served encoder("rpm=600");
  const Finished finished = run({"doctor", "--json", encoder.port()});
  const Json json = Json::parse(finished.out);
  EXPECT_EQ(names(json), std::vector<std::string>{}) << finished.out;
  EXPECT_EQ(check(json, "T2").at("verdict"), "not judged");
  EXPECT_EQ(check(json, "direction").at("verdict"), "not judged");
  EXPECT_EQ(check(json, "EEPROM").at("detail"), "ready");
  EXPECT_NE(check(json, "kernel").at("verdict"), "skipped");
}

TEST(Doctor, NeverWritesToTheEncoder) {
  Served encoder("almc=C4,profile=tformat_17_battery");
  (void)run({"doctor", encoder.port(), "--profile", "tformat_17_battery"});
  const sim::EncoderModel& model = encoder.end();
  const auto& requests = model.statistics().requests;
  EXPECT_GT(requests.at(0x2), 0u);
  EXPECT_GT(requests.at(0x3), 0u);
  EXPECT_GT(requests.at(0xD), 0u);
  for (const std::size_t writing : {0x6U, 0x7U, 0x8U, 0xCU}) EXPECT_EQ(requests.at(writing), 0u) << writing;
  EXPECT_EQ(model.statistics().bad_requests + model.statistics().unknown_cf, 0u);
}

TEST(Doctor, OnlyALineThatHasARateIsTriedAtOthers) {
  Simulator encoder({"--pty", "--boot", "3600s"});
  const Finished finished = run({"doctor", "--json", encoder.port()});
  const Json json = Json::parse(finished.out);
  EXPECT_EQ(names(json), std::vector<std::string>{"no_reply"});
  EXPECT_NE(finished.out.find("this port has no bit rate to try"), std::string::npos) << finished.out;
  EXPECT_NE(run({"doctor", "sim:power=off"}).out.find("5000000"), std::string::npos);
}

TEST(Doctor, AnEchoIsToldFromAReplyOnTheRealClock) {
  Served encoder("echo");
  EXPECT_EQ(names(Json::parse(run({"doctor", "--json", encoder.port()}).out)),
            std::vector<std::string>{"own_echo"});
}

TEST(Doctor, APortThatVanishesIsAFinding) {
  const TemporaryFolder folder;
  Simulator simulator({"--unix", folder.path("line")});
  Process doctor({"doctor", "--json", "unix:" + folder.path("line")});
  std::this_thread::sleep_for(std::chrono::milliseconds(1500));  // it takes some seconds
  EXPECT_EQ(simulator.stop().exit_code, 0);
  const Finished finished = doctor.wait();
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_EQ(names(Json::parse(finished.out)), std::vector<std::string>{"port_gone"}) << finished.out;
}

TEST(Doctor, CtrlCEndsItWithWhatItHas) {
  Served encoder("boot=3600s");
  Process doctor({"doctor", "--json", encoder.port()});
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  doctor.send_signal(SIGINT);
  const Finished finished = doctor.wait(std::chrono::seconds(10));
  EXPECT_FALSE(finished.timed_out);
  EXPECT_EQ(finished.exit_code, 1);
  const Json json = Json::parse(finished.out);
  EXPECT_TRUE(json.at("stopped").get<bool>());
  EXPECT_FALSE(json.at("healthy").get<bool>());
  EXPECT_EQ(names(json), std::vector<std::string>{});
}

}  // namespace
}  // namespace tm485::test
