// tm485 eeprom read, write, dump, verify and diff.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "cli/process.hpp"
#include "cli/simulator.hpp"
#include "cli/terminal.hpp"

namespace tm485::test {
namespace {

using Json = nlohmann::json;

std::string content(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

/// Bytes of which no two pages are alike.
std::string pattern(std::size_t size = 889) {
  std::string bytes(size, '\0');
  for (std::size_t i = 0; i < size; ++i) bytes[i] = static_cast<char>((i * 37 + i / 127) & 0xFF);
  return bytes;
}

Json object(const Finished& finished) {
  EXPECT_EQ(finished.lines().size(), 1U) << finished.out << finished.err;
  return finished.lines().empty() ? Json() : Json::parse(finished.lines().at(0));
}

void expect_refused(const Finished& finished, const std::string& name) {
  EXPECT_EQ(finished.exit_code, 2) << finished.err;
  EXPECT_TRUE(finished.out.empty()) << finished.out;
  EXPECT_NE(finished.err.find("tm485: " + name + ":"), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("remedy:"), std::string::npos) << finished.err;
}

TEST(EepromDump, WritesBothFormatsWithinTheLimit) {
  const TemporaryFolder folder;
  const std::string raw = folder.path("image.bin");
  const Json dump = object(run({"eeprom", "dump", "sim:", "-o", raw, "--virtual", "--json"}));
  EXPECT_EQ(content(raw), std::string(889, '\xFF'));
  EXPECT_EQ(dump.at("bytes"), 889);
  EXPECT_EQ(dump.at("pages"), 7);
  EXPECT_EQ(dump.at("enid"), 17);
  EXPECT_EQ(dump.at("format"), "bin");
  EXPECT_EQ(dump.at("crc32"), "B3DE789A");
  EXPECT_EQ(dump.at("writes"), 0);
  EXPECT_LE(dump.at("read_ns").get<std::int64_t>(), 1.05 * (889 * 40e3 + 7 * 18e6));

  const std::string json = folder.path("image.json");
  EXPECT_EQ(run({"eeprom", "dump", "sim:", "-o", json, "--virtual"}).exit_code, 0);
  const Finished again = run({"eeprom", "dump", "sim:eeprom_seed=2", "-o", json, "--virtual"});
  EXPECT_EQ(again.exit_code, 2) << "it may be the only image of something";
  EXPECT_NE(again.err.find("tm485: file_exists:"), std::string::npos) << again.err;
  EXPECT_EQ(run({"eeprom", "dump", "sim:", "-o", json, "--virtual", "--yes"}).exit_code, 0);
  const Json image = Json::parse(content(json));
  EXPECT_EQ(image.at("pages").size(), 7U);
  EXPECT_EQ(image.at("enid"), 17);
  EXPECT_EQ(image.at("crc32"), "B3DE789A");
  EXPECT_EQ(image.at("pages").at("6"), [] {
    std::string page;
    for (int i = 0; i < 127; ++i) page += "FF";
    return page;
  }());
  EXPECT_EQ(run({"eeprom", "verify", "sim:", json, "--virtual"}).exit_code, 0);
  EXPECT_EQ(run({"eeprom", "verify", "sim:", raw, "--virtual"}).exit_code, 0);
  EXPECT_EQ(run({"eeprom", "diff", "sim:", raw, "--virtual"}).exit_code, 0);
}

TEST(EepromDump, ABadPlaceForTheFileIsAFailure) {
  const TemporaryFolder folder;
  const Finished finished = run({"eeprom", "dump", "sim:", "-o", folder.path("no/image.bin"), "--virtual"});
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_NE(finished.err.find("tm485: file_failed:"), std::string::npos) << finished.err;
}

TEST(EepromVerify, SaysWhichBytesDiffer) {
  const TemporaryFolder folder;
  std::string bytes(889, '\xFF');
  bytes[2 * 127 + 9] = '\x12';
  const std::string file = folder.write("image.bin", bytes);
  const Finished verify = run({"eeprom", "verify", "sim:", file, "--virtual"});
  EXPECT_EQ(verify.exit_code, 1);
  EXPECT_NE(verify.err.find("page 2, address   9: wanted 12, found FF"), std::string::npos) << verify.err;
  const Finished diff = run({"eeprom", "diff", "sim:", file, "--virtual"});
  EXPECT_EQ(diff.exit_code, 1);
  EXPECT_EQ(diff.out, "page 2, address   9: file 12, encoder FF\n");
  const Finished finished = run({"eeprom", "diff", "sim:", file, "--virtual", "--json"});
  EXPECT_EQ(finished.exit_code, 1);
  const Json json = object(finished);
  EXPECT_EQ(json.at("equal"), false);
  EXPECT_EQ(json.at("differing"), 1);
  EXPECT_EQ(json.at("differences"), Json::parse(R"([{"page":2,"address":9,"wanted":18,"found":255}])"));
}

TEST(EepromVerify, AFileThatDoesNotFitIsRefused) {
  const TemporaryFolder folder;
  const std::string file = folder.write("image.bin", pattern());
  expect_refused(run({"eeprom", "verify", "sim:profile=tformat_17", file, "--virtual"}), "image_size");
  expect_refused(run({"eeprom", "verify", "sim:", folder.write("short.bin", "x"), "--virtual"}),
                 "image_size");
  expect_refused(run({"eeprom", "verify", "sim:", folder.write("a.json", "x"), "--virtual"}), "image_format");
  expect_refused(run({"eeprom", "diff", "sim:", folder.path("none.bin"), "--virtual"}), "file_failed");
}

TEST(EepromRead, ShowsThePlaceThatWasAskedFor) {
  const TemporaryFolder folder;
  const std::string image = folder.write("eeprom.bin", pattern());
  Simulator simulator({"--pty", "--eeprom", image});
  const Finished read =
      run({"eeprom", "read", simulator.port(), "--page", "3", "--addr", "0x10", "--count", "3"});
  EXPECT_EQ(read.exit_code, 0) << read.err;
  // (3 * 127 + 16 + i) * 37 + 3
  EXPECT_EQ(read.out, "3:16   64 89 AE\n");
  const Json json =
      object(run({"eeprom", "read", simulator.port(), "--page", "6", "--addr", "126", "--json"}));
  EXPECT_EQ(json.at("hex"), "5E");
  EXPECT_EQ(json.at("page"), 6);
  EXPECT_EQ(json.at("address"), 126);
}

TEST(EepromRead, PlacesThatAreNoneAreRefused) {
  using Strings = std::vector<const char*>;
  for (const Strings& place :
       {Strings{"7", "0", "1"}, {"0", "127", "1"}, {"0", "120", "8"}, {"6", "500", "1"}})
    expect_refused(run({"eeprom", "read", "sim:", "--page", place[0], "--addr", place[1], "--count", place[2],
                        "--virtual"}),
                   "bad_address");
  EXPECT_EQ(run({"eeprom", "read", "sim:", "--page", "0"}).exit_code, 2);
  EXPECT_EQ(run({"eeprom", "read", "sim:", "--page", "0", "--addr", "0", "--count", "0"}).exit_code, 2);
  EXPECT_EQ(run({"eeprom"}).exit_code, 2);
}

TEST(EepromWrite, ChangesTheseBytesAndNoOthers) {
  const TemporaryFolder folder;
  const std::string image = folder.write("eeprom.bin", pattern());
  Simulator simulator({"--pty", "--eeprom", image});
  const Json json = object(run({"eeprom", "write", simulator.port(), "--page", "2", "--addr", "5", "--hex",
                                "A5 5A", "--yes", "--json"}));
  std::string expected = pattern();
  expected[2 * 127 + 5] = '\xA5';
  expected[2 * 127 + 6] = '\x5A';
  EXPECT_EQ(content(image), expected);
  EXPECT_EQ(json.at("hex"), "A55A");
  EXPECT_EQ(json.at("differing"), 2);
  EXPECT_EQ(json.at("writes"), 2);
  EXPECT_EQ(json.at("verified"), 889);
  // Again: nothing is worn.
  EXPECT_EQ(object(run({"eeprom", "write", simulator.port(), "--page", "2", "--addr", "5", "--hex", "A55A",
                        "--yes", "--json"}))
                .at("writes"),
            0);
}

TEST(EepromWrite, AsksFirst) {
  const Process::Arguments write{"eeprom", "write", "sim:",  "--page", "0",
                                 "--addr", "1",     "--hex", "12",     "--virtual"};
  expect_refused(run(write), "not_confirmed");
  const Finished no = run_at_terminal(write, "(type yes)", "y");
  EXPECT_EQ(no.exit_code, 2);
  EXPECT_NE(no.out.find("tm485: declined:"), std::string::npos) << no.out;
  const Finished yes = run_at_terminal(write, "(type yes)", "Yes");
  EXPECT_EQ(yes.exit_code, 0);
  EXPECT_NE(yes.out.find("1 bytes written"), std::string::npos) << yes.out;
  EXPECT_NE(yes.out.find("] 0 of 889 bytes, 0.2 s left"), std::string::npos) << yes.out;
}

TEST(EepromWrite, BadBytesAreRefused) {
  for (const char* hex : {"", "A", "XX"})
    EXPECT_EQ(
        run({"eeprom", "write", "sim:", "--page", "0", "--addr", "0", "--hex", hex, "--yes", "--virtual"})
            .exit_code,
        2)
        << hex;
}

TEST(EepromWrite, AWornEepromIsNamed) {
  const Finished finished = run({"eeprom", "write", "sim:eeprom_fail=1", "--page", "1", "--addr", "3",
                                 "--hex", "12", "--yes", "--virtual"});
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_NE(finished.err.find("tm485: eeprom_mismatch:"), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("page 1, address 3 (wanted 12, found FF)"), std::string::npos) << finished.err;
}

}  // namespace
}  // namespace tm485::test
