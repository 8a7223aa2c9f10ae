#include "pseudo_terminal.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <iterator>

namespace tm485::linux_hal::test {

PseudoTerminal::PseudoTerminal() : master_(posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC | O_NONBLOCK)) {
  EXPECT_TRUE(master_.valid());
  EXPECT_EQ(grantpt(master_.get()), 0);
  EXPECT_EQ(unlockpt(master_.get()), 0);
  char name[64] = {};
  EXPECT_EQ(ptsname_r(master_.get(), name, sizeof name), 0);
  path_ = name;
}

void PseudoTerminal::write(const std::vector<std::uint8_t>& bytes) {
  EXPECT_EQ(::write(master_.get(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
}

std::vector<std::uint8_t> PseudoTerminal::read(std::size_t count) {
  std::vector<std::uint8_t> bytes;
  pollfd waited{master_.get(), POLLIN, 0};
  while (bytes.size() < count && poll(&waited, 1, 2000) > 0) {
    std::uint8_t buffer[256];
    const ssize_t got = ::read(master_.get(), buffer, std::min(sizeof buffer, count - bytes.size()));
    if (got <= 0) break;
    bytes.insert(bytes.end(), buffer, buffer + got);
  }
  return bytes;
}

std::size_t PseudoTerminal::drain() {
  std::size_t total = 0;
  pollfd waited{master_.get(), POLLIN, 0};
  while (poll(&waited, 1, 50) > 0) {
    std::uint8_t buffer[4096];
    const ssize_t got = ::read(master_.get(), buffer, sizeof buffer);
    if (got <= 0) break;
    total += static_cast<std::size_t>(got);
  }
  return total;
}

TemporaryFolder::TemporaryFolder() {
  std::string name = ::testing::TempDir() + "tm485_linux_XXXXXX";
  EXPECT_NE(mkdtemp(name.data()), nullptr);
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::size_t open_descriptors() {
  const std::filesystem::directory_iterator entries("/proc/self/fd");
  return static_cast<std::size_t>(std::distance(begin(entries), end(entries)));
}

}  // namespace tm485::linux_hal::test
