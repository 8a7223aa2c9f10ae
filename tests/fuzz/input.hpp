// What every fuzz target needs: numbers out of a string of bytes, and a check that ends the process.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <source_location>
#include <span>
#include <string_view>

namespace tm485::fuzz {

/// Reads a string of bytes from the front. Behind its end everything is 0, so every string is a whole script.
class Input {
 public:
  explicit Input(std::span<const std::uint8_t> bytes) : rest_(bytes) {}

  [[nodiscard]] bool empty() const { return rest_.empty(); }
  [[nodiscard]] std::span<const std::uint8_t> rest() const { return rest_; }

  std::uint8_t u8() {
    if (rest_.empty()) return 0;
    const std::uint8_t byte = rest_.front();
    rest_ = rest_.subspan(1);
    return byte;
  }
  std::uint16_t u16() {
    const unsigned low = u8();
    return static_cast<std::uint16_t>(low | unsigned{u8()} << 8);
  }
  std::uint32_t u32() {
    const std::uint32_t low = u16();
    return low | std::uint32_t{u16()} << 16;
  }
  std::uint64_t u64() {
    const std::uint64_t low = u32();
    return low | std::uint64_t{u32()} << 32;
  }
  bool flag() { return (u8() & 1U) != 0; }
  /// 0 .. n - 1.
  unsigned below(unsigned n) { return u8() % n; }
  /// At most `n` bytes.
  std::span<const std::uint8_t> bytes(std::size_t n) {
    const auto taken = rest_.first(n < rest_.size() ? n : rest_.size());
    rest_ = rest_.subspan(taken.size());
    return taken;
  }
  /// All that is left.
  std::string_view text() {
    const std::string_view all(reinterpret_cast<const char*>(rest_.data()), rest_.size());
    rest_ = {};
    return all;
  }

 private:
  std::span<const std::uint8_t> rest_;
};

/// Ends the process if `holds` is false: the fuzzer keeps the input, the unit test fails.
inline void require(bool holds, const char* what,
                    const std::source_location& at = std::source_location::current()) {
  if (holds) return;
  std::fprintf(stderr, "%s:%u: does not hold: %s\n", at.file_name(), static_cast<unsigned>(at.line()), what);
  std::abort();
}

}  // namespace tm485::fuzz
