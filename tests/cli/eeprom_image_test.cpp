// Images, journals and the files that hold them.
#include "eeprom_image.hpp"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <numeric>

#include "cli/process.hpp"
#include "eeprom_journal.hpp"
#include "safe_file.hpp"

namespace tm485::test {
namespace {

using cli::EepromImage;
using cli::EepromShape;
using cli::ImageFormat;

constexpr EepromShape kShape{3, 127};

EepromImage some_image() {
  EepromImage image;
  image.shape = kShape;
  image.bytes.resize(kShape.size());
  std::iota(image.bytes.begin(), image.bytes.end(), std::uint8_t{7});
  image.enid = 0x11;
  image.profile = "my \"motor\"";
  image.date = "2026-01-31T12:00:00Z";
  return image;
}

std::string replaced(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  return text.replace(at, from.size(), to);
}

std::string problem_name(const std::string& content, ImageFormat format, EepromShape shape = kShape) {
  const auto parsed = parse_image(content, format, shape, "f");
  if (parsed) return {};
  EXPECT_EQ(parsed.error().exit_code, cli::kExitUsage);
  EXPECT_FALSE(parsed.error().remedy.empty());
  return parsed.error().name;
}

TEST(EepromImage, TheChecksumIsTheOneThatEverybodyKnows) {
  const std::string digits = "123456789";
  const std::vector<std::uint8_t> bytes(digits.begin(), digits.end());
  EXPECT_EQ(cli::crc32_of(bytes), 0xCBF43926U);
  EXPECT_EQ(cli::crc32_text(bytes), "CBF43926");
}

TEST(EepromImage, BothFormatsComeBackAsTheyWere) {
  const EepromImage image = some_image();
  const auto json = parse_image(image_text(image, ImageFormat::json), ImageFormat::json, kShape, "f");
  ASSERT_TRUE(json) << json.error().cause;
  EXPECT_EQ(json->bytes, image.bytes);
  EXPECT_EQ(json->enid, image.enid);
  EXPECT_EQ(json->profile, image.profile);
  EXPECT_EQ(json->date, image.date);
  const std::string raw = image_text(image, ImageFormat::raw);
  EXPECT_EQ(raw.size(), kShape.size());
  const auto again = parse_image(raw, ImageFormat::raw, kShape, "f");
  ASSERT_TRUE(again);
  EXPECT_EQ(again->bytes, image.bytes);
  EXPECT_FALSE(again->enid);
}

TEST(EepromImage, TheFormatFollowsTheName) {
  EXPECT_EQ(cli::image_format("a.json", ""), ImageFormat::json);
  EXPECT_EQ(cli::image_format("a.bin", ""), ImageFormat::raw);
  EXPECT_EQ(cli::image_format("json", ""), ImageFormat::raw);
  EXPECT_EQ(cli::image_format("a.json", "bin"), ImageFormat::raw);
  EXPECT_EQ(cli::image_format("a", "json"), ImageFormat::json);
}

TEST(EepromImage, WhatIsNoImageIsRefused) {
  const std::string good = image_text(some_image(), ImageFormat::json);
  const std::string raw = image_text(some_image(), ImageFormat::raw);
  EXPECT_EQ(problem_name(good, ImageFormat::json), "");
  EXPECT_EQ(problem_name(raw.substr(1), ImageFormat::raw), "image_size");
  EXPECT_EQ(problem_name(raw + '\0', ImageFormat::raw), "image_size");
  EXPECT_EQ(problem_name("", ImageFormat::raw), "image_size");
  EXPECT_EQ(problem_name(good, ImageFormat::json, {2, 127}), "image_size");
  EXPECT_EQ(problem_name(good, ImageFormat::json, {4, 127}), "image_size");
  EXPECT_EQ(problem_name(good, ImageFormat::json, {3, 126}), "image_size");
  EXPECT_EQ(problem_name(replaced(good, "0708090A", "0708090B"), ImageFormat::json), "image_checksum");
  EXPECT_EQ(problem_name(replaced(good, "\"crc32\": \"", "\"crc32\": \"0"), ImageFormat::json),
            "image_checksum");
  EXPECT_EQ(problem_name(replaced(good, "0708090A", "0708090G"), ImageFormat::json), "image_format");
  EXPECT_EQ(problem_name(replaced(good, "\"1\"", "\"9\""), ImageFormat::json), "image_format");
  EXPECT_EQ(problem_name(replaced(good, "\"version\": 1", "\"version\": 2"), ImageFormat::json),
            "image_format");
  for (const char* text : {"", "{", "[]", "null", "{}", "{\"format\": 3}"})
    EXPECT_EQ(problem_name(text, ImageFormat::json), "image_format") << text;
}

TEST(EepromJournal, ComesBackAsItWasAndIsChecked) {
  const TemporaryFolder folder;
  const std::string path = folder.path("journal");
  const auto none = cli::load_journal(path, kShape);
  ASSERT_TRUE(none);
  EXPECT_FALSE(none->has_value());
  cli::EepromJournal journal{cli::JournalState::restored, "sim:", "backup", some_image(), some_image()};
  journal.before.bytes[5] ^= 1U;
  ASSERT_TRUE(save_journal(path, journal));
  const auto loaded = cli::load_journal(path, kShape);
  ASSERT_TRUE(loaded) << loaded.error().cause;
  ASSERT_TRUE(loaded->has_value());
  EXPECT_EQ((*loaded)->state, cli::JournalState::restored);
  EXPECT_EQ((*loaded)->port, "sim:");
  EXPECT_EQ((*loaded)->backup_file, "backup");
  EXPECT_EQ((*loaded)->wanted.bytes, journal.wanted.bytes);
  EXPECT_EQ((*loaded)->before.bytes, journal.before.bytes);
  EXPECT_FALSE(cli::load_journal(path, {2, 127}));
  EXPECT_FALSE(cli::load_journal(folder.write("empty", ""), kShape));
  EXPECT_FALSE(cli::load_journal(folder.write("other", "{\"format\": \"x\"}"), kShape));
}

TEST(SafeFile, ReplacesWholeAndCreatesOnlyWhatIsNew) {
  const TemporaryFolder folder;
  const std::string path = folder.write("file", "old");
  std::filesystem::create_symlink(path, folder.path("link"));
  ASSERT_TRUE(cli::replace_file(folder.path("link"), "new"));
  EXPECT_TRUE(std::filesystem::is_symlink(folder.path("link")));
  EXPECT_EQ(*cli::read_whole_file(path, 10), "new");
  const auto exists = cli::create_file(path, "newer");
  ASSERT_FALSE(exists);
  EXPECT_EQ(exists.error().name, "file_exists");
  EXPECT_EQ(*cli::read_whole_file(path, 10), "new");
  EXPECT_TRUE(cli::create_file(folder.path("fresh"), "x"));
  EXPECT_FALSE(cli::replace_file(folder.path("nowhere/file"), "x"));
  EXPECT_FALSE(cli::read_whole_file(path, 2));
  EXPECT_FALSE(cli::read_whole_file(folder.path("nothing"), 2));
  // No leftovers.
  const std::filesystem::directory_iterator files(folder.path("."));
  EXPECT_EQ(std::distance(begin(files), end(files)), 3);
}

}  // namespace
}  // namespace tm485::test
