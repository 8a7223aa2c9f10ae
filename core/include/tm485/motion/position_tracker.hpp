// PositionTracker: replies in, samples out. Turns the wrapping counts of the encoder into one
// 64-bit position and remembers the last one for the cycles that bring none.
//
//   position = (turns - reference turn) * 2^bits + ABS - zero offset, then the direction.
//
// Turns and ABS of a sample come from one ID3 frame. Replies without turns (ID0, or an encoder that
// has none) are unwrapped by their distance from the last position; that is only possible while the
// shaft cannot have turned by half a revolution, so a longer gap is position_lost, never a guess.
// Specification: sections 3 and 8.
#pragma once

#include <cstdint>
#include <expected>

#include "tm485/errc.hpp"
#include "tm485/motion/axis_config.hpp"
#include "tm485/motion/sample.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// One owner (the bus's context). Every function: constant time, no 64-bit division but in the constructor.
class PositionTracker {
 public:
  /// `profile` must outlive the tracker.
  PositionTracker(const CompiledProfile& profile, const AxisConfig& axis) noexcept;

  /// A reply latched at `latch` becomes a fresh sample. Error: position_lost (see above); then nothing
  /// has changed and only a reply with turns, or `forget`, helps.
  [[nodiscard]] std::expected<Sample, Errc> update(const Reply& reply, Time latch) noexcept;

  /// The last sample again, marked held; invalid if it is older than `max_hold` at `now`, or if there is none.
  [[nodiscard]] Sample hold(Time now, Time max_hold) noexcept;

  /// Forgets the position (start-up, restart): the next reply starts anew, `referenced` is false.
  /// The sample that it answers is invalid.
  Sample forget() noexcept;

  /// The axis was homed, or is no longer.
  void set_referenced(bool referenced) noexcept { last_.referenced_ = referenced; }

  /// True if two frames, `elapsed` apart, can come from one shaft turning at no more than max_speed_rpm.
  [[nodiscard]] bool consistent(const Frame& earlier, const Frame& later, Time elapsed) const noexcept;

  /// The longest gap over which single-turn data can be unwrapped: half a revolution at max_speed_rpm.
  [[nodiscard]] Time unwrap_limit() const noexcept { return unwrap_limit_; }

 private:
  [[nodiscard]] std::expected<std::int64_t, Errc> unwrap(const Frame& frame, Time latch) const noexcept;
  void place(std::int64_t raw, std::uint32_t abs) noexcept;
  [[nodiscard]] bool turns_survived(const Frame& frame) const noexcept;

  const CompiledProfile* profile_;
  AxisConfig axis_;
  std::int64_t offset_;       ///< reference turn and zero offset, in counts
  std::int64_t speed_limit_;  ///< counts per 2^20 ns
  Time unwrap_limit_;
  std::int64_t raw_ = 0;    ///< turns * 2^bits + ABS, unwrapped
  Time position_latch_{0};  ///< when raw_ was latched
  bool has_raw_ = false;
  Sample last_;
};

inline std::expected<std::int64_t, Errc> PositionTracker::unwrap(const Frame& frame,
                                                                 Time latch) const noexcept {
  const Profile& profile = profile_->profile();
  const unsigned bits = profile.single_turn_bits;
  const std::uint32_t abs = frame.abs();
  if (frame.id() == DataId::everything && profile.multi_turn_bits != 0) {
    if (!has_raw_) return (std::int64_t{frame.turns(profile.multi_turn_bits)} << bits) + abs;
    const std::int64_t turn = raw_ >> bits;
    const auto step =
        Frame::sign_extend(frame.abm() - static_cast<std::uint32_t>(turn), profile.multi_turn_bits);
    return ((turn + step) << bits) + abs;
  }
  if (!has_raw_) {
    if (profile.multi_turn_bits != 0) return std::unexpected(Errc::position_lost);
    return std::int64_t{abs};
  }
  if (latch - position_latch_ > unwrap_limit_) return std::unexpected(Errc::position_lost);
  return raw_ + Frame::sign_extend(abs - static_cast<std::uint32_t>(raw_), bits);
}

inline void PositionTracker::place(std::int64_t raw, std::uint32_t abs) noexcept {
  const unsigned bits = profile_->profile().single_turn_bits;
  raw_ = raw;
  has_raw_ = true;
  last_.single_turn_ = abs;
  const std::int64_t position = raw - offset_;
  last_.position_ = axis_.reversed ? -position : position;
  const std::uint32_t angle = (abs << (32 - bits)) * axis_.pole_pairs;
  last_.electrical_angle_ = (axis_.reversed ? 0U - angle : angle) + axis_.electrical_offset;
}

/// A battery kept the turns over the power-off, and the encoder does not say that they were lost.
inline bool PositionTracker::turns_survived(const Frame& frame) const noexcept {
  constexpr StatusSet kTurnsLost =
      StatusSet::of(StatusBit::over_speed) | StatusSet::of(StatusBit::counter_overflow) |
      StatusSet::of(StatusBit::multi_turn_error) | StatusSet::of(StatusBit::battery_error);
  return profile_->profile().battery && frame.id() == DataId::everything &&
         (frame.status() & kTurnsLost).empty();
}

inline std::expected<Sample, Errc> PositionTracker::update(const Reply& reply, Time latch) noexcept {
  const Frame& frame = reply.frame();
  const Layout& fields = frame.fields();
  if (fields.abs_at != 0) {
    const auto raw = unwrap(frame, latch);
    if (!raw) return std::unexpected(raw.error());
    if (!has_raw_) last_.referenced_ = turns_survived(frame);
    place(*raw, frame.abs());
    position_latch_ = latch;
  }
  const unsigned multi_turn_bits = profile_->profile().multi_turn_bits;
  if (fields.abm_at != 0 && multi_turn_bits != 0) last_.turns_ = frame.turns(multi_turn_bits);
  if (fields.enid_at != 0) last_.enid_ = frame.enid();
  last_.status_ = StatusSet(frame.sf(), fields.almc_at != 0 ? frame.almc() : last_.status_.almc());
  last_.alarm_ = profile_->profile().alarms.level(last_.status_);
  last_.id_ = fields.id;
  last_.has_position_ = fields.abs_at != 0;
  last_.quality_ = Quality::fresh;
  last_.latch_time_ = latch;
  ++last_.sequence_;
  return last_;
}

}  // namespace tm485
