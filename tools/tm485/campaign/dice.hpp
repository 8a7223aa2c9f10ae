// Dice: what runs are drawn with. The same seed gives the same run on every machine.
#pragma once

#include <cmath>
#include <cstdint>

#include "tm485/sim/random.hpp"
#include "tm485/time.hpp"

namespace tm485::cli::campaign {

/// One owner.
class Dice {
 public:
  explicit Dice(std::uint64_t seed) noexcept : random_(seed) {}
  std::int64_t below(std::int64_t limit) noexcept { return random_.below(limit); }
  bool once_in(std::int64_t n) noexcept { return below(n) == 0; }
  double between(double low, double high) noexcept { return low + (high - low) * random_.unit(); }
  /// 10 to a power between the two.
  double decade(double low, double high) noexcept { return std::pow(10.0, between(low, high)); }
  Time span(Time low, Time high) noexcept {
    return low + Time{std::llround(between(0.0, 1.0) * static_cast<double>((high - low).count()))};
  }
  /// In whole microseconds: what is drawn is to be read.
  Time span_us(Time low, Time high) noexcept { return Time{span(low, high).count() / 1'000 * 1'000}; }
  std::uint64_t seed() noexcept { return random_.next() >> 40; }

 private:
  sim::Random random_;
};

}  // namespace tm485::cli::campaign
