// tm485 servo-demo: what it reports in virtual time is exact and repeats; in real time every period is accounted for.
#include <gtest/gtest.h>

#include <csignal>
#include <nlohmann/json.hpp>
#include <thread>

#include "cli/process.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;

Json demo(Process::Arguments arguments) {
  arguments.insert(arguments.begin(), {"servo-demo", "--json"});
  const Finished finished = run(arguments);
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  EXPECT_TRUE(finished.err.empty()) << finished.err;
  return Json::parse(finished.out);
}

Json virtual_demo(Process::Arguments arguments) {
  arguments.emplace_back("--virtual");
  return demo(arguments);
}

/// Of the run of a feedback.
Json run_of(const Json& result, const std::string& feedback) {
  for (const Json& run : result.at("runs"))
    if (run.at("feedback") == feedback) return run;
  ADD_FAILURE() << "no run " << feedback << " in " << result.dump();
  return {};
}

double number(const Json& run, const char* what, const char* value) {
  return run.at("quality").at(what).at(value).get<double>();
}

TEST(ServoDemo, HasHelpWithExamples) {
  const Finished help = run({"servo-demo", "--help"});
  EXPECT_EQ(help.exit_code, 0);
  EXPECT_NE(help.out.find("tm485 servo-demo --virtual --outage 50ms"), std::string::npos) << help.out;
}

