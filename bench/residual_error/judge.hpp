// The judge of bench/residual_error: frames of ID3 by its own bytes, its own exclusive or and its own masks. It shares
// nothing with the codecs that it judges. Specification: sections 2 and 3.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

namespace residual {

inline constexpr std::size_t kBytes = 11;
using Bytes = std::array<std::uint8_t, kBytes>;

/// Bits of an ID3 reply of a 17-bit encoder with 16 bits of turns that a wrong bit can change without a check of the profile
/// noticing: SF, ABS 0-16, ABM 0-16 (bit 16 is left open), ALMC, CRC. The others are CF, ENID and bits that are 0.
inline constexpr Bytes kOpen{0x00, 0xFF, 0xFF, 0xFF, 0x01, 0x00, 0xFF, 0xFF, 0x01, 0xFF, 0xFF};

/// Without a check of the profile: every bit.
inline constexpr Bytes kAll{0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF};

/// Turns and ABS as one number have so many bits and wrap.
inline constexpr unsigned kAbsBits = 17;
inline constexpr unsigned kPositionBits = 33;

/// More than this is dangerous: 0.18 degrees of 17 bits.
inline constexpr std::int64_t kDangerous = 64;

/// What an encoder without a battery sends at `position`.
inline Bytes id3_frame(std::int64_t position) {
  const auto abs = static_cast<std::uint64_t>(position) & 0x1FFFF;
  const auto turns = static_cast<std::uint64_t>(position >> kAbsBits) & 0xFFFF;
  Bytes frame{0x1A, 0x20};
  for (std::size_t i = 0; i < 3; ++i) frame[2 + i] = static_cast<std::uint8_t>(abs >> (8 * i));
  frame[5] = 0x11;
  frame[6] = static_cast<std::uint8_t>(turns);
  frame[7] = static_cast<std::uint8_t>(turns >> 8);
  std::uint8_t sum = 0;
  for (const std::uint8_t byte : frame) sum ^= byte;
  frame[10] = sum;
  return frame;
}

/// All that a check of CRC X^8 + 1 tells.
inline bool xor_holds(const Bytes& frame) {
  std::uint8_t sum = 0;
  for (const std::uint8_t byte : frame) sum ^= byte;
  return sum == 0;
}

/// The position as somebody reads it who checks nothing more: 24 bits of ABS and 16 of turns.
inline std::int64_t read_position(const Bytes& frame) {
  const std::int64_t abs = frame[2] | frame[3] << 8 | frame[4] << 16;
  const std::int64_t turns = static_cast<std::int16_t>(frame[6] | frame[7] << 8);
  return turns * (std::int64_t{1} << kAbsBits) + abs;
}

/// How far apart two positions are, the shorter way round.
inline std::int64_t apart(std::int64_t a, std::int64_t b) {
  constexpr unsigned kShift = 64 - kPositionBits;
  const auto distance = static_cast<std::uint64_t>(a) - static_cast<std::uint64_t>(b);
  const std::int64_t off = static_cast<std::int64_t>(distance << kShift) >> kShift;
  return off < 0 ? -off : off;
}

/// A pattern of wrong bits, all of them within `open`, that the exclusive or lets pass.
inline bool passes(const Bytes& wrong, const Bytes& open) {
  std::uint8_t any = 0;
  for (std::size_t i = 0; i < kBytes; ++i) {
    if ((wrong[i] & ~open[i] & 0xFF) != 0) return false;
    any |= wrong[i];
  }
  return any != 0 && xor_holds(wrong);
}

}  // namespace residual
