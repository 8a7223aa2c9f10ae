// A pseudo-terminal for the tests: the master is held here, the slave's path is what a port opens.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tm485/posix/file_descriptor.hpp"

namespace tm485::linux_hal::test {

class PseudoTerminal {
 public:
  /// Makes one; the test fails if the system gives none.
  PseudoTerminal();

  [[nodiscard]] const std::string& path() const { return path_; }
  [[nodiscard]] int master() const { return master_.get(); }

  /// As if the device were unplugged.
  void close() { master_.close(); }

  /// Writes all to the port; the test fails if the buffer has no room.
  void write(const std::vector<std::uint8_t>& bytes);
  /// Reads what comes within two seconds until there are `count` bytes.
  [[nodiscard]] std::vector<std::uint8_t> read(std::size_t count);
  /// Reads and drops until nothing comes for a moment. Answers the number of bytes.
  std::size_t drain();

 private:
  posix::FileDescriptor master_;
  std::string path_;
};

/// The kernel's view of a terminal's settings, read without the code under test.
struct KernelSettings {
  std::uint32_t input_rate = 0;
  std::uint32_t output_rate = 0;
  bool canonical = false;
  bool echo = false;
};
[[nodiscard]] KernelSettings kernel_settings(int fd);

/// A new empty folder, removed with its files at the end of the scope.
class TemporaryFolder {
 public:
  TemporaryFolder();
  ~TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] std::string operator/(const std::string& name) const { return path_ + "/" + name; }

 private:
  std::string path_;
};

/// How many descriptors this process has open.
[[nodiscard]] std::size_t open_descriptors();

}  // namespace tm485::linux_hal::test
