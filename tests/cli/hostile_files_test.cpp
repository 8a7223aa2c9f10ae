// Files that somebody else has prepared: too large, pipes, links and leftovers at names that nobody has typed.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>

#include "eeprom_journal.hpp"
#include "plain_text.hpp"
#include "process.hpp"
#include "safe_file.hpp"

namespace tm485::test {
namespace {

namespace fs = std::filesystem;

std::string content(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

/// A gigabyte that takes no room on the disk.
std::string gigabyte(const TemporaryFolder& folder, const char* name) {
  const std::string path = folder.write(name, "");
  fs::resize_file(path, std::uintmax_t{1} << 30);
  return path;
}

TEST(HostileFiles, AGigabyteIsRefusedByItsSize) {
  const TemporaryFolder folder;
  const std::string profile = gigabyte(folder, "huge.toml");
  const Finished by_profile = run({"decode", "--profile", profile, "02"});
  EXPECT_EQ(by_profile.exit_code, 2);
  EXPECT_NE(by_profile.err.find("profile_file"), std::string::npos) << by_profile.err;
  for (const char* name : {"huge.json", "huge.bin"}) {
    const Finished by_image = run({"eeprom", "diff", "sim:", gigabyte(folder, name), "--virtual"});
    EXPECT_EQ(by_image.exit_code, 2) << name;
    EXPECT_NE(by_image.err.find("more than 65536 bytes"), std::string::npos) << by_image.err;
  }
  const auto journal = cli::load_journal(gigabyte(folder, "huge.journal"), {7, 127});
  ASSERT_FALSE(journal);
  EXPECT_NE(journal.error().cause.find("more than 131072 bytes"), std::string::npos) << journal.error().cause;
}

TEST(HostileFiles, OfAFileWithoutASizeNoMoreIsReadThanMayBe) {
  const auto endless = cli::read_whole_file("/proc/self/maps", 16);
  ASSERT_FALSE(endless);
  EXPECT_NE(endless.error().cause.find("more than 16 bytes"), std::string::npos) << endless.error().cause;
}

TEST(HostileFiles, NobodyWaitsForTheOtherEndOfAPipe) {
  const TemporaryFolder folder;
  const std::string pipe = folder.path("pipe.toml");
  ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
  const Finished by_profile = run({"decode", "--profile", pipe, "02"});
  EXPECT_FALSE(by_profile.timed_out);
  EXPECT_EQ(by_profile.exit_code, 2);
  EXPECT_NE(by_profile.err.find("not a regular file"), std::string::npos) << by_profile.err;
  EXPECT_FALSE(cli::load_journal(pipe, {7, 127}));
}

TEST(HostileFiles, APlantedJournalThatIsALinkIsNotFollowed) {
  const TemporaryFolder folder;
  const std::string image = folder.path("motor.bin");
  ASSERT_EQ(run({"eeprom", "dump", "sim:", "-o", image, "--virtual"}).exit_code, 0);
  const std::string victim = folder.write("victim", "mine");
  for (const std::string& target : {victim, folder.path("does_not_exist")}) {
    const std::string link = image + ".journal";
    fs::create_symlink(target, link);
    const Finished restored = run({"eeprom", "restore", "sim:eeprom_seed=3", image, "--virtual", "--yes"});
    EXPECT_EQ(restored.exit_code, 2) << restored.out;
    EXPECT_NE(restored.err.find("symbolic link"), std::string::npos) << restored.err;
    EXPECT_TRUE(fs::is_symlink(link));
    fs::remove(link);
  }
  EXPECT_EQ(content(victim), "mine");
  EXPECT_FALSE(fs::exists(folder.path("does_not_exist")));
}

TEST(HostileFiles, AJournalThatBecomesALinkIsNotWrittenThrough) {
  const TemporaryFolder folder;
  const std::string victim = folder.write("victim", "mine");
  const std::string link = folder.path("journal");
  fs::create_symlink(victim, link);
  cli::EepromJournal journal;
  journal.wanted.shape = journal.before.shape = {1, 2};
  journal.wanted.bytes = journal.before.bytes = {1, 2};
  EXPECT_FALSE(cli::save_journal(link, journal));
  EXPECT_EQ(content(victim), "mine");
}

TEST(HostileFiles, JournalsAreReadUpToABound) {
  const TemporaryFolder folder;
  const std::string base = folder.path("motor.bin.journal");
  cli::EepromJournal journal;
  journal.wanted.shape = journal.before.shape = {1, 2};
  journal.wanted.bytes = journal.before.bytes = {1, 2};
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(cli::create_journal(base, journal));
  const auto all = cli::journals_of(base, {1, 2}, 3);
  ASSERT_TRUE(all);
  EXPECT_EQ(all->size(), 3U);
  const auto refused = cli::journals_of(base, {1, 2}, 2);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().name, "too_many_journals");
}

TEST(HostileFiles, ABackupIsNotWrittenThroughALink) {
  const TemporaryFolder folder;
  const std::string victim = folder.write("victim", "mine");
  const std::string link = folder.path("backup.json");
  fs::create_symlink(victim, link);
  const auto created = cli::create_file(link, "x");
  ASSERT_FALSE(created);
  EXPECT_EQ(created.error().name, "file_exists");
  fs::remove(link);
  fs::create_symlink(folder.path("does_not_exist"), link);
  ASSERT_FALSE(cli::create_file(link, "x"));
  EXPECT_FALSE(fs::exists(folder.path("does_not_exist")));
  EXPECT_EQ(content(victim), "mine");
}

TEST(HostileFiles, WhatLiesAtTheNameOfTheNewFileIsNotWrittenTo) {
  const TemporaryFolder folder;
  const std::string victim = folder.write("victim", "mine");
  const std::string path = folder.write("file", "old");
  const std::string beside = path + "." + std::to_string(::getpid());
  fs::create_symlink(victim, beside + ".0.new");
  ASSERT_EQ(::mkfifo((beside + ".1.new").c_str(), 0600), 0);  // would wait for a reader
  fs::create_hard_link(victim, beside + ".2.new");
  ASSERT_TRUE(cli::replace_file(path, "new"));
  EXPECT_EQ(content(path), "new");
  EXPECT_EQ(content(victim), "mine");
  for (int i = 3; i < 16; ++i) std::ofstream(beside + "." + std::to_string(i) + ".new") << "x";
  EXPECT_FALSE(cli::replace_file(path, "newer"));
  EXPECT_EQ(content(path), "new");
}

TEST(HostileFiles, AFileThatIsReplacedKeepsItsPermissions) {
  const TemporaryFolder folder;
  const std::string path = folder.write("file", "old");
  for (const auto mode :
       {fs::perms::owner_read | fs::perms::owner_write, fs::perms::owner_all | fs::perms::others_read}) {
    fs::permissions(path, mode);
    ASSERT_TRUE(cli::replace_file(path, "new"));
    EXPECT_EQ(fs::status(path).permissions(), mode);
  }
}

// A terminal does what control characters say: it could be cleared, and show a remedy that is none.
TEST(HostileFiles, WhatTheySayDoesNotReachTheTerminalAsItIs) {
  EXPECT_EQ(cli::plain_text("a\x1b[2J\nb\tc\x7f \u009b \u00b5s"), "a?[2J?b?c? ?? \u00b5s");
  EXPECT_EQ(cli::plain_text(std::string_view("\0a", 2)), "?a");
  EXPECT_EQ(cli::plain_text("\x9b \xc2 \xe2\x82 \xe2\x82\xac \xff"), "? ? ?? \u20ac ?") << "no UTF-8";
  EXPECT_EQ(cli::plain_text("0123456789", 4), "0123...");
  EXPECT_EQ(cli::plain_lines("a\nb\x1b"), "a\nb?");

  const TemporaryFolder folder;
  const std::string image = folder.path("motor.bin");
  ASSERT_EQ(run({"eeprom", "dump", "sim:", "-o", image, "--virtual"}).exit_code, 0);
  cli::EepromJournal journal;
  journal.port = "\x1b]0;title\x07\n  remedy: type --undo" + std::string(100'000, 'x');
  journal.wanted.shape = journal.before.shape = {7, 127};
  journal.wanted.bytes = journal.before.bytes = std::vector<std::uint8_t>(889, 0xFF);
  ASSERT_TRUE(cli::create_journal(image + ".journal", journal));
  const Finished restored = run({"eeprom", "restore", "sim:eeprom_seed=3", image, "--virtual", "--yes"});
  EXPECT_NE(restored.exit_code, 0);
  EXPECT_NE(restored.err.find("?]0;title"), std::string::npos) << restored.err.substr(0, 1'000);
  EXPECT_EQ(restored.err.find('\x1b'), std::string::npos);
  EXPECT_EQ(restored.err.find("\n  remedy: type --undo"), std::string::npos);
  EXPECT_LT(restored.err.size(), 20'000U);

  const std::string profile = folder.write("x.toml", "name = \"\\u001b[2J\"");
  const Finished named = run({"decode", "--profile", profile, "02"});
  EXPECT_EQ(named.exit_code, 2);
  EXPECT_NE(named.err.find("without control characters"), std::string::npos) << named.err;
  const std::string key = folder.write("y.toml", "\"x\\n  remedy: run this\" = 1");
  const Finished keyed = run({"decode", "--profile", key, "02"});
  EXPECT_EQ(keyed.exit_code, 2);
  EXPECT_NE(keyed.err.find("x?  remedy: run this"), std::string::npos) << keyed.err;
}

}  // namespace
}  // namespace tm485::test
