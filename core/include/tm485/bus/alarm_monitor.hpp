// AlarmMonitor: SF and ALMC over time: which bits are set (live), which were since the last verified reset (latched).
//
// A bit changes when as many replies in a row say so as the debounce asks: a single wrong frame that passes the CRC raises
// no alarm. What was set stays latched, whatever later replies say, until a run of resets was read back (ResetRun).
// Specification: sections 3 and 6.
#pragma once

#include <cstdint>

#include "tm485/bus/reset_outcome.hpp"
#include "tm485/protocol/status.hpp"

namespace tm485 {

/// One owner: the bus. Every function: constant time.
class AlarmMonitor {
 public:
  static constexpr std::uint8_t kMostDebounce = 4;

  /// `debounce`: replies in a row that must agree, 1..kMostDebounce.
  explicit AlarmMonitor(const AlarmPolicy& policy, std::uint8_t debounce = 2) noexcept
      : policy_(policy), ones_(all_if(debounce & 1U)), twos_(all_if(debounce & 2U)) {}

  /// Start-up begins: what the encoder says behind it is no news.
  void on_startup() noexcept { off_ = 0; }

  /// A good reply said `status`; `known` are the bits that it had. Answers those that are live from now on, and were seen
  /// off since the last start-up. All bits are counted at once, in two words: how often in a row a bit was not as it is
  /// held. Four wraps to 0, as the debounce of 4 does.
  StatusSet on_reply(StatusSet status, StatusSet known) noexcept {
    const unsigned has = known.bits();
    off_ = word(off_ | (~status.bits() & has));
    const unsigned differs = (status.bits() ^ live_) & has;
    const unsigned ones = ~count_ones_ & differs;
    const unsigned twos = (count_twos_ ^ count_ones_) & differs;
    const unsigned reached = differs & ~(ones ^ ones_) & ~(twos ^ twos_);
    live_ = word(live_ ^ reached);
    latched_ = word(latched_ | live_);
    count_ones_ = word((ones & ~reached) | (count_ones_ & ~has));
    count_twos_ = word((twos & ~reached) | (count_twos_ & ~has));
    return StatusSet(word(reached & live_ & off_));
  }

  /// A run of resets has ended. Verified, and one that clears error bits: what it left is live, and nothing else latched.
  void on_reset(const ResetOutcome& outcome) noexcept {
    const bool read_back =
        outcome.verdict == ResetVerdict::verified || outcome.verdict == ResetVerdict::cause_persists;
    if (!read_back || outcome.kind == ResetKind::zero) return;
    live_ = outcome.status_after.bits();
    latched_ = live_;
    count_ones_ = count_twos_ = 0;
  }

  /// Bits that are set now.
  [[nodiscard]] StatusSet live() const noexcept { return StatusSet(live_); }
  /// Bits that were set since the bus was made, or since the last verified reset.
  [[nodiscard]] StatusSet latched() const noexcept { return StatusSet(latched_); }
  /// What they mean by the profile's policy.
  [[nodiscard]] AlarmLevel live_level() const noexcept { return policy_.level(live()); }
  [[nodiscard]] AlarmLevel latched_level() const noexcept { return policy_.level(latched()); }

 private:
  [[nodiscard]] static constexpr std::uint16_t all_if(bool set) noexcept { return set ? 0xFFFF : 0; }
  [[nodiscard]] static constexpr std::uint16_t word(unsigned bits) noexcept {
    return static_cast<std::uint16_t>(bits);
  }

  AlarmPolicy policy_;
  std::uint16_t ones_;  ///< the debounce as two words of equal bits
  std::uint16_t twos_;
  std::uint16_t live_ = 0;
  std::uint16_t latched_ = 0;
  std::uint16_t count_ones_ = 0;
  std::uint16_t count_twos_ = 0;
  std::uint16_t off_ = 0;  ///< bits that a reply had at 0 since the last start-up
};

}  // namespace tm485
