// TimerClock: tm485::Time from a counter that runs freely and wraps. Design: time is a parameter everywhere; this is where
// a microcontroller gets it from.
//
// The counts of the running second are scaled by one multiplication and a shift, whole seconds are added up. So there is
// no division in now(), and no drift: against count * 10^9 / rate an answer is never late and less than 2 ns early,
// whatever the time since the start. Answers never fall.
#pragma once

#include <concepts>
#include <cstdint>
#include <utility>

#include "tm485/time.hpp"

namespace tm485::mcu {

/// A counter that counts up by one a tick and wraps behind `kBits` bits (16 to 32). One that counts down: `read` answers
/// its complement.
template <class C>
concept TickCounter = requires(C& counter) {
  { counter.read() } noexcept -> std::same_as<std::uint32_t>;
  { C::kBits } -> std::convertible_to<unsigned>;
  requires C::kBits >= 16 && C::kBits <= 32;
};

/// One owner, which calls now() at least once a wrap (24 bits at 100 MHz: 167 ms; 32 bits: 42 s), or time is lost. For
/// a second context copy it after start(): the copies agree, and share nothing.
template <TickCounter C>
class TimerClock {
 public:
  /// `rate`: ticks a second, 1 kHz to 1 GHz. A 64-bit division, at compile time if `rate` is known then.
  constexpr TimerClock(C counter, std::uint32_t rate) noexcept
      : counter_(std::move(counter)),
        rate_(rate),
        whole_(static_cast<std::uint32_t>(kNsPerSecond / rate)),
        fraction_(static_cast<std::uint32_t>(((std::uint64_t{kNsPerSecond % rate} << 32U)) / rate)) {}

  /// The bus's epoch is now.
  void start() noexcept {
    last_ = counter_.read();
    ticks_ = 0;
    seconds_ = Time{0};
  }

  /// Since start(). O(1), and one step for each second since the last call.
  [[nodiscard]] Time now() noexcept {
    const std::uint32_t count = counter_.read();
    std::uint32_t passed = (count - last_) & kMask;
    last_ = count;
    while (passed >= rate_ - ticks_) {
      passed -= rate_ - ticks_;
      ticks_ = 0;
      seconds_ += Time{kNsPerSecond};
    }
    ticks_ += passed;
    const std::uint32_t part = static_cast<std::uint32_t>((std::uint64_t{ticks_} * fraction_) >> 32U);
    return seconds_ + Time{ticks_ * whole_ + part};
  }

  [[nodiscard]] C& counter() noexcept { return counter_; }

 private:
  static constexpr std::uint32_t kNsPerSecond = 1'000'000'000;
  static constexpr std::uint32_t kMask = static_cast<std::uint32_t>((std::uint64_t{1} << C::kBits) - 1U);

  C counter_;
  std::uint32_t rate_;
  std::uint32_t whole_;     // ns a tick
  std::uint32_t fraction_;  // and 2^-32 ns
  std::uint32_t last_ = 0;
  std::uint32_t ticks_ = 0;  // of the running second: below rate_
  Time seconds_{0};
};

}  // namespace tm485::mcu
