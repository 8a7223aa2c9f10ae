// tm485 decode, end to end: the golden vectors through a pipe, requests and replies told apart, bad input named.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <nlohmann/json.hpp>

#include "cli/process.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;

std::vector<Json> vectors(const std::string& file) {
  std::ifstream stream(std::string(TM485_TEST_VECTORS) + "/" + file);
  EXPECT_TRUE(stream.good()) << file;
  return Json::parse(stream).at("vectors").get<std::vector<Json>>();
}

/// A decoded value of the vectors: a number, or bytes in hexadecimal (in the TM485 file, except for ABS and ABM).
std::int64_t value_of(const Json& value) {
  return value.is_string() ? std::stoll(value.get<std::string>(), nullptr, 16) : value.get<std::int64_t>();
}

std::vector<Json> decode(const std::vector<std::string>& frames, std::vector<std::string> arguments = {}) {
  std::string input;
  for (const std::string& frame : frames) input += frame + "\n";
  arguments.insert(arguments.begin(), {"decode", "--json"});
  const Finished finished = run(arguments, input);
  EXPECT_FALSE(finished.timed_out);
  std::vector<Json> objects;
  for (const std::string& line : finished.lines()) objects.push_back(Json::parse(line));
  EXPECT_EQ(objects.size(), frames.size()) << finished.err;
  objects.resize(frames.size());
  return objects;
}

Json decode_one(const std::string& frame, std::vector<std::string> arguments = {}) {
  return decode({frame}, std::move(arguments)).front();
}

void expect_fields(const Json& object, const Json& vector) {
  const Json& decoded = vector.at("decoded");
  const std::string hex = vector.at("hex");
  for (const char* key : {"sf", "abs", "abm", "enid", "almc", "edf", "crc"}) {
    if (!decoded.contains(key)) continue;
    ASSERT_TRUE(object.contains(key)) << hex << " " << key << " " << object;
    EXPECT_TRUE(object.at(key).is_number_integer()) << hex << " " << key;
    EXPECT_EQ(object.at(key).get<std::int64_t>(), value_of(decoded.at(key))) << hex << " " << key;
  }
  if (object.at("kind") == "reply" && decoded.contains("busy")) {
    EXPECT_EQ(object.at("busy").get<bool>(), value_of(decoded.at("busy")) != 0) << hex;
  }
  if (decoded.contains("abm_signed16")) {
    EXPECT_EQ(object.at("turns"), decoded.at("abm_signed16")) << hex;
  }
}

void expect_vectors(std::vector<Json> all) {
  std::vector<std::string> frames;
  for (const Json& vector : all) frames.push_back(vector.at("hex"));
  const std::vector<Json> objects = decode(frames);
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (all[i].at("kind") == "negative") {
      EXPECT_EQ(objects[i].at("ok"), false) << frames[i];
      EXPECT_EQ(objects[i].at("error"), all[i].at("decoded").at("expect")) << frames[i];
      EXPECT_FALSE(objects[i].contains("abs")) << frames[i];
      continue;
    }
    if (frames[i] == "32" || frames[i] == "EA") {  // the CF alone: a good one, but no whole request
      EXPECT_EQ(objects[i].at("id"), all[i].at("decoded").at("data_id")) << frames[i];
      EXPECT_EQ(objects[i].at("error"), "length_error") << frames[i];
      continue;
    }
    EXPECT_EQ(objects[i].at("ok"), true) << frames[i] << " " << objects[i];
    EXPECT_FALSE(objects[i].contains("error")) << frames[i];
    expect_fields(objects[i], all[i]);
  }
}

TEST(Decode, GoldenVectorsInOrderAndInReverse) {
  for (const char* file : {"vectors_tm485.json", "vectors_tformat.json"}) {
    std::vector<Json> all = vectors(file);
    ASSERT_GT(all.size(), 20U);
    expect_vectors(all);
    std::ranges::reverse(all);
    expect_vectors(all);
  }
}

