// LineCounters: the faults that a serial driver counts (TIOCGICOUNT): overrun, framing, parity, break.
//
// Raw mode hands a character with a fault out like any other, so a reply fails by its CRC or its length; these counters
// tell why. One system call a look, so nobody looks while all is well. Specification: section 4.
#pragma once

#include <cstdint>
#include <expected>

#include "tm485/errc.hpp"

namespace tm485::linux_hal {

/// Counts since the driver was loaded; the kernel's numbers wrap, so only differences mean anything.
struct LineCounters {
  std::uint32_t overruns = 0;         ///< characters that the UART lost: nobody fetched them in time
  std::uint32_t buffer_overruns = 0;  ///< characters that the kernel's buffer lost
  std::uint32_t framing_errors = 0;   ///< no stop bit: noise, a wrong rate, two speakers
  std::uint32_t parity_errors = 0;    ///< not counted by 8N1; what else a driver puts there
  std::uint32_t breaks = 0;           ///< the line was low for a whole character: no encoder, A and B swapped

  friend bool operator==(const LineCounters&, const LineCounters&) = default;
  /// What was added since `before`.
  [[nodiscard]] constexpr LineCounters since(const LineCounters& before) const noexcept {
    return {overruns - before.overruns, buffer_overruns - before.buffer_overruns,
            framing_errors - before.framing_errors, parity_errors - before.parity_errors,
            breaks - before.breaks};
  }
  /// The cause of a failed reply, if these were counted since the last look: overrun (characters are missing), framing_error (the
  /// line was disturbed), or ok (none was counted).
  [[nodiscard]] constexpr Errc cause() const noexcept {
    if (overruns != 0 || buffer_overruns != 0) return Errc::overrun;
    return framing_errors != 0 || parity_errors != 0 || breaks != 0 ? Errc::framing_error : Errc::ok;
  }
};

/// One system call. Errors: errno; ENOTTY or EINVAL: the driver does not count (a pseudo-terminal, some USB drivers).
[[nodiscard]] std::expected<LineCounters, int> read_line_counters(int fd) noexcept;

}  // namespace tm485::linux_hal
