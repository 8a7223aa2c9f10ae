// tm485 sim --eeprom: the bytes that a write has put there survive the simulator.
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iterator>

#include "cli/process.hpp"
#include "cli/simulator.hpp"

namespace tm485::test {
namespace {

using Bytes = std::vector<std::uint8_t>;

/// Talks to `unix:PATH` in bytes.
class Line {
 public:
  explicit Line(const std::string& port) : fd_(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0)) {
    const std::string path = port.substr(port.find(':') + 1);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, path.data(), path.size());
    EXPECT_EQ(::connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  }
  Line(const Line&) = delete;
  Line& operator=(const Line&) = delete;
  ~Line() { ::close(fd_); }

  /// The reply's four bytes; fewer if they do not come.
  Bytes ask(const Bytes& request) {
    EXPECT_EQ(::write(fd_, request.data(), request.size()), static_cast<ssize_t>(request.size()));
    Bytes reply;
    while (reply.size() < 4) {
      pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
      std::array<std::uint8_t, 4> part{};
      if (::poll(&waiting, 1, 10'000) <= 0) break;
      const ssize_t got = ::read(fd_, part.data(), 4 - reply.size());
      if (got <= 0) break;
      reply.insert(reply.end(), part.begin(), part.begin() + got);
    }
    return reply;
  }

  /// The byte at `address` once the EEPROM is no longer busy; -1 if it does not come.
  int read(int address) {
    const auto at = static_cast<std::uint8_t>(address);
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      const Bytes reply = ask({0xEA, at, static_cast<std::uint8_t>(0xEA ^ at)});
      if (reply.size() != 4) return -1;
      if (reply[1] == at) return reply[2];
    }
    return -1;
  }

  /// Waits until the EEPROM takes the write; it is still under way at the end.
  void start_write(int address, int value) {
    const auto at = static_cast<std::uint8_t>(address);
    const auto data = static_cast<std::uint8_t>(value);
    for (int attempt = 0; attempt < kAttempts; ++attempt) {
      const Bytes reply = ask({0x32, at, data, static_cast<std::uint8_t>(0x32 ^ at ^ data)});
      ASSERT_EQ(reply.size(), 4U);
      if (reply[1] == at) return;
    }
    FAIL() << "busy for ever";
  }

 private:
  static constexpr int kAttempts = 100'000;  // of some 50 us each
  int fd_;
};

std::string content(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

TEST(SimEeprom, SurvivesAKill) {
  const TemporaryFolder folder;
  const std::string image = folder.path("eeprom.bin");
  const Process::Arguments arguments{"--unix", folder.path("socket"), "--eeprom", image};
  {
    Simulator simulator(arguments);
    EXPECT_EQ(content(image), std::string(889, '\xFF'));
    Line line(simulator.port());
    line.start_write(127, 3);
    line.start_write(5, 0xA5);
    line.start_write(6, 0x5A);
    EXPECT_EQ(line.read(6), 0x5A);
    EXPECT_EQ(line.read(5), 0xA5);  // the reply before it was still followed by the save
    simulator.process().send_signal(SIGKILL);
    EXPECT_EQ(simulator.process().wait().signal, SIGKILL);
  }
  std::string expected(889, '\xFF');
  expected[3 * 127 + 5] = '\xA5';
  expected[3 * 127 + 6] = '\x5A';
  EXPECT_EQ(content(image), expected);

  Simulator again(arguments);
  Line line(again.port());
  EXPECT_EQ(line.read(5), 0xFF);  // page 0 after power-up
  line.start_write(127, 3);
  EXPECT_EQ(line.read(5), 0xA5);
  EXPECT_EQ(line.read(6), 0x5A);
  EXPECT_EQ(again.stop().exit_code, 0);
}

TEST(SimEeprom, AKillInTheMiddleOfAWriteLeavesTheOldByte) {
  const TemporaryFolder folder;
  const std::string image = folder.write("eeprom.bin", std::string(889, 'a'));
  Simulator simulator({"--unix", folder.path("socket"), "--eeprom", image, "--eeprom-write", "3s"});
  Line line(simulator.port());
  line.start_write(5, 'b');
  simulator.process().send_signal(SIGKILL);
  EXPECT_EQ(simulator.process().wait().signal, SIGKILL);
  EXPECT_EQ(content(image), std::string(889, 'a'));
}

TEST(SimEeprom, AFileOfAnotherSizeIsRefusedAndLeftAlone) {
  const TemporaryFolder folder;
  const std::string image = folder.write("eeprom.bin", std::string(762, 'a'));
  const Finished finished = run({"sim", "--unix", folder.path("socket"), "--eeprom", image});
  EXPECT_EQ(finished.exit_code, 1);
  EXPECT_TRUE(finished.out.empty());
  EXPECT_NE(finished.err.find("762 bytes"), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find(image), std::string::npos) << finished.err;
  EXPECT_NE(finished.err.find("remedy:"), std::string::npos) << finished.err;
  EXPECT_EQ(content(image), std::string(762, 'a'));
  EXPECT_FALSE(std::filesystem::exists(folder.path("socket")));
  // The same file fits an encoder of six pages.
  Simulator simulator({"--unix", folder.path("socket"), "--eeprom", image, "--eeprom-pages", "6"});
  EXPECT_EQ(Line(simulator.port()).read(126), 'a');
}

TEST(SimEeprom, ItsOptionsReachTheEncoder) {
  const TemporaryFolder folder;
  Simulator simulator({"--unix", folder.path("socket"), "--eeprom-page", "0ms", "--eeprom-write", "1ms..2ms",
                       "--eeprom-fail", "1", "--eeprom-seed", "3", "--eeprom-deaf"});
  Line line(simulator.port());
  line.start_write(127, 2);
  EXPECT_EQ(line.ask({0xEA, 0x7F, 0x95}), (Bytes{0xEA, 0x7F, 0x02, 0x97}));
  line.start_write(5, 0xA5);
  EXPECT_EQ(line.read(5), 0xFF);
}

TEST(SimEeprom, BadOptionsAreNamed) {
  for (const auto& [option, value] : {std::pair{"--eeprom-write", "10"},
                                      {"--eeprom-page", "9h"},
                                      {"--eeprom-fail", "2"},
                                      {"--eeprom-pages", "8"},
                                      {"--boot", "2"}}) {
    const Finished finished = run({"sim", option, value});
    EXPECT_EQ(finished.exit_code, 2) << option;
    EXPECT_NE(finished.err.find(value), std::string::npos) << finished.err;
    EXPECT_NE(finished.err.find("remedy:"), std::string::npos) << finished.err;
  }
}

}  // namespace
}  // namespace tm485::test