TEST(ServoDemo, TheEstimatorIsQuieterAndMoreExactThanDifferencing) {
  const Json result = virtual_demo({"--seconds", "1"});
  const Json raw = run_of(result, "raw");
  const Json estimator = run_of(result, "estimator");
  EXPECT_GT(number(raw, "velocity_error", "rms_rpm"), 5.0 * number(estimator, "velocity_error", "rms_rpm"));
  EXPECT_GT(number(raw, "current_ripple", "rms_mA"), 5.0 * number(estimator, "current_ripple", "rms_mA"));
  EXPECT_GT(number(raw, "tracking_error", "rms_counts"),
            2.0 * number(estimator, "tracking_error", "rms_counts"));
  EXPECT_LT(number(estimator, "tracking_error", "max_counts"), 25.0) << "friction changes sides";
  EXPECT_NEAR(number(estimator, "tracking_error", "max_deg") / 360.0 * 131072.0,
              number(estimator, "tracking_error", "max_counts"), 1e-6);
  // ±90 deg at 2 Hz: 188.5 rpm.
  EXPECT_NEAR(estimator.at("quality").at("top_rpm").get<double>(), 188.5, 2.0);
  for (const Json& run : {raw, estimator}) {
    EXPECT_EQ(run.at("periods").at("fresh"), 16'000);
    EXPECT_EQ(run.at("periods").at("extrapolated"), 0);
    EXPECT_EQ(run.at("periods").at("invalid"), 0);
    EXPECT_EQ(run.at("torque_offs"), 0);
    EXPECT_EQ(run.at("t1_violations"), 0);
    EXPECT_EQ(run.at("bus").at("failed"), 0);
  }
}

TEST(ServoDemo, VirtualTimeRepeatsToTheLastDigit) {
  const Process::Arguments arguments{"servo-demo",  "sim:lost=0.01,ber=1e-5",
                                     "--virtual",   "--json",
                                     "--seconds",   "0.5",
                                     "--drift",     "-100ppm",
                                     "--amplitude", "1rev"};
  EXPECT_EQ(run(arguments).out, run(arguments).out);
}

TEST(ServoDemo, LostRepliesAreExtrapolated) {
  const Json run =
      run_of(virtual_demo({"sim:lost=0.02", "--seconds", "1", "--feedback", "estimator"}), "estimator");
  const auto failed = run.at("bus").at("failed").get<int>();
  EXPECT_GT(failed, 200);
  EXPECT_NEAR(run.at("periods").at("extrapolated").get<int>(), failed, 2) << "one period for each lost reply";
  // Behind two lost ones the gate wants to see three replies that agree.
  const Json& errors = run.at("bus").at("errors");
  EXPECT_EQ(errors.at("timeout").get<int>() + errors.value("position_implausible", 0), failed);
  EXPECT_LT(errors.value("position_implausible", 0), failed / 10);
  EXPECT_EQ(run.at("periods").at("invalid"), 0);
  EXPECT_LT(number(run, "tracking_error", "max_counts"), 25.0);
}

TEST(ServoDemo, AShortOutageIsBridged) {
  const Json run =
      run_of(virtual_demo({"--outage", "500us", "--seconds", "1", "--feedback", "estimator"}), "estimator");
  EXPECT_EQ(run.at("periods").at("extrapolated"), 8 + 2) << "the third reply that agrees is believed";
  EXPECT_EQ(run.at("torque_offs"), 0);
}

TEST(ServoDemo, ALongOutageTakesTheTorqueAwayUntilTheCommand) {
  const Json result = virtual_demo({"--outage", "50ms", "--hold", "1ms", "--seconds", "1"});
  for (const char* feedback : {"raw", "estimator"}) {
    const Json run = run_of(result, feedback);
    EXPECT_EQ(run.at("torque_offs"), 1);
    EXPECT_EQ(run.at("recoveries"), 1);
    const Json& periods = run.at("periods");
    EXPECT_NEAR(periods.at("extrapolated").get<int>(), 16, 1) << "1 ms";
    // Commands after 20 and 40 ms are in vain, that after 60 ms finds good samples.
    EXPECT_NEAR(periods.at("invalid").get<int>(), 961, 2) << "60 ms";
    EXPECT_GT(periods.at("latched").get<int>(), 100) << "samples were good again, the torque stayed off";
    EXPECT_EQ(periods.at("fresh").get<int>() + periods.at("extrapolated").get<int>() +
                  periods.at("invalid").get<int>(),
              16'000);
  }
}

TEST(ServoDemo, TheBusFollowsADriftingServoClock) {
  for (const char* drift : {"300ppm", "-300ppm"}) {
    const Json run =
        run_of(virtual_demo({"--drift", drift, "--seconds", "2", "--feedback", "estimator"}), "estimator");
    EXPECT_EQ(run.at("periods").at("extrapolated"), 0) << drift;
    EXPECT_EQ(run.at("t1_violations"), 0) << drift;
    EXPECT_EQ(run.at("bus").at("failed"), 0) << drift;
  }
}

TEST(ServoDemo, OtherEncodersAndReferences) {
  const Json fine = run_of(virtual_demo({"sim:profile=tformat_23,turn=-7,start=0.3", "--id", "3", "--seconds",
                                         "0.5", "--feedback", "estimator"}),
                           "estimator");
  EXPECT_LT(number(fine, "tracking_error", "max_deg"), 0.07);
  const Json moves = run_of(virtual_demo({"--port", "sim", "--speed", "50 rev/s", "--amplitude", "-5rev",
                                          "--load", "500mNm", "--states", "2", "--feedback", "estimator"}),
                            "estimator");
  EXPECT_NEAR(moves.at("quality").at("top_rpm").get<double>(), 3000.0, 10.0);
  EXPECT_LT(number(moves, "tracking_error", "max_deg"), 0.3);
}

TEST(ServoDemo, TextNamesBothWays) {
  const Finished finished = run({"servo-demo", "--virtual", "--seconds", "0.2"});
  EXPECT_EQ(finished.exit_code, 0);
  for (const char* text : {"raw differencing", "estimator", "tracking error rms", "[arcsec]", "extrapolated",
                           "T1 violations, by the encoder", "in virtual time"})
    EXPECT_NE(finished.out.find(text), std::string::npos) << text << '\n' << finished.out;
}

TEST(ServoDemo, RealTimeAccountsForEveryPeriod) {
  const Json result = demo({"--seconds", "0.3", "--feedback", "estimator"});
  const Json run = run_of(result, "estimator");
  const Json& periods = run.at("periods");
  const auto counted = periods.at("fresh").get<std::int64_t>() +
                       periods.at("extrapolated").get<std::int64_t>() +
                       periods.at("invalid").get<std::int64_t>() + periods.at("waiting").get<std::int64_t>();
  EXPECT_EQ(counted, run.at("lateness").at("samples").get<std::int64_t>())
      << "each control instant was judged";
  EXPECT_EQ(run.at("t1_violations"), 0);
  EXPECT_EQ(result.at("clock"), "real time");
}

TEST(ServoDemo, CtrlCEndsItWithAReport) {
  Process process({"servo-demo", "--seconds", "600", "--json"});
  std::this_thread::sleep_for(std::chrono::milliseconds(700));
  process.send_signal(SIGINT);
  const Finished finished = process.wait();
  EXPECT_FALSE(finished.timed_out);
  EXPECT_EQ(finished.exit_code, 0) << finished.err;
  if (!finished.out.empty()) {
    EXPECT_EQ(Json::parse(finished.out).at("runs").size(), 1U);
  }
}

TEST(ServoDemo, AnAxisThatCannotBeSwitchedOnIsAFailure) {
  const Finished finished = run({"servo-demo", "sim:lost=1", "--virtual"});
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_NE(finished.err.find("tm485: timeout:"), std::string::npos) << finished.err;
  EXPECT_TRUE(finished.out.empty());
}

TEST(ServoDemo, WhatCannotBeUnderstoodOrDoneIsExitCode2) {
  const std::vector<Process::Arguments> wrong{
      {"/dev/ttyUSB0"},
      {"sim:rpm=3000"},
      {"sim:motion=sine:1:1"},
      {"sim:nonsense=1"},
      {"--seconds", "soon"},
      {"--seconds", "0"},
      {"--seconds", "2h"},
      {"--amplitude", "90"},
      {"--amplitude", "0deg"},
      {"--amplitude", "2 furlongs"},
      {"--frequency", "0"},
      {"--frequency", "100Hz"},
      {"--speed", "fast"},
      {"--speed", "0"},
      {"--speed", "7000rpm"},
      {"--load", "3kg"},
      {"--load", "9Nm"},
      {"--bandwidth", "9kHz"},
      {"--bandwidth", "0"},
      {"--bandwidth", "500Hz"},
      {"--velocity-loop", "2kHz"},
      {"--drift", "1%"},
      {"--drift", "much"},
      {"--hold", "1"},
      {"--outage", "1s"},
      {"--outage", "-1ms"},
  };
  for (Process::Arguments arguments : wrong) {
    std::string shown;
    for (const std::string& argument : arguments) shown += argument + " ";
    arguments.insert(arguments.begin(), "servo-demo");
    arguments.emplace_back("--virtual");
    const Finished finished = run(arguments);
    EXPECT_EQ(finished.exit_code, 2) << shown << finished.err;
    EXPECT_NE(finished.err.find("remedy:"), std::string::npos) << shown << finished.err;
    EXPECT_TRUE(finished.out.empty()) << shown << finished.out;
  }
  for (Process::Arguments arguments : {Process::Arguments{"--speed", "1000rpm", "--frequency", "1Hz"},
                                       {"--feedback", "none"},
                                       {"--id", "1"},
                                       {"--states", "4"},
                                       {"--priority", "100"}}) {
    arguments.insert(arguments.begin(), "servo-demo");
    EXPECT_EQ(run(arguments).exit_code, 2) << arguments[1];
  }
}

}  // namespace
}  // namespace tm485::test
