// tm485 doctor against the simulator, one fault at a time: the right finding is named and no other fault.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <ostream>

#include "cli/process.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;

struct Case {
  const char* what;
  std::vector<std::string> arguments;  // port, options
  std::vector<std::string> findings;   // "fault:noise"; in their order
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.what; }

class DoctorFinds : public testing::TestWithParam<Case> {};

TEST_P(DoctorFinds, ThisAndNothingElse) {
  std::vector<std::string> arguments{"doctor", "--json"};
  arguments.insert(arguments.end(), GetParam().arguments.begin(), GetParam().arguments.end());
  const Finished finished = run(arguments);
  const Json json = Json::parse(finished.out);
  std::vector<std::string> found;
  bool fault = false;
  for (const Json& finding : json.at("findings")) {
    const auto severity = finding.at("severity").get<std::string>();
    fault = fault || severity == "fault";
    found.push_back(severity + ":" + finding.at("name").get<std::string>());
    for (const char* key : {"seen", "cause", "remedy"})
      EXPECT_NE(finding.at(key).get<std::string>(), "") << key;
  }
  EXPECT_EQ(found, GetParam().findings) << finished.out;
  EXPECT_EQ(finished.exit_code, fault ? 1 : 0);
  EXPECT_EQ(json.at("healthy").get<bool>(), !fault);
  EXPECT_EQ(finished.err, "");
}

std::string name_of(const testing::TestParamInfo<Case>& info) { return info.param.what; }

