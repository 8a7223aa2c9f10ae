// What a UART's divisor makes of its clock, solved at compile time or at set-up. Specification: section 1.
//
// A rate is refused outside ±2 %: a character is ten bits, sampled in their middle, which leaves 5 % for both ends
// together, and the encoder's clock needs its share.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <limits>

#include "tm485/errc.hpp"
#include "tm485/time.hpp"

namespace tm485::mcu {

/// How a UART divides its clock.
enum class BaudFamily : std::uint8_t {
  pl011,         ///< 16 samples a bit, divisor in 64ths (IBRD and FBRD)
  ns16550,       ///< 16 samples a bit, whole divisor (DLL and DLM)
  stm32_over16,  ///< 16 samples a bit, divisor in 16ths: BRR is clock / rate
  stm32_over8,   ///< 8 samples a bit, divisor in 8ths
  cmsdk,         ///< whole divisor of the clock itself, at least 16
};

/// rate = clock * multiplier / (divider * divisor), with the divisor in the unit of the registers.
struct BaudRule {
  std::uint32_t multiplier;
  std::uint32_t divider;
  std::uint32_t smallest;  ///< divisor
  std::uint32_t largest;
};

/// In the order of BaudFamily. Sources: ARM DDI 0183 (PL011) 3.3.6; National PC16550D 8.3; ST RM0090 30.3.4 and
/// RM0440 37.5.8 (whose over-8 divisor has its lowest bit cut off); ARM DDI 0479 (CMSDK) 4.3.
inline constexpr std::array<BaudRule, 5> kBaudRules{{
    {4, 1, 64, 65'535 * 64},
    {1, 16, 1, 65'535},
    {1, 1, 16, 65'535},
    {1, 1, 8, 32'767},
    {1, 1, 16, (1U << 20) - 1},
}};

/// A divisor, and what it makes.
struct BaudDivisor {
  std::uint32_t divisor = 0;   ///< in the family's unit: 64ths, 16ths, 8ths or whole
  std::uint32_t rate = 0;      ///< bit/s, rounded
  std::int32_t error_ppm = 0;  ///< of the rate, against the wish; rounded towards zero
  Time character_time{0};      ///< ten bits at this rate, rounded up
};

/// Why there is none.
struct BaudRefusal {
  Errc code = Errc::bad_argument;
  std::uint32_t nearest = 0;  ///< bit/s, the nearest that this clock makes; 0 if the clock or the wish is 0
};

namespace detail {

/// The rate of a divisor in bit/s, rounded.
constexpr std::uint64_t rate_of(const BaudRule& rule, std::uint64_t clock, std::uint64_t divisor) noexcept {
  const std::uint64_t scale = rule.divider * divisor;
  return (clock * rule.multiplier + scale / 2) / scale;
}

constexpr std::uint64_t distance(std::uint64_t a, std::uint64_t b) noexcept { return a > b ? a - b : b - a; }

}  // namespace detail

/// The divisor whose rate is nearest to `bit_rate`. `clock_hz` is the clock that the divisor divides, in Hz. Refused
/// if the rate is more than 2 % off, edges included in what is accepted. Any context; O(1), with 64-bit divisions:
/// for set-up, or in a static_assert:
///
///   static_assert(solve_baud(BaudFamily::pl011, 48'000'000, 2'500'000));
[[nodiscard]] constexpr std::expected<BaudDivisor, BaudRefusal> solve_baud(BaudFamily family,
                                                                           std::uint32_t clock_hz,
                                                                           std::uint32_t bit_rate) noexcept {
  const auto row = static_cast<std::size_t>(family);
  if (clock_hz == 0 || bit_rate == 0 || row >= kBaudRules.size()) return std::unexpected(BaudRefusal{});
  const BaudRule& rule = kBaudRules[row];
  const std::uint64_t clock = clock_hz;
  const std::uint64_t wish = bit_rate;

  // The divisor lies between two whole ones; the better of them is the one whose rate is nearer.
  std::uint64_t divisor = clock * rule.multiplier / (rule.divider * wish);
  if (divisor < rule.smallest) {
    divisor = rule.smallest;
  } else if (divisor >= rule.largest) {
    divisor = rule.largest;
  } else if (detail::distance(detail::rate_of(rule, clock, divisor + 1), wish) <
             detail::distance(detail::rate_of(rule, clock, divisor), wish)) {
    ++divisor;
  }

  const std::uint64_t rate = detail::rate_of(rule, clock, divisor);
  const std::uint64_t exact = clock * rule.multiplier;
  const std::uint64_t wanted = wish * rule.divider * divisor;
  if (detail::distance(exact, wanted) * 50 > wanted) {
    constexpr std::uint64_t kLargest = std::numeric_limits<std::uint32_t>::max();
    return std::unexpected(
        BaudRefusal{Errc::bad_argument, static_cast<std::uint32_t>(rate < kLargest ? rate : kLargest)});
  }
  constexpr std::int64_t kMillion = 1'000'000;
  constexpr std::int64_t kCharacter = 10'000'000'000;  // ten bits, in ns per bit/s
  const auto difference = static_cast<std::int64_t>(exact) - static_cast<std::int64_t>(wanted);
  const auto shown = static_cast<std::int64_t>(rate);
  return BaudDivisor{
      .divisor = static_cast<std::uint32_t>(divisor),
      .rate = static_cast<std::uint32_t>(rate),
      .error_ppm = static_cast<std::int32_t>(difference * kMillion / static_cast<std::int64_t>(wanted)),
      .character_time = Time{(kCharacter + shown - 1) / shown}};
}

}  // namespace tm485::mcu
