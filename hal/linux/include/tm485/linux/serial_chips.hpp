// What serial chips make of 2.5 Mbit/s: USB adapters by their ids, UARTs of a board by their driver and clock.
//
// A driver's word is no proof: ftdi_sio reports the wish, and 8250 does not report the rounding of its divisor. The
// tables decide instead; code, `tm485 list` and docs/linux.md share them. Specification: sections 1 and 4.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>

namespace tm485::linux_hal {

/// The bit rate of the protocol, and that of the adapters' table.
inline constexpr std::uint32_t kTm485Rate = 2'500'000;

/// True if a receiver still reads what the other end sends: within ±2 % of the rate, edges included. A
/// character is ten bits, sampled in their middle: 5 % in all, of which the encoder's clock needs its share.
[[nodiscard]] constexpr bool rate_acceptable(std::uint32_t asked, std::uint32_t achieved) noexcept {
  const std::uint64_t difference = asked > achieved ? asked - achieved : achieved - asked;
  return asked != 0 && difference * 50 <= asked;
}

enum class RateVerdict : std::uint8_t { holds, cannot, unknown };
/// "holds", "cannot", "unknown".
[[nodiscard]] std::string_view verdict_name(RateVerdict verdict) noexcept;

/// A USB adapter's chip.
struct UsbChip {
  std::uint16_t vendor;
  std::uint16_t product;
  std::uint16_t first_release;  ///< bcdDevice, as far as chips share an id; both edges included
  std::uint16_t last_release;
  std::string_view name;
  std::uint32_t
      nearest_rate;     ///< bit/s that it makes when 2.5 Mbit/s are asked for, or its limit; 0: not known
  RateVerdict verdict;  ///< at 2.5 Mbit/s
  std::string_view remark;
  std::string_view source;  ///< of the fact
};

/// The table. Any thread.
[[nodiscard]] std::span<const UsbChip> usb_chips() noexcept;
/// The chip with these ids, or nullptr. Any thread; a pass over the table.
[[nodiscard]] const UsbChip* find_usb_chip(std::uint16_t vendor, std::uint16_t product,
                                           std::uint16_t release) noexcept;

/// How a UART divides its clock.
enum class ClockDivider : std::uint8_t {
  whole_16,  ///< 16 clocks a sample, whole divisors: 8250, 16550
  pl011,     ///< 16 clocks, divisors in steps of 1/64
  omap,      ///< 16 or 13 clocks, whole divisors
  exar,      ///< 16 clocks, divisors in steps of 1/16
  whole_8,   ///< whole divisors of the clock from 8 up: STM32
  imx,       ///< any ratio up to a sixteenth of the clock
  unknown,   ///< or the clock follows the wish
};

/// A UART of the board or of a card, by the name of its driver in sysfs.
struct UartDriver {
  std::string_view driver;
  std::string_view name;
  ClockDivider divider;
  unsigned timeout_bits;  ///< of its receive time-out interrupt, after the last character; 0: not known
  std::string_view remark;
  std::string_view source;
};

[[nodiscard]] std::span<const UartDriver> uart_drivers() noexcept;
[[nodiscard]] const UartDriver* find_uart_driver(std::string_view driver) noexcept;

/// The rate next to `bit_rate` that a divider makes of a clock (Hz); 0: it makes none near it. Nothing if the divider is
/// not known. Any thread; O(1).
[[nodiscard]] std::optional<std::uint32_t> nearest_rate(ClockDivider divider, std::uint32_t clock_hz,
                                                        std::uint32_t bit_rate) noexcept;

/// Chips to buy and clocks to choose, for remedies.
inline constexpr std::string_view kRateRemedy =
    "use a UART or adapter that can make this rate (for 2500000 bit/s: FT232H, FT2232H, CH343, PL011 at 48 "
    "MHz; "
    "not FT232R, CH340, CP2102N), or raise the UART's clock";

}  // namespace tm485::linux_hal