TEST(Decode, AFullReplyHasEveryFieldOfId3AndNoOther) {
  const Json object = decode_one("1A 20 13 6E 01 11 FF FF 00 C0 97");
  const Json expected = {{"kind", "reply"},
                         {"id", 3},
                         {"ok", true},
                         {"abs", 93715},
                         {"abm", 65535},
                         {"turns", -1},
                         {"enid", 17},
                         {"sf", 32},
                         {"almc", 192},
                         {"crc", 0x97},
                         {"alarms", {"multi_turn_or_battery", "battery_error", "battery_alarm"}}};
  EXPECT_EQ(object, expected);
}

TEST(Decode, ARequestOfOneByteHasNoCrc) {
  EXPECT_EQ(decode_one("1A"), Json({{"kind", "request"}, {"id", 3}, {"ok", true}}));
}

TEST(Decode, FourBytesOfId6AreARequestUnlessBusy) {
  EXPECT_EQ(decode_one("32 05 A5 92"),
            Json({{"kind", "request"}, {"id", 6}, {"ok", true}, {"adf", 5}, {"edf", 165}, {"crc", 146}}));
  EXPECT_EQ(decode_one("32 85 A5 12"), Json({{"kind", "reply"},
                                             {"id", 6},
                                             {"ok", true},
                                             {"adf", 0x85},
                                             {"edf", 165},
                                             {"busy", true},
                                             {"crc", 0x12}}));
  EXPECT_EQ(decode_one("32 05 A5 92", {"--as", "reply"}), Json({{"kind", "reply"},
                                                                {"id", 6},
                                                                {"ok", true},
                                                                {"adf", 5},
                                                                {"edf", 165},
                                                                {"busy", false},
                                                                {"crc", 146}}));
  EXPECT_EQ(decode_one("EA 05 EF"),
            Json({{"kind", "request"}, {"id", 13}, {"ok", true}, {"adf", 5}, {"crc", 0xEF}}));
  EXPECT_EQ(decode_one("02", {"--as", "reply"}).at("error"), "length_error");
}

TEST(Decode, LengthsOfNoFrameAreRefused) {
  for (std::size_t length = 1; length <= 40; ++length) {
    std::string hex = "1A";
    for (std::size_t i = 1; i < length; ++i) hex += " 00";
    const Json object = decode_one(hex);
    if (length == 1) continue;
    EXPECT_EQ(object.at("ok"), false) << length;
    EXPECT_EQ(object.at("error"), length == 11 ? "crc_error" : "length_error") << length;
    EXPECT_EQ(object.at("id"), 3) << length;
  }
}

TEST(Decode, AnIdIsGivenOnlyIfTheControlFieldIsGood) {
  EXPECT_FALSE(decode_one("82").contains("id"));
  EXPECT_FALSE(decode_one("03").contains("id"));
  EXPECT_FALSE(decode_one("A2").contains("id"));
  EXPECT_EQ(decode_one("02 00 CD AB 01 64").at("id"), 0);
}

TEST(Decode, AProfileRefusesButTheFieldsAreShown) {
  const std::string frame = "02 00 CD AB 03 67";  // ABS needs 18 bits
  EXPECT_EQ(decode_one(frame).at("ok"), true);
  const Json refused = decode_one(frame, {"--profile", "tm485_17"});
  EXPECT_EQ(refused.at("ok"), false);
  EXPECT_EQ(refused.at("error"), "abs_out_of_range");
  EXPECT_EQ(refused.at("abs"), 0x03ABCD);
  EXPECT_EQ(decode_one("92 00 17 85", {"--profile", "tm485_17"}).at("error"), "enid_unexpected");
  EXPECT_EQ(decode_one("92 00 17 85", {"--profile", "tformat_17"}).at("ok"), true);
}

TEST(Decode, BytesAreUnderstoodAsPeopleWriteThem) {
  for (const char* text :
       {"0x92,0x00,0x11,0x83", "92001183", "92 00 11 83 # ENID", "\t92, 00,11 ,83\r", "0x92001183"})
    EXPECT_EQ(decode_one(text).at("enid"), 17) << text;
}

