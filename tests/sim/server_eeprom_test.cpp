// The file that the server keeps the EEPROM in. Nothing here asserts a duration.
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <fstream>
#include <iterator>

#include "running_server.hpp"

namespace tm485::sim {
namespace {

Bytes ask_until_done(const Client& client, const Bytes& request) {
  Bytes reply;
  for (int attempt = 0; attempt < 2000; ++attempt) {
    client.send(request);
    reply = client.receive(4);
    if (reply.size() != 4 || (reply[1] & 0x80) == 0) break;
  }
  return reply;
}

Bytes content_of(const std::string& path) {
  std::ifstream file{path, std::ios::binary};
  return Bytes{std::istreambuf_iterator<char>{file}, {}};
}

TEST(EepromFile, AMissingOneIsCreatedErased) {
  const TemporaryDirectory directory;
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(directory.file("eeprom")).has_value());
  EXPECT_EQ(content_of(directory.file("eeprom")), Bytes(889, 0xFF));
}

TEST(EepromFile, HasEveryWriteThatWasSeenComplete) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(path).has_value());
  Running running{std::move(server)};
  const Client client{Client::terminal(running.path())};
  Bytes expected(889, 0xFF);
  for (const int page : {0, 6}) {
    EXPECT_EQ(ask_until_done(client, write_request(127, page)), write_request(127, page));
    for (int address = 120; address < 127; ++address) {
      EXPECT_EQ(ask_until_done(client, write_request(address, address)), write_request(address, address));
      expected[static_cast<std::size_t>(page) * 127 + static_cast<std::size_t>(address)] =
          static_cast<std::uint8_t>(address);
    }
    // A reply that is not busy was sent after the save of the last write, or right before it: ask twice.
    EXPECT_EQ(ask_until_done(client, read_request(126)).at(2), 126);
    EXPECT_EQ(ask_until_done(client, read_request(126)).at(2), 126);
    EXPECT_EQ(content_of(path), expected);
  }
}

TEST(EepromFile, IsSavedWithoutAFurtherRequest) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(path).has_value());
  Running running{std::move(server)};
  const Client client{Client::terminal(running.path())};
  client.send(write_request(5, 0xA5));
  EXPECT_EQ(client.receive(4), write_request(5, 0xA5));
  for (int k = 0; k < kPatienceMs && content_of(path)[5] != 0xA5; ++k) std::this_thread::sleep_for(ms(1));
  EXPECT_EQ(content_of(path)[5], 0xA5);
}

TEST(EepromFile, HasNotTheWriteThatIsUnderWay) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(path).has_value());
  server.model().eeprom().write(5, 0xA5, -kNever);
  server.model().eeprom().write(6, 0x5A, std::chrono::hours{1});  // ends after this test
  Running running{std::move(server)};
  for (int k = 0; k < kPatienceMs && content_of(path)[5] != 0xA5; ++k) std::this_thread::sleep_for(ms(1));
  EXPECT_EQ(content_of(path)[5], 0xA5);
  EXPECT_EQ(content_of(path)[6], 0xFF);
}

TEST(EepromFile, AnOrderlyEndLetsTheWriteUnderWayEnd) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  Server server = pty_server("eeprom_write=3s");
  ASSERT_TRUE(server.keep_eeprom(path).has_value());
  Running running{std::move(server)};
  const Client client{Client::terminal(running.path())};
  client.send(write_request(5, 0xA5));
  EXPECT_EQ(client.receive(4), write_request(5, 0xA5));
  EXPECT_EQ(content_of(path)[5], 0xFF);
  running.join();
  EXPECT_EQ(content_of(path)[5], 0xA5);
}

TEST(EepromFile, ItsContentIsWhatTheEncoderHolds) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  std::ofstream{path, std::ios::binary} << std::string(6 * 127 - 1, 'a') << 'z';
  Server server = pty_server("eeprom_pages=6");
  ASSERT_TRUE(server.keep_eeprom(path).has_value());
  EXPECT_EQ(server.model().eeprom().read(0), 'a');
  EXPECT_EQ(server.model().eeprom().image().back(), 'z');
}

