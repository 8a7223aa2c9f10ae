// A timer for what has no interrupt of its own: the lead of the driver, and the end of a request on blocks that do not
// tell it. Specification: section 4: the driver must be off the line before T2 min.
#pragma once

#include <concepts>

#include "tm485/time.hpp"

namespace tm485::mcu {

/// `arm(span)`: calls the port's on_timer() once, `span` from now or as soon after as it can; a call replaces the one
/// before. Spans are below 1 ms. Its interrupt has the priority of the UART's, so that neither interrupts the other.
template <class T>
concept OneShotTimer = requires(T& timer, Time span) {
  { timer.arm(span) } noexcept -> std::same_as<void>;
};

/// None: the owner's calls do it, as late as they come.
struct NoTimer {};

template <class T>
concept OneShotTimerOrNone = OneShotTimer<T> || std::same_as<T, NoTimer>;

}  // namespace tm485::mcu