INSTANTIATE_TEST_SUITE_P(
    Healthy, DoctorFinds,
    testing::Values(Case{"tm485_17", {"sim:"}, {}},
                    Case{"tm485_17_battery", {"sim:profile=tm485_17_battery"}, {}},
                    Case{"tm485_17_st", {"sim:profile=tm485_17_st,rpm=3000"}, {}},
                    Case{"tm485_23", {"sim:profile=tm485_23"}, {}},
                    Case{"tm485_23_battery", {"sim:profile=tm485_23_battery,rpm=-6000"}, {}},
                    Case{"tformat_17", {"sim:profile=tformat_17"}, {}},
                    Case{"tformat_17_battery", {"sim:profile=tformat_17_battery,rpm=10"}, {}},
                    Case{"tformat_23", {"sim:profile=tformat_23,rpm=3000"}, {}},
                    Case{"tformat_23_battery", {"sim:profile=tformat_23_battery,start=0.7"}, {}},
                    Case{"EchoThatTheProfileKnows", {"sim:echo", "--echo"}, {}},
                    Case{"SlowToStart", {"sim:boot=900ms"}, {}},
                    Case{"AnotherRateThatTheProfileKnowsNot", {"sim:baud=2450000"}, {}},
                    Case{"EepromBusyForAMoment", {"sim:eeprom_busy=320ms"}, {}},
                    Case{"LateButInTheWindow", {"sim:t2=2.3us..5.5us"}, {}}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    NoReply, DoctorFinds,
    testing::Values(
        Case{"NoSupply", {"sim:power=off"}, {"fault:no_reply"}},
        Case{"SwappedPair", {"sim:swap=pair"}, {"fault:no_reply"}},
        Case{"SwappedPairAndEcho", {"sim:swap=pair,echo"}, {"fault:echo_only"}},
        Case{"NoSupplyAndEcho", {"sim:power=off,echo"}, {"fault:echo_only"}},
        Case{"SwappedReceiver", {"sim:swap=receive"}, {"fault:swapped_pair"}},
        Case{"SwappedReceiverTFormat", {"sim:swap=receive,profile=tformat_23"}, {"fault:swapped_pair"}},
        Case{"SwappedReceiverAndEcho", {"sim:swap=receive,echo"}, {"fault:swapped_pair"}},
        Case{"OneMegabit", {"sim:baud=1000000"}, {"fault:wrong_rate"}},
        Case{"FiveMegabit", {"sim:baud=5000000"}, {"fault:wrong_rate"}},
        Case{"TwoMegabit", {"sim:baud=2000000,profile=tformat_17"}, {"fault:wrong_rate"}},
        Case{"OldRateAndEcho", {"sim:baud=115200,echo"}, {"fault:wrong_rate"}},
        Case{"ARateThatNobodyUses", {"sim:baud=1790000"}, {"fault:no_reply"}}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Line, DoctorFinds,
    testing::Values(
        Case{"Echo", {"sim:echo"}, {"fault:own_echo"}},
        Case{"EchoExpectedInVain", {"sim:", "--echo"}, {"fault:echo_missing"}},
        Case{"ReleaseTooCloseToT2", {"sim:release=2.5us"}, {"warning:release_bound"}},
        Case{"LateReleaseOneByte", {"sim:release=3.3us"}, {"warning:release_bound", "fault:late_release"}},
        Case{"LateReleaseTwoBytes", {"sim:release=8us"}, {"warning:release_bound", "fault:late_release"}},
        Case{"LateReleaseThreeBytes",
             {"sim:release=12us,profile=tformat_23,rpm=3000"},
             {"warning:release_bound", "fault:late_release"}},
        Case{"LateReleaseOfAll", {"sim:release=100us"}, {"warning:release_bound", "fault:late_release"}},
        Case{"T2TooLong", {"sim:t2=8us"}, {"fault:t2_outside"}},
        Case{"T2TooShort", {"sim:t2=1us"}, {"fault:t2_outside"}},
        Case{"T2SometimesTooLong", {"sim:t2=5us..7us"}, {"fault:t2_outside"}},
        Case{"T2BeyondT1", {"sim:t2=200us"}, {"fault:t2_outside"}},
        Case{"Noise", {"sim:ber=1e-3"}, {"fault:noise"}},
        Case{"LessNoise", {"sim:ber=1e-4,profile=tformat_17,rpm=3000"}, {"fault:noise"}},
        Case{"HeavyNoise", {"sim:ber=1e-2"}, {"fault:noise"}},
        Case{"NoiseOnRequestsOnly", {"sim:ber=1e-3:0"}, {"fault:noise"}},
        Case{"LostReplies", {"sim:lost=0.02"}, {"fault:noise"}},
        Case{"NoiseAndEcho", {"sim:ber=1e-3,echo", "--echo"}, {"fault:noise"}},
        Case{"AFewErrors", {"sim:ber=5e-6"}, {"warning:occasional_errors"}},
        Case{"NoiseBeforeReplies", {"sim:glitch=0.02"}, {"fault:reply_start_disturbed"}},
        Case{"NoiseBeforeMostReplies", {"sim:glitch=0.7"}, {"fault:reply_start_disturbed"}}),
    name_of);

INSTANTIATE_TEST_SUITE_P(
    Encoder, DoctorFinds,
    testing::Values(
        Case{"AnotherEnid", {"sim:enid=17"}, {"fault:profile_differs"}},
        Case{"NoMultiTurn", {"sim:profile=tm485_17_st", "--profile", "tm485_17"}, {"fault:profile_differs"}},
        Case{"WiderThanTheProfile",
             {"sim:profile=tformat_23,rpm=3000", "--profile", "tformat_17"},
             {"fault:resolution_differs"}},
        Case{"WiderThanTheProfileAtRest",
             {"sim:profile=tformat_23,start=0.5", "--profile", "tformat_17"},
             {"fault:resolution_differs"}},
        Case{"NarrowerThanTheProfile",
             {"sim:profile=tformat_17,enid=17,rpm=-3000", "--profile", "tformat_23"},
             {"fault:resolution_differs"}},
        Case{"NoBattery",
             {"sim:profile=tformat_17", "--profile", "tformat_17_battery"},
             {"fault:battery_missing"}},
        Case{"ABatteryTooMany",
             {"sim:profile=tformat_17_battery", "--profile", "tformat_17"},
             {"note:battery_unused"}},
        Case{"CountingError", {"sim:almc=04"}, {"fault:alarm_fault"}},
        Case{"SingleTurnErrorWithoutAlmc", {"sim:sf=10"}, {"fault:alarm_fault"}},
        Case{"OverHeat", {"sim:almc=10"}, {"warning:alarm_warning"}},
        Case{"BatteryError", {"sim:profile=tformat_17_battery,almc=40"}, {"fault:alarm_fault"}},
        Case{"BatteryAlarm", {"sim:profile=tformat_17_battery,almc=80"}, {"warning:alarm_warning"}},
        Case{"AlarmsAndNoise",
             {"sim:almc=24,profile=tformat_17_battery,ber=1e-3"},
             {"fault:noise", "fault:alarm_fault", "fault:alarm_fault"}},
        Case{"EepromBusyForEver", {"sim:eeprom_busy=3600s"}, {"fault:eeprom_busy"}}),
    name_of);

}  // namespace
}  // namespace tm485::test