TEST(EepromFile, OfAnotherSizeIsRefusedAndLeftAlone) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  for (const std::size_t size : {0u, 762u, 888u, 890u}) {
    std::ofstream{path, std::ios::binary} << std::string(size, 'a');
    Server server = pty_server();
    const auto kept = server.keep_eeprom(path);
    ASSERT_FALSE(kept.has_value());
    EXPECT_NE(kept.error().reason.find(std::to_string(size) + " bytes"), std::string::npos);
    EXPECT_NE(kept.error().reason.find("889"), std::string::npos);
    EXPECT_EQ(content_of(path), Bytes(size, 'a'));
    EXPECT_EQ(server.model().eeprom().read(0), 0xFF);
  }
}

TEST(EepromFile, WhatIsNoFileOrCannotBeWrittenIsRefusedWithItsName) {
  const TemporaryDirectory directory;
  const std::string in_no_folder = directory.file("nowhere") + "/eeprom";
  for (const std::string& path : {directory.file("."), in_no_folder, std::string{"/dev/null"}}) {
    Server server = pty_server();
    const auto kept = server.keep_eeprom(path);
    ASSERT_FALSE(kept.has_value()) << path;
    EXPECT_NE(kept.error().what.find("EEPROM"), std::string::npos);
    EXPECT_EQ(kept.error().reason.find("regular file") != std::string::npos, path != in_no_folder);
    EXPECT_FALSE(kept.error().reason.empty());
    EXPECT_FALSE(kept.error().remedy.empty());
  }
}

TEST(EepromFile, ASaveReplacesTheFileBehindALinkAndKeepsItsMode) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  std::ofstream{path, std::ios::binary} << std::string(889, 'a');
  fs::permissions(path, fs::perms::owner_read | fs::perms::owner_write);
  fs::create_symlink(path, directory.file("link"));
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(directory.file("link")).has_value());
  EXPECT_TRUE(fs::is_symlink(directory.file("link")));
  EXPECT_EQ(fs::status(path).permissions(), fs::perms::owner_read | fs::perms::owner_write);
  EXPECT_FALSE(fs::exists(path + ".new"));
}

TEST(EepromFile, WhatLiesBesideItIsLeftAlone) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  const std::string victim = directory.file("victim");
  std::ofstream{victim, std::ios::binary} << "mine";
  const std::string beside = path + "." + std::to_string(::getpid());
  fs::create_hard_link(victim, path + ".new");
  fs::create_hard_link(victim, beside + ".0.new");
  ASSERT_EQ(::mkfifo((beside + ".1.new").c_str(), 0600), 0);  // opening it would wait for a reader
  fs::create_symlink(victim, beside + ".2.new");
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(path).has_value());
  EXPECT_EQ(content_of(path), Bytes(889, 0xFF));
  for (const std::string& name : {victim, path + ".new", beside + ".0.new", beside + ".2.new"})
    EXPECT_EQ(content_of(name), (Bytes{'m', 'i', 'n', 'e'})) << name;
  EXPECT_TRUE(fs::is_fifo(beside + ".1.new"));
}

TEST(EepromFile, ASaveKeepsThePermissions) {
  const TemporaryDirectory directory;
  const std::string path = directory.file("eeprom");
  ASSERT_TRUE(pty_server().keep_eeprom(path).has_value());
  for (const auto mode : {fs::perms::owner_read | fs::perms::owner_write,
                          fs::perms::owner_read | fs::perms::owner_write | fs::perms::group_read |
                              fs::perms::group_write | fs::perms::others_read}) {
    fs::permissions(path, mode);
    ASSERT_TRUE(pty_server().keep_eeprom(path).has_value());
    EXPECT_EQ(fs::status(path).permissions(), mode);
  }
}

TEST(EepromFile, AFolderThatIsGoneEndsTheServerWithAnError) {
  const TemporaryDirectory directory;
  fs::create_directory(directory.file("folder"));
  Server server = pty_server();
  ASSERT_TRUE(server.keep_eeprom(directory.file("folder") + "/eeprom").has_value());
  fs::remove_all(directory.file("folder"));
  server.model().eeprom().write(5, 0xA5, -kNever);
  const std::atomic<bool> stop{true};
  const auto served = server.serve(stop);
  ASSERT_FALSE(served.has_value());
  EXPECT_EQ(served.error().code, ENOENT);
}

}  // namespace
}  // namespace tm485::sim
