// The latency timer of FTDI chips: how long the chip waits for more characters before it hands over what it has. A reply
// is shorter than the chip's packet, so the timer is the shortest exchange. Specification: section 4.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tm485/linux/port_identity.hpp"

namespace tm485::linux_hal {

/// The shortest that the chips have.
inline constexpr unsigned kShortestLatencyTimer = 1;  // ms

struct LatencyTimer {
  enum class State : std::uint8_t {
    absent,   ///< no FTDI chip, or a driver that does not show its timer
    set,      ///< at the shortest
    refused,  ///< longer, and it could not be changed: `error_number`; 0: the driver kept another value
  };
  State state = State::absent;
  unsigned milliseconds = 0;
  int error_number = 0;

  /// What to do about it, plain words; empty unless refused. Static storage.
  [[nodiscard]] std::string_view remedy() const noexcept;
};

/// Sets the timer of a port (its name: ttyUSB0) to 1 ms and reads it back. Needs the right to write to sysfs, or the
/// driver's low-latency setting before. Set-up; system calls.
[[nodiscard]] LatencyTimer set_latency_timer(const std::string& name, const SystemPaths& system = {});

}  // namespace tm485::linux_hal
