// One run of the whole receiving side on a noisy line, and what the judge has counted in it.
#pragma once

#include <cstdint>
#include <span>

#include "judge.hpp"
#include "noise.hpp"

namespace residual {

/// Where patterns that only the gate can find are put into frames, besides what the line does.
enum class Forced : std::uint8_t {
  none,
  steady,    ///< in about one frame of 64, far from each other
  start_up,  ///< in one of the first frames behind a restart
};

struct Plan {
  Line line;
  Forced forced = Forced::none;
  std::span<const Bytes>
      pool;                  ///< the patterns to put in; empty: those that a line of independent errors makes
  std::uint64_t frames = 0;  ///< ID3 frames
  std::uint64_t seed = 1;
  std::int64_t period_ns = 62'500;
  std::int64_t uncertainty_ns = 500;  ///< of the latch, either way; the profile says so too
  double missing = 0;                 ///< so many frames do not come at all, one at a time
};

/// Frames of ID3, and what became of them.
struct Counts {
  std::uint64_t frames = 0;
  std::uint64_t changed = 0;  ///< with wrong bits
  std::uint64_t fresh = 0;    ///< that became samples
  // Taken for good although bits were wrong; dangerous: and the position is off by more than 0.18 degrees.
  std::uint64_t crc_wrong = 0, crc_dangerous = 0;
  std::uint64_t strict_wrong = 0, strict_dangerous = 0;
  std::uint64_t gate_wrong = 0, gate_dangerous = 0;
  std::uint64_t position_wrong = 0;  ///< of the gate's: with any error of the position
  /// Samples that are off by more than the half-width stated with them; `_by_more`: with more wrong readings behind it than
  /// the half-width counts (docs/adr/0013-plausibility-gate.md).
  std::uint64_t beyond = 0, beyond_by_more = 0;
  std::uint64_t largest = 0;  ///< greatest error of a sample, counts
  // Patterns that were put in.
  std::uint64_t forced = 0, forced_wrong = 0, forced_dangerous = 0;
  std::uint64_t mismatch =
      0;  ///< where core's strict parsing and the judge's masks differ: the judge is wrong
  // Of the bus.
  std::uint64_t held_back = 0;  ///< position_implausible
  std::uint64_t discontinuities = 0;
  std::uint64_t startups = 0;

  void add(const Counts& other);
};

[[nodiscard]] Counts run(const Plan& plan);

}  // namespace residual
