// What can be typed and what is refused: help, versions, exit codes, profiles.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "cli/process.hpp"
#include "tm485/version.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;

TEST(Usage, VersionAndHelp) {
  const Finished version_text = run({"--version"});
  EXPECT_EQ(version_text.exit_code, 0);
  EXPECT_EQ(version_text.out, std::string("tm485 ") + TM485_VERSION_STRING + "\n");
  for (const char* command : {"", "decode", "info", "read", "monitor", "bench", "sim", "eeprom", "reset",
                              "list", "profiles", "campaign"}) {
    Process::Arguments arguments;
    if (*command != '\0') arguments.emplace_back(command);
    arguments.emplace_back("--help");
    const Finished help = run(arguments);
    EXPECT_EQ(help.exit_code, 0) << command;
    EXPECT_NE(help.out.find("Example"), std::string::npos) << command;
    EXPECT_NE(help.out.find(std::string("tm485 ") + command), std::string::npos) << command;
  }
}

TEST(Usage, WhatCannotBeUnderstoodIsExitCode2) {
  const std::vector<Process::Arguments> wrong{
      {},
      {"unknown"},
      {"read"},
      {"read", "sim:", "--id", "4"},
      {"read", "sim:", "-n", "-1"},
      {"read", "sim:", "-n", "many"},
      {"read", "sim:", "--units", "furlongs"},
      {"read", "sim:", "--nonsense"},
      {"read", "sim:", "--max-speed", "0"},
      {"read", "sim:", "--max-accel", "0"},
      {"read", "sim:", "--max-accel", "5 furlongs"},
      {"read", "sim:", "--max-accel", "200000000"},
      {"read", "sim:", "--latency", "100"},
      {"read", "sim:", "--latency", "11s"},
      {"read", "sim:", "--id", "0", "--period", "1s"},
      {"bench", "sim:", "--seconds", "0"},
      {"bench", "sim:", "--seconds", "soon"},
      {"monitor", "sim:", "--seconds", "-1"},
      {"decode", "--as", "answer", "02"},
      {"decode", "--profile", "nobody", "02"},
      {"sim", "--pty", "--unix", "/tmp/x"},
      {"sim", "--rpm", "fast"},
      {"sim", "--almc", "zz"},
      {"sim", "--profile", "nobody"},
      {"sim", "--plan", "lose replies=2"},
      {"sim", "--plan", "talker every=1ms"},
      {"sim", "--plan", "/nowhere/plan"},
      {"sim", "--plan", ""},
      {"sim", "--link", ""},
      {"sim", "--unix", ""},
      {"sim", "--eeprom", ""},
      {"sim", "--seed", ""},
      {"sim", "--seed", "abc"},
      {"sim", "--seed", "99999999999999999999"},
      {"sim", "--eeprom-seed", "-1"},
      {"campaign", "--cycles", "0"},
      {"campaign", "--seed", "-1"},
      {"campaign", "--plan", "lose sometimes=1"},
      {"campaign", "--replay", "1"},
      {"campaign", "--vcd", "x.vcd"},
  };
  for (const Process::Arguments& arguments : wrong) {
    const Finished finished = run(arguments);
    std::string shown;
    for (const std::string& argument : arguments) shown += argument + " ";
    EXPECT_EQ(finished.exit_code, 2) << shown << finished.err;
    EXPECT_FALSE(finished.err.empty()) << shown;
    EXPECT_TRUE(finished.out.empty()) << shown << finished.out;
  }
}

TEST(Profiles, AreListed) {
  const Finished finished = run({"profiles", "--json"});
  EXPECT_EQ(finished.exit_code, 0);
  std::vector<std::string> names;
  for (const std::string& line : finished.lines()) {
    const Json profile = Json::parse(line);
    names.push_back(profile.at("name"));
    EXPECT_TRUE(profile.at("t1").at("id3").is_number_integer());
  }
  for (const char* name : {"tm485_17", "tm485_23", "tformat_17", "tformat_23", "any"})
    EXPECT_NE(std::find(names.begin(), names.end(), name), names.end()) << name;
  EXPECT_EQ(run({"decode", "--profile", "list"}).out, run({"profiles"}).out);
}

/// Decodes an ENID 23 and a position with bit 17 under a profile file.
Finished decode_with(const std::string& file) {
  return run({"decode", "--json", "--profile", file, "92 00 17 85", "02 00 00 00 02 00"});
}

TEST(ProfileFile, EveryKeyIsUnderstood) {
  const TemporaryFolder folder;
  const std::string file = folder.write("all.toml", R"(
base = "tformat_17_battery"
name = "my motor"
single_turn_bits = 18
multi_turn_bits = 12
enids = [0x17, 0x42]
abm_reserved = 0xFFF000
multi_turn_start = -3
battery = true
reserved_status = { sf = 0x0F, almc = 0x00 }
bit_rate = 2_500_000
echo = false
t1 = { id0 = "45us", id3 = 70000, idc = "1ms", id6 = "9 ms" }
t2_min = "1.5us"
t2_max = "8us"
latch_offset = "-0.5us"
latch_uncertainty = 300
power_up_time = "2s"
boot_time_min = "10ms"
reset_count = 10
reset_spacing = "70us"
reset_zero_settle = "120ms"
eeprom_pages = 6
eeprom_page_bytes = 127
eeprom_write_time = "12ms"
eeprom_page_time = "20ms"
eeprom_holds_bus = true

[alarms]
battery_alarm = "fault"
over_heat = "ignore"
full_absolute_status = "warn"
)");
  const Finished finished = decode_with(file);
  EXPECT_EQ(finished.exit_code, 0) << finished.err << finished.out;
  EXPECT_EQ(run({"decode", "--profile", file, "92 00 11 83"}).exit_code, 1);
}

