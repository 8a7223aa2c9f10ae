// Simple seeded faults for the line.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tm485/sim/fault_hook.hpp"
#include "tm485/sim/random.hpp"

namespace tm485::sim {

/// Flips data bits independently of each other, with one probability for requests and one for everything
/// else. Start and stop bits stay.
class BitErrors final : public FaultHook {
 public:
  /// Probabilities 0..1 of one bit being wrong.
  BitErrors(double on_requests, double on_replies, std::uint64_t seed) noexcept;

  bool on_burst(Burst& burst) noexcept override;

  [[nodiscard]] std::uint64_t bits_flipped() const noexcept { return bits_flipped_; }

 private:
  /// One direction. Draws how many bits are good until the next bad one, so good bursts cost nothing.
  struct Channel {
    double log_good = 0.0;  // logarithm of the probability that a bit is good
    std::int64_t good_bits_left = 0;
  };
  void draw(Channel& channel) noexcept;

  Random random_;
  Channel requests_;
  Channel replies_;
  std::uint64_t bits_flipped_ = 0;
};

/// Loses characters: whole replies, and single characters in either direction (those after it close up).
class LostCharacters final : public FaultHook {
 public:
  /// Probabilities 0..1: of a reply being lost as a whole, and of one character being lost.
  LostCharacters(double whole_reply, double character, std::uint64_t seed) noexcept
      : random_{seed}, whole_reply_{whole_reply}, character_{character} {}

  bool on_burst(Burst& burst) noexcept override;

  [[nodiscard]] std::uint64_t replies_lost() const noexcept { return replies_lost_; }
  [[nodiscard]] std::uint64_t characters_lost() const noexcept { return characters_lost_; }

 private:
  Random random_;
  double whole_reply_;
  double character_;
  std::uint64_t replies_lost_ = 0;
  std::uint64_t characters_lost_ = 0;
};

/// Several faults on one line, in the order in which they were added.
class FaultChain final : public FaultHook {
 public:
  static constexpr std::size_t kCapacity = 8;

  /// `fault` must outlive the chain. Returns false if the chain is full.
  bool add(FaultHook& fault) noexcept;

  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }

  bool on_burst(Burst& burst) noexcept override;

 private:
  std::array<FaultHook*, kCapacity> faults_{};
  std::size_t count_ = 0;
};

}  // namespace tm485::sim
