// The CRC of the family: G(X) = X^8 + 1, initial value 0. Specification: section 3.
//
// One shift step modulo X^8 + 1 is a rotation by one bit; the eight steps of a byte are the
// identity. So the CRC is the XOR of the bytes, and a whole valid frame XORs to 0. The tests hold
// a bit-serial division against this.
#pragma once

#include <cstdint>
#include <span>

namespace tm485 {

/// The CRC over `bytes`; 0 over a whole valid frame, its CRC included.
[[nodiscard]] constexpr std::uint8_t crc(std::span<const std::uint8_t> bytes) noexcept {
  std::uint8_t sum = 0;
  for (const std::uint8_t byte : bytes) sum = static_cast<std::uint8_t>(sum ^ byte);
  return sum;
}

/// The CRC over the four bytes of a word.
[[nodiscard]] constexpr std::uint8_t crc(std::uint32_t word) noexcept {
  word ^= word >> 16;
  word ^= word >> 8;
  return static_cast<std::uint8_t>(word);
}

/// The CRC over the eight bytes of a word.
[[nodiscard]] constexpr std::uint8_t crc(std::uint64_t word) noexcept {
  return crc(static_cast<std::uint32_t>(word ^ (word >> 32)));
}

}  // namespace tm485