TEST(Decode, EachArgumentIsAFrame) {
  const Finished several = run({"decode", "--json", "02", "8A", "92 00 11 83"});
  ASSERT_EQ(several.lines().size(), 3U);
  EXPECT_EQ(Json::parse(several.lines()[1]).at("id"), 1);
  EXPECT_EQ(several.exit_code, 0);
}

TEST(Decode, BytesOfOneFrameMayBeSingleArguments) {
  const Finished one = run({"decode", "--json", "92", "00", "11", "83"});
  ASSERT_EQ(one.lines().size(), 1U);
  EXPECT_EQ(Json::parse(one.lines()[0]).at("enid"), 17);
}

TEST(Decode, BadHexEndsAnArgumentButOnlyALineOfInput) {
  for (const char* bad : {"zz", "1", "0x", "1A 2G", "", "  "}) {
    const Finished finished = run({"decode", "--json", "02", bad});
    EXPECT_EQ(finished.exit_code, 2) << bad;
    EXPECT_TRUE(finished.out.empty()) << bad;
    EXPECT_NE(finished.err.find("tm485: bad_hex:"), std::string::npos) << finished.err;
    EXPECT_NE(finished.err.find("remedy:"), std::string::npos) << finished.err;
  }
  const Finished lines = run({"decode", "--json"}, "02\nnothing\n\n# a comment\n8A\n");
  EXPECT_EQ(lines.exit_code, 1);
  ASSERT_EQ(lines.lines().size(), 3U);
  EXPECT_EQ(Json::parse(lines.lines()[1]).at("ok"), false);
  EXPECT_EQ(Json::parse(lines.lines()[1]).at("error"), "bad_hex");
  EXPECT_EQ(Json::parse(lines.lines()[2]).at("id"), 1);
}

TEST(Decode, OneBadFrameMakesTheExitCodeOne) {
  EXPECT_EQ(run({"decode"}, "02\n").exit_code, 0);
  EXPECT_EQ(run({"decode"}, "02\n03\n").exit_code, 1);
  EXPECT_EQ(run({"decode"}, "").exit_code, 0);
}

TEST(Decode, LongLinesAreRefusedAndSkipped) {
  const std::string input =
      std::string(5'000'000, 'A') + "\n02\n" + std::string(1000, 'A') + "\n" + std::string(10'000, ' ');
  const Finished finished = run({"decode", "--json"}, input);
  EXPECT_EQ(finished.exit_code, 1);
  ASSERT_EQ(finished.lines().size(), 4U);
  EXPECT_EQ(Json::parse(finished.lines()[0]).at("error"), "line_too_long");
  EXPECT_EQ(Json::parse(finished.lines()[1]).at("id"), 0);
  EXPECT_EQ(Json::parse(finished.lines()[2]).at("ok"), false);
  EXPECT_EQ(Json::parse(finished.lines()[3]).at("error"), "line_too_long");
}

TEST(Decode, ManyLinesAndBinaryRubbishAreSurvived) {
  std::string input;
  for (int i = 0; i < 100'000; ++i) input += "1A 20 13 6E 01 11 FF FF 00 C0 97\n";
  const Finished many = run({"decode", "--json"}, input);
  EXPECT_EQ(many.exit_code, 0);
  EXPECT_EQ(many.lines().size(), 100'000U);
  std::string rubbish;
  for (int i = 0; i < 200'000; ++i) rubbish += static_cast<char>(i * 7 + i / 256);
  const Finished finished = run({"decode", "--json"}, rubbish);
  EXPECT_EQ(finished.exit_code, 1);
  for (const std::string& line : finished.lines()) EXPECT_FALSE(Json::parse(line).at("ok").get<bool>());
}

TEST(Decode, PeopleReadNamesCausesAndRemedies) {
  const Finished finished = run({"decode", "1A 20 13 6E 01 11 FF FF 00 C0 97", "02 00 CD AB 01 64"});
  EXPECT_EQ(finished.exit_code, 1);
  for (const char* text : {"ABS 93715", "turns -1", "battery_error", "ALMC.6", "crc_error", "remedy:"})
    EXPECT_NE(finished.out.find(text), std::string::npos) << text << "\n" << finished.out;
}

}  // namespace
}  // namespace tm485::test
