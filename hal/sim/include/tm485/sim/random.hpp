// Seeded random numbers for the simulator: the same seed gives the same run on every machine.
//
// The standard engines are portable, the standard distributions are not, so the few
// distributions that are needed stand here. The generator is SplitMix64.
#pragma once

#include <cstdint>

namespace tm485::sim {

class Random {
 public:
  explicit constexpr Random(std::uint64_t seed) noexcept : state_{seed} {}

  /// 64 random bits.
  constexpr std::uint64_t next() noexcept {
    state_ += 0x9E3779B97F4A7C15u;
    std::uint64_t mixed = state_;
    mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9u;
    mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EBu;
    return mixed ^ (mixed >> 31);
  }

  /// Uniform in 0..limit-1, without a division. `limit` 1..2^32.
  constexpr std::int64_t below(std::int64_t limit) noexcept {
    return static_cast<std::int64_t>(((next() >> 32) * static_cast<std::uint64_t>(limit)) >> 32);
  }

  /// Uniform in (0, 1]; never 0, so its logarithm exists.
  double unit() noexcept { return (static_cast<double>(next() >> 11) + 1.0) * 0x1p-53; }

 private:
  std::uint64_t state_;
};

}  // namespace tm485::sim
