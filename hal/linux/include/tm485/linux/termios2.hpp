// The kernel's terminal settings at any bit rate.
//
// The C library's termios knows a list of rates; the kernel's termios2 with BOTHER takes any number. The
// headers of the two exclude each other, so termios2.cpp is the only file that includes <asm/termbits.h>.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>

namespace tm485::linux_hal {

/// A copy of a terminal's settings, to put them back later. Opaque: a kernel structure.
struct TerminalSettings {
  alignas(8) std::array<std::byte, 64> bytes{};
};

/// The settings of `fd`, or errno.
[[nodiscard]] std::expected<TerminalSettings, int> read_settings(int fd) noexcept;

/// Raw 8N1 without flow control at `bit_rate` (1 bit/s and up), based on the settings `before`. Answers the
/// rate that the driver has set, as read back: the kernel reports success even when it has refused the rate
/// and kept another. Errors: errno.
[[nodiscard]] std::expected<std::uint32_t, int> make_raw(int fd, const TerminalSettings& before,
                                                         std::uint32_t bit_rate) noexcept;

/// Puts settings back, at once. Answers 0 or errno.
int write_settings(int fd, const TerminalSettings& settings) noexcept;

}  // namespace tm485::linux_hal
