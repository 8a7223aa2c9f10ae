// What InterruptUartPort needs from a UART's register driver beyond PolledUart: its interrupts. Specification: section 1.
//
// Two contexts touch the block: the port's owner, and the UART's interrupt, which may interrupt the owner anywhere. So
// each function says whose it is, and no register is written by read, change and write from both sides.
#pragma once

#include <concepts>
#include <cstdint>
#include <span>

#include "tm485/mcu/polled_uart.hpp"

namespace tm485::mcu {

/// The transmit interrupts that are switched on and due.
struct TransmitEvents {
  bool room =
      false;  ///< a byte may be written; with nothing left to write: the last character has begun to leave
  bool complete = false;  ///< the last stop bit has left
};

template <class U>
concept SendsBytes = requires(U& uart, std::uint8_t byte, bool more) {
  /// Owner, transmitter idle and after listen(). Writes the first byte and switches the transmit interrupt on (if not
  /// `more`, that of completion where there is one). take_events() answers nothing before the last access of this
  /// function, and from it on the transmitter belongs to the interrupt.
  { uart.begin(byte, more) } noexcept -> std::same_as<void>;
};

/// As SendsBytes, with all of the request at once; its bytes stay where they are until it has left.
template <class U>
concept SendsRequests = requires(U& uart, std::span<const std::uint8_t> request) {
  { uart.begin(request) } noexcept -> std::same_as<void>;
};

/// configure(), drop_unsent(), transmitter_idle() and shut_down() are the owner's, and leave interrupts off or as they
/// were. try_read(), take_overrun() and try_write() are the interrupt's.
template <class U>
concept InterruptUart = PolledUart<U> && (SendsBytes<U> || SendsRequests<U>) && requires(U& uart) {
  /// The block has an interrupt for "the last stop bit has left".
  { U::kTellsCompletion } -> std::convertible_to<bool>;
  /// The receive interrupt on, the transmit ones off. Either context, while nothing is being sent.
  { uart.listen() } noexcept -> std::same_as<void>;
  /// Interrupt, first of all: what is due. Acknowledges what must be, the receive interrupt too, so that a character that
  /// comes later makes a new interrupt.
  { uart.take_events() } noexcept -> std::same_as<TransmitEvents>;
  /// Interrupt: all bytes are written.
  { uart.await_completion() } noexcept -> std::same_as<void>;
};

}  // namespace tm485::mcu
