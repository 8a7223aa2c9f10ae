// A burst: what travels on the simulated line. Specification: section 1.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tm485/time.hpp"

namespace tm485::sim {

/// Who drives the line. Any further talker is a disturber.
enum class Talker : std::uint8_t { host = 0, encoder = 1, third = 2 };

/// Gapless characters of one talker, and the interval in which its driver is enabled.
struct Burst {
  static constexpr std::size_t kCapacity = 32;

  Time start{0};  ///< first start bit; character k begins k character times later
  Time driver_on{0};
  Time driver_off{0};
  Talker talker = Talker::host;
  std::uint8_t count = 0;                     ///< 0..kCapacity
  std::uint32_t framing_errors = 0;           ///< bit k: character k has no stop bit
  std::array<std::uint8_t, kCapacity> bytes;  ///< the first `count` are valid
};

}  // namespace tm485::sim
