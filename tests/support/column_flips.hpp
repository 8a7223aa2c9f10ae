// Noise that no checksum finds: one valid EEPROM request becomes another.
#pragma once

#include <cstdint>
#include <random>

#include "tm485/sim/burst.hpp"
#include "tm485/sim/fault_hook.hpp"

namespace tm485::test {

/// The same bit of two bytes of an EEPROM request: the CRC holds, so the encoder does something else.
class ColumnFlips : public sim::FaultHook {
 public:
  ColumnFlips(double probability, std::uint64_t seed) : random_(seed), probability_(probability) {}
  bool on_burst(sim::Burst& burst) noexcept override {
    if (burst.talker != sim::Talker::host || burst.count < 3) return false;
    std::uniform_real_distribution<> draw;
    if (draw(random_) >= probability_) return false;
    const unsigned bit = static_cast<unsigned>(random_() % 7);  // bit 7 of ADF is no address
    const unsigned first = 1 + static_cast<unsigned>(random_() % (burst.count - 1U));
    unsigned second = first;
    while (second == first) second = 1 + static_cast<unsigned>(random_() % (burst.count - 1U));
    burst.bytes[first] ^= static_cast<std::uint8_t>(1U << bit);
    burst.bytes[second] ^= static_cast<std::uint8_t>(1U << bit);
    ++flips_;
    return true;
  }
  [[nodiscard]] unsigned flips() const { return flips_; }

 private:
  std::mt19937_64 random_;
  double probability_;
  unsigned flips_ = 0;
};

}  // namespace tm485::test
