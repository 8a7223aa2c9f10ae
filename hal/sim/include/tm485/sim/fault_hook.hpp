// The seam for injected faults: what a fault may do to a burst of characters.
#pragma once

#include "tm485/sim/burst.hpp"

namespace tm485::sim {

/// A fault. Called once for each burst when it is put on the line, before anyone hears it.
class FaultHook {
 public:
  virtual ~FaultHook() = default;

  /// May change bytes and framing errors, drop or insert characters (`count`), and shift the burst or its
  /// driver interval in time, though not to before the instant up to which the line has been processed.
  /// Returns true if it changed anything: an altered request is no evidence for the T1 judge.
  virtual bool on_burst(Burst& burst) noexcept = 0;

  /// When it next speaks by itself: the start of a burst of its own; kNever: it does not.
  [[nodiscard]] virtual Time next_own() const noexcept { return kNever; }

  /// Fills in that burst and moves on: next_own() is later from then on. Other faults do not see the burst. False: there
  /// is none after all.
  virtual bool on_own(Burst& /*burst*/) noexcept { return false; }

 protected:
  FaultHook() = default;
  FaultHook(const FaultHook&) = default;
  FaultHook& operator=(const FaultHook&) = default;
};

}  // namespace tm485::sim
