// What PolledUartPort needs from a UART's register driver: byte by byte, no interrupt, no wait.
// Specification: section 1.
#pragma once

#include <concepts>
#include <cstdint>
#include <expected>

#include "tm485/errc.hpp"
#include "tm485/mcu/baud.hpp"

namespace tm485::mcu {

/// One character from the receiver, or none, and what the receiver has found wrong.
struct ReceivedCharacter {
  bool present = false;
  std::uint8_t byte = 0;  ///< only if present
  /// framing_error: this character had no stop bit (a break is one of zeros); port_gone: the block answers no more;
  /// overrun: characters were lost, as a rule before this one.
  Errc fault = Errc::ok;
};

/// One owner. No function waits; each is a handful of register accesses.
template <class U>
concept PolledUart = requires(U& uart, const BaudDivisor& divisor, std::uint8_t byte) {
  /// 8N1 at this divisor, transmitter and receiver on, FIFOs on where there are any and empty, interrupts off.
  /// Errors: port_gone if the registers do not hold what was written (no such block here, or its clock is off),
  /// bad_argument if the block cannot do it.
  { uart.configure(divisor) } noexcept -> std::same_as<std::expected<void, Errc>>;
  /// Puts a byte behind those that are leaving; false if there is no room.
  { uart.try_write(byte) } noexcept -> std::same_as<bool>;
  /// True for a block that says when its buffer is empty, but not when the character behind it has left: the port
  /// waits for that character's time.
  { U::kHidesLastCharacter } -> std::convertible_to<bool>;
  /// The last stop bit has left (or, see above, begun to), and nothing waits.
  { uart.transmitter_idle() } noexcept -> std::same_as<bool>;
  /// Drops what has not begun to leave.
  { uart.drop_unsent() } noexcept -> std::same_as<void>;
  /// The oldest character that was received.
  { uart.try_read() } noexcept -> std::same_as<ReceivedCharacter>;
  /// Characters were lost since the last call, and no character that was read has said so. Asked when all were read.
  { uart.take_overrun() } noexcept -> std::same_as<bool>;
  /// Transmitter and receiver off.
  { uart.shut_down() } noexcept -> std::same_as<void>;
};

/// A block with an RTS output (a pin that is low when RTS is on) that software may switch: the direction of boards that
/// have wired it so.
template <class U>
concept HasRts = requires(U& uart, bool on) {
  { uart.set_rts(on) } noexcept -> std::same_as<void>;
};

}  // namespace tm485::mcu
