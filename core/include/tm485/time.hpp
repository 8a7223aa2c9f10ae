// Time as the core sees it: nanoseconds since an epoch that the owner of a bus chooses.
//
// The core never reads a clock. Every function that needs to know the time takes it as a
// parameter of this type, so the same code runs in an interrupt, in a spinning thread and in
// virtual time.
#pragma once

#include <chrono>
#include <cstdint>

namespace tm485 {

/// Nanoseconds since the bus epoch (an instant), or between two instants (a span).
/// Signed 64 bit: 292 years; never negative as an instant.
using Time = std::chrono::duration<std::int64_t, std::nano>;

/// "Never", for a due time that does not exist. Far from the type's limit, so that adding a
/// span to it cannot overflow.
inline constexpr Time kNever{std::int64_t{1} << 62};

/// How many whole `step`s (1 ns or more) `span` holds; 0 if it is negative. No division, which a core without an instruction
/// for 64 bits makes long: two passes of a short loop for each bit of the answer. Any thread or interrupt.
[[nodiscard]] std::int64_t whole_in(Time span, Time step) noexcept;

/// What is left of `span` (0 or more) behind them. Bounded likewise.
[[nodiscard]] inline Time left_of(Time span, Time step) noexcept {
  return span - step * whole_in(span, step);
}

}  // namespace tm485
