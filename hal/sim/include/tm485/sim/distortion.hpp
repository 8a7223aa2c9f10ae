// What a UART makes of a burst when the two ends of the line disagree: another bit rate, a swapped pair, a line that
// floats before the reply. Specification: section 1.
//
// The burst becomes a level over time, bit by bit and with the driver's lead and tail, and an ideal receiver samples
// it: falling edge, half a bit to check the start bit, then the middle of each bit. Nobody drives: mark.
#pragma once

#include <cstdint>

#include "tm485/sim/burst.hpp"
#include "tm485/sim/random.hpp"

namespace tm485::sim {

/// Which pair is connected the wrong way round: every level of it is inverted for the receiver at its end.
enum class Swap : std::uint8_t {
  none,
  pair,     ///< the one pair of a half-duplex line: each end hears the other inverted
  receive,  ///< what the host receives only: four wires, or an inverted receiver; its own echo as well
};

struct DistortionConfig {
  std::int64_t host_bits_per_second = 2'500'000;
  std::int64_t encoder_bits_per_second = 2'500'000;
  Swap swap = Swap::none;
  /// Probability 0..1 that the line, floating after the request, falls to space for one bit before a reply: the
  /// receiver takes that for a start bit and is out of step when the reply begins.
  double glitches = 0.0;
  std::uint64_t seed = 1;  ///< of the glitches
};

/// One owner; nothing blocks or allocates. The characters heard are put one behind the other from the first start bit
/// on, in the host's character time: a pause that misread bits would leave between them is not kept, and no more of
/// them come than begin within the time of the burst.
class Distortion {
 public:
  explicit Distortion(const DistortionConfig& config) noexcept;

  /// From now on this; the seed of the glitches stays.
  void configure(const DistortionConfig& config) noexcept;
  [[nodiscard]] const DistortionConfig& config() const noexcept { return config_; }

  /// False if everybody hears what was sent.
  [[nodiscard]] bool distorts() const noexcept { return distorts_; }

  /// A burst of the host as the encoder's receiver hears it, and as its own does.
  void host_at_encoder(Burst& burst) const noexcept;
  void host_at_host(Burst& burst) const noexcept;
  /// A burst of the encoder as the host's receiver hears it. Its driver interval follows the encoder's rate.
  void encoder_at_host(Burst& burst) noexcept;

  [[nodiscard]] std::uint64_t glitches() const noexcept { return glitches_; }

 private:
  DistortionConfig config_;
  bool distorts_ = false;
  Random random_;
  std::uint64_t glitches_ = 0;
};

}  // namespace tm485::sim
