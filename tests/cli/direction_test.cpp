// --direction, end to end: what is refused and why, and that auto is what it was before.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cli/process.hpp"
#include "cli/simulator.hpp"

namespace tm485::test {
namespace {

using ::testing::HasSubstr;
using Json = nlohmann::json;

TEST(Direction, ATextThatMeansNothingIsAMistakeInTheCommand) {
  for (const char* text : {"rts", "gpio", "gpio:17", "kernel:up", "gpio:0:1:2"}) {
    for (const char* command : {"info", "read", "monitor", "bench"}) {
      const Finished finished = run({command, "/dev/null", std::string("--direction=") + text});
      EXPECT_EQ(finished.exit_code, 2) << command << " " << text;
      EXPECT_THAT(finished.err, HasSubstr("bad_direction")) << command << " " << text;
      EXPECT_THAT(finished.err, HasSubstr("gpio:CHIP:LINE")) << command << " " << text;
      EXPECT_EQ(finished.out, "");
    }
  }
}

TEST(Direction, OnlyASerialDeviceHasADriverToSwitch) {
  const TemporaryFolder folder;
  for (const std::string& port : {std::string("sim:"), "unix:" + folder.path("socket")}) {
    for (const char* text : {"kernel", "gpio:DE"}) {
      const Finished finished = run({"read", port, "--direction", text});
      EXPECT_EQ(finished.exit_code, 2);
      EXPECT_THAT(finished.err, HasSubstr("bad_direction"));
      EXPECT_THAT(finished.err, HasSubstr("serial devices"));
    }
  }
}

TEST(Direction, ADriverWithoutRs485ModeIsNamedWithTheRemedy) {
  Simulator simulator({"--pty"});
  const Finished finished = run({"read", simulator.port(), "--direction", "kernel"});
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_THAT(finished.err, HasSubstr("open_failed"));
  EXPECT_THAT(finished.err, HasSubstr("TIOCGRS485"));
  EXPECT_THAT(finished.err, HasSubstr("--direction gpio"));
}

TEST(Direction, AMissingChipIsNamedAndThePortIsFreeAgain) {
  Simulator simulator({"--pty"});
  const Finished finished = run({"read", simulator.port(), "--direction", "gpio:gpiochip99:3"});
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_THAT(finished.err, ::testing::AnyOf(HasSubstr("gpiochip99"), HasSubstr("libgpiod-dev")));
  EXPECT_EQ(run({"read", simulator.port(), "-n", "1"}).exit_code, 0);
}

TEST(Direction, AutoSwitchesNothingAndWarnsOfNothing) {
  for (const Process::Arguments& arguments :
       {Process::Arguments{"bench", "sim:", "--virtual", "--seconds", "10ms", "--json"},
        Process::Arguments{"bench", "sim:", "--virtual", "--seconds", "10ms", "--json", "--direction",
                           "auto"}}) {
    const Finished finished = run(arguments);
    ASSERT_EQ(finished.exit_code, 0) << finished.err;
    const Json direction = Json::parse(finished.out).at("direction");
    EXPECT_EQ(direction, (Json{{"control", "auto"}}));
  }
}

}  // namespace
}  // namespace tm485::test
