// The file that the simulated encoder's EEPROM survives in: its bytes, page after page, and nothing else.
//
// Every save replaces the whole file at once, so whoever reads it, and a process that is killed at any moment, finds
// the old bytes or the new ones; after the return the new ones, also if the machine crashes. Two servers on one file
// overwrite each other: whoever saves last has it.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "tm485/sim/server.hpp"

namespace tm485::sim {

/// System calls, and the time that the disk takes: a save waits for the file and for its directory.
class EepromFile {
 public:
  /// `path` may be a symbolic link to the file.
  explicit EepromFile(const std::string& path);

  /// The bytes of the file, exactly `size`; nothing if there is no such file. An error: it cannot be read, is no
  /// regular file, or has another size.
  [[nodiscard]] std::expected<std::optional<std::vector<std::uint8_t>>, ServerError> load(std::size_t size);

  /// Makes `bytes` the content of the file; permissions of an old one are kept. An error leaves it as it was.
  [[nodiscard]] std::expected<void, ServerError> save(std::span<const std::uint8_t> bytes) const;

 private:
  std::string path_;
};

}  // namespace tm485::sim