TEST(ProfileFile, ChangesTheBaseAndNothingElse) {
  const TemporaryFolder folder;
  EXPECT_EQ(decode_with("tm485_17").exit_code, 1);
  EXPECT_EQ(decode_with(folder.write("empty.toml", "")).exit_code, 1);
  EXPECT_EQ(decode_with(folder.write("any.toml", "base = \"any\"\n")).exit_code, 0);
  EXPECT_EQ(decode_with(folder.write("wide.toml", "enids = []\nsingle_turn_bits = 24\n")).exit_code, 0);
}

TEST(ProfileFile, ThePolicyOfAnAlarmIsObeyed) {
  const TemporaryFolder folder;
  const std::string calm =
      folder.write("calm.toml", "[alarms]\ncounting_error = \"ignore\"\nsingle_turn_error = \"warn\"\n");
  EXPECT_EQ(run({"info", "sim:almc=04"}).exit_code, 1);
  EXPECT_EQ(run({"info", "sim:almc=04", "--profile", calm}).exit_code, 0);
}

TEST(ProfileFile, MistakesAreNamedWithFileAndLine) {
  const TemporaryFolder folder;
  struct Mistake {
    const char* text;
    int line;
    const char* expected;
  };
  const std::vector<Mistake> mistakes{
      {"single_turn_bits = \n", 1, ""},
      {"# comment\nsingle_turn_bit = 17\n", 2, "unknown key 'single_turn_bit'"},
      {"single_turn_bits = 300\n", 1, "whole number from 0 to 255"},
      {"single_turn_bits = 30\n", 1, "must be 8 to 24"},
      {"single_turn_bits = \"17\"\n", 1, "whole number"},
      {"battery = 1\n", 1, "true or false"},
      {"\n\nt2_min = \"4 parsec\"\n", 3, "unit of time"},
      {"t2_min = \"4\"\n", 1, "unit is missing"},
      {"t2_min = 1.5\n", 1, "expected a time"},
      {"t2_min = \"8us\"\nt2_max = \"2us\"\n", 1, "window is empty"},
      {"t1 = { id4 = \"40us\" }\n", 1, "id0 to id3"},
      {"t1 = \"40us\"\n", 1, "a table"},
      {"[t1]\nid3 = \"20us\"\n", 1, "shorter than the exchange"},
      {"enids = 17\n", 1, "list of up to four"},
      {"enids = [1, 2, 3, 4, 5]\n", 1, "list of up to four"},
      {"enids = [256]\n", 1, "0 to 255"},
      {"[alarms]\nbattery = \"warn\"\n", 2, "unknown status bit 'battery'"},
      {"[alarms]\nover_heat = \"panic\"\n", 2, "\"ignore\", \"warn\" or \"fault\""},
      {"base = \"tm485_99\"\n", 1, "name of a preset"},
      {"base = 17\n", 1, "name of a preset"},
      {"reserved_status = { sf = 1, xy = 2 }\n", 1, "sf and almc"},
      {"echo = true\necho = false\n", 2, ""},
      {"name = \"\xff\xfe\"\n", 1, ""},
  };
  for (const Mistake& mistake : mistakes) {
    const std::string file = folder.write("bad.toml", mistake.text);
    const Finished finished = run({"read", "sim:", "--profile", file});
    EXPECT_EQ(finished.exit_code, 2) << mistake.text;
    EXPECT_EQ(finished.signal, 0) << mistake.text;
    EXPECT_NE(finished.err.find("tm485: bad_profile: " + file + ":" + std::to_string(mistake.line) + ": "),
              std::string::npos)
        << mistake.text << finished.err;
    EXPECT_NE(finished.err.find(mistake.expected), std::string::npos) << mistake.text << finished.err;
    EXPECT_NE(finished.err.find("remedy:"), std::string::npos) << mistake.text << finished.err;
  }
}

TEST(ProfileFile, WhatIsNoFileIsNamed) {
  const TemporaryFolder folder;
  for (const std::string& path :
       {folder.path("none.toml"), folder.path(""), folder.write("big.toml", std::string(1 << 20, '#'))}) {
    const Finished finished = run({"decode", "--profile", path, "02"});
    EXPECT_EQ(finished.exit_code, 2) << path;
    EXPECT_NE(finished.err.find("tm485: profile_file:"), std::string::npos) << finished.err;
  }
  const Finished nested =
      run({"decode", "--profile", folder.write("deep.toml", "name = " + std::string(100'000, '[')), "02"});
  EXPECT_EQ(nested.exit_code, 2);
}

}  // namespace
}  // namespace tm485::test
