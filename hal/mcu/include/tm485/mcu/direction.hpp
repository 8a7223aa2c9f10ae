// Who switches the RS-485 driver on and off. Specification: section 4: the driver must be off the line before T2 min.
#pragma once

#include <concepts>
#include <type_traits>
#include <utility>

#include "tm485/mcu/polled_uart.hpp"

namespace tm485::mcu {

/// `drive` switches the driver on (true) or off. False: it could not. It must not wait. `uart` is the block that
/// sends, for those that have the line themselves.
template <class D, class U>
concept DirectionFor = requires(D& direction, U& uart, bool on) {
  { direction.drive(uart, on) } noexcept -> std::same_as<bool>;
};

/// Hardware does it: an auto-direction transceiver, or the UART's own driver-enable output.
struct AutomaticDirection {
  template <class U>
  bool drive(U&, bool) const noexcept {
    return true;
  }
};

/// The UART's RTS output, switched by software: one register write, no system call.
struct RtsDirection {
  /// RTS on means "drive" (the pin is low then, for transceivers behind an inverter, as most boards have it);
  /// true: RTS off means "drive" (the pin is high).
  bool inverted = false;

  template <HasRts U>
  bool drive(U& uart, bool on) const noexcept {
    uart.set_rts(on != inverted);
    return true;
  }
};

/// Whatever a caller has: `call(on)` answers false if it could not. A GPIO, as a rule.
template <class F>
  requires std::is_nothrow_invocable_r_v<bool, F&, bool>
struct CallDirection {
  F call;

  template <class U>
  bool drive(U&, bool on) noexcept {
    return call(on);
  }
};

template <class F>
CallDirection(F) -> CallDirection<F>;

}  // namespace tm485::mcu
