// LatchSkew: how far apart several buses latch that are meant to latch at one instant.
//
// A round is one instant of the common grid, epoch + n times the length. Its skew is the latest less the earliest
// latch of those that answered. Specification: section 4.
#pragma once

#include <algorithm>
#include <cstdint>

#include "tm485/bus/statistics.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// One owner. Every function: constant time; a 64-bit division only after rounds that nobody answered, and for
/// steps of a pattern that are not its first.
class LatchSkew {
 public:
  /// `length` above 0: of the members' patterns.
  LatchSkew(Time epoch, Time length) noexcept : epoch_(epoch), length_(length) {}

  /// One of `members` has latched at `latch` what was due at `due`. What is not due on the grid does not count.
  void add(Time due, Time latch, std::uint32_t members) noexcept {
    if (due != due_ && !begin_round(due)) return;
    earliest_ = std::min(earliest_, latch);
    latest_ = std::max(latest_, latch);
    if (++answered_ == members) {
      skew_.add(latest_ - earliest_);
      due_is_open_ = false;
    }
  }

  /// One value a round, complete or not.
  [[nodiscard]] const TimeStatistic& skew() const noexcept { return skew_; }
  /// Rounds that were over before every member had answered, or in which none did.
  [[nodiscard]] std::uint32_t incomplete() const noexcept { return incomplete_; }

 private:
  /// False if `due` is not on the grid, or its round is over.
  [[nodiscard]] bool begin_round(Time due) noexcept {
    std::int64_t rounds = 1;
    if (due - due_ != length_) [[unlikely]] {
      if (due < due_ || (due - epoch_) % length_ != Time{0}) return false;
      if (due_ != -kNever) rounds = (due - due_) / length_;
    }
    if (due_is_open_) skew_.add(latest_ - earliest_);
    const std::int64_t missed = rounds - 1 + (due_is_open_ ? 1 : 0);
    saturating_increment(incomplete_, static_cast<std::uint32_t>(std::min<std::int64_t>(missed, UINT32_MAX)));
    due_ = due;
    due_is_open_ = true;
    earliest_ = kNever;
    latest_ = -kNever;
    answered_ = 0;
    return true;
  }

  Time epoch_;
  Time length_;
  Time due_ = -kNever;  ///< the round that is under way
  Time earliest_{0};
  Time latest_{0};
  std::uint32_t answered_ = 0;
  std::uint32_t incomplete_ = 0;
  bool due_is_open_ = false;  ///< somebody has answered, and somebody has not
  TimeStatistic skew_{Time{0}, 6};
};

}  // namespace tm485
