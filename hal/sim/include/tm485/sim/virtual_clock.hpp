// A clock that moves only when it is told to, for tests and for runs in virtual time.
#pragma once

#include "tm485/time.hpp"

namespace tm485::sim {

/// Starts at 0. Not thread-safe: one owner, constant time.
class VirtualClock {
 public:
  [[nodiscard]] Time now() const noexcept { return now_; }

  /// Moves to `instant`. An instant in the past changes nothing: the clock never goes back.
  void advance_to(Time instant) noexcept {
    if (instant > now_) now_ = instant;
  }

 private:
  Time now_{0};
};

}  // namespace tm485::sim
