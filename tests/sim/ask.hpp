// Helper of the simulator's tests: one request to the encoder model, without a line.
#pragma once

#include <cstdint>
#include <vector>

#include "tm485/sim/burst.hpp"
#include "tm485/sim/encoder_model.hpp"

namespace tm485::sim {

using Bytes = std::vector<std::uint8_t>;

inline constexpr Time kCharacter{4'000};

/// Sends `request` gapless from `start` and returns the reply's bytes; empty for silence. The burst itself
/// goes to `reply` if that is not null.
inline Bytes ask(EncoderModel& encoder, Time start, const Bytes& request, Burst* reply = nullptr) {
  Bytes answer;
  for (const std::uint8_t byte : request) {
    Burst burst;
    if (encoder.on_character(byte, start, start + kCharacter, true, Judged::yes, burst)) {
      answer.assign(burst.bytes.begin(), burst.bytes.begin() + burst.count);
      if (reply != nullptr) *reply = burst;
    }
    start += kCharacter;
  }
  return answer;
}

/// The EEPROM requests, with their CRC.
inline Bytes write_request(int address, int value) {
  return {0x32, static_cast<std::uint8_t>(address), static_cast<std::uint8_t>(value),
          static_cast<std::uint8_t>(0x32 ^ address ^ value)};
}
inline Bytes read_request(int address) {
  return {0xEA, static_cast<std::uint8_t>(address), static_cast<std::uint8_t>(0xEA ^ address)};
}

/// A shaft at rest at `counts` of a 17-bit encoder.
inline MotionProfile at_rest(std::int64_t counts) {
  return MotionProfile::constant(0.0, static_cast<double>(counts) / 131072.0);
}

inline constexpr Time us(std::int64_t microseconds) { return std::chrono::microseconds{microseconds}; }
inline constexpr Time ms(std::int64_t milliseconds) { return std::chrono::milliseconds{milliseconds}; }

}  // namespace tm485::sim
