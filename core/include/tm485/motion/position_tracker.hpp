// PositionTracker: replies in, samples out. Turns the wrapping counts of the encoder into one
// 64-bit position and remembers the last one for the cycles that bring none.
//
//   position = (turns - reference turn) * 2^bits + ABS - zero offset, then the direction.
//
// Turns and ABS of a sample come from one ID3 frame. Replies without turns (ID0, or an encoder that
// has none) are unwrapped by their distance from the last position; that is only possible while the
// shaft cannot have turned by half a revolution, so a longer gap is position_lost, never a guess.
// A position that the shaft cannot have reached since the last one (max_speed_rpm) is refused: two
// flips in one bit column pass the CRC. Specification: sections 3 and 8.
#pragma once

#include <algorithm>
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
  PositionTracker(const CompiledProfile&& profile, const AxisConfig& axis) = delete;

  /// A reply latched at `latch`, give or take `uncertainty`, becomes a fresh sample, written to `sample`.
  /// Answers ok; position_lost (see above), after which only a reply with turns or `forget` helps; or
  /// frames_inconsistent: the shaft cannot be there. After an error nothing has changed.
  [[nodiscard]] Errc update(const Reply& reply, Time latch, Time uncertainty, Sample& sample) noexcept;

  /// The same as a value, with the profile's latch uncertainty.
  [[nodiscard]] std::expected<Sample, Errc> update(const Reply& reply, Time latch) noexcept {
    Sample sample;
    const Errc error = update(reply, latch, profile_->profile().latch_uncertainty, sample);
    if (error != Errc::ok) return std::unexpected(error);
    return sample;
  }

  /// A reply to begin with, as update(), but no sample comes of it.
  [[nodiscard]] Errc seed(const Reply& reply, Time latch, Time uncertainty) noexcept;

  /// A reply without a position, between replies with one: turns, ENID and status are taken from it; the position, its
  /// latch time and its age stay.
  void note(const Reply& reply) noexcept;

  /// The last sample again, marked held; invalid if it is older than `max_hold` at `now`, or if there is none.
  [[nodiscard]] Sample hold(Time now, Time max_hold) noexcept;

  /// Forgets the position (start-up, restart): the next reply starts anew, `referenced` is false.
  /// The sample that it answers is invalid.
  Sample forget() noexcept;

  /// The axis was homed, or is no longer.
  void set_referenced(bool referenced) noexcept { referenced_ = referenced; }

  /// Samples announce from now on that the bus is held for `span`, or with 0 that it is not (Sample::announced_hold).
  void announce_hold(Time span) noexcept {
    announced_hold_ns_ = static_cast<std::uint32_t>(std::min(span, Time{UINT32_MAX}).count());
  }

  /// True if two frames, `elapsed` apart, can come from one shaft turning at no more than max_speed_rpm.
  [[nodiscard]] bool consistent(const Frame& earlier, const Frame& later, Time elapsed) const noexcept;

  /// The longest gap over which single-turn data can be unwrapped: half a revolution at max_speed_rpm.
  [[nodiscard]] Time unwrap_limit() const noexcept { return unwrap_limit_; }

 private:
  [[nodiscard]] std::expected<std::int64_t, Errc> unwrap(const Frame& frame, Time gap) const noexcept;
  [[nodiscard]] bool reachable(std::int64_t distance, Time elapsed) const noexcept;
  [[nodiscard]] bool turns_survived(const Frame& frame) const noexcept;
  void compose(Quality quality, Sample& sample) noexcept;
  void take_fields(const Frame& frame) noexcept;

  const CompiledProfile* profile_;
  AxisConfig axis_;
  std::int64_t offset_;       ///< reference turn and zero offset, in counts
  std::int64_t speed_limit_;  ///< counts per 2^20 ns
  Time unwrap_limit_;

  // What the last reply left.
  std::int64_t raw_ = 0;    ///< turns * 2^bits + ABS, unwrapped
  Time position_latch_{0};  ///< when raw_ was latched
  Time latch_{0};           ///< when the last reply was latched, with a position or without
  Time uncertainty_{0};     ///< of both
  std::uint32_t sequence_ = 0;
  std::int32_t turns_ = 0;
  std::uint32_t announced_hold_ns_ = 0;
  StatusSet status_;
  AlarmLevel alarm_ = AlarmLevel::none;
  std::uint8_t enid_ = 0;
  DataId id_ = DataId::everything;
  bool has_raw_ = false;
  bool has_reply_ = false;
  bool has_position_ = false;
  bool referenced_ = false;
};

inline std::expected<std::int64_t, Errc> PositionTracker::unwrap(const Frame& frame,
                                                                 Time gap) const noexcept {
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
  if (gap >= unwrap_limit_) return std::unexpected(Errc::position_lost);
  return raw_ + Frame::sign_extend(abs - static_cast<std::uint32_t>(raw_), bits);
}

/// Can a shaft at max_speed_rpm move so far in `elapsed`? Two counts are forgiven: both ends are quantised.
inline bool PositionTracker::reachable(std::int64_t distance, Time elapsed) const noexcept {
  constexpr std::int64_t kQuantisation = 2;
  constexpr Time kFine = std::chrono::seconds(10);  // keeps the product in 63 bits
  constexpr Time kLongest = std::chrono::hours(24);
  if (elapsed > kLongest) elapsed = kLongest;
  const std::int64_t limit = elapsed > kFine ? speed_limit_ * ((elapsed.count() >> 20) + 1)
                                             : ((speed_limit_ * elapsed.count()) >> 20) + kQuantisation;
  return elapsed >= Time{0} && distance <= limit && -distance <= limit;
}

/// A battery kept the turns over the power-off, and the encoder does not say that they were lost.
inline bool PositionTracker::turns_survived(const Frame& frame) const noexcept {
  constexpr StatusSet kTurnsLost =
      StatusSet::of(StatusBit::over_speed) | StatusSet::of(StatusBit::counter_overflow) |
      StatusSet::of(StatusBit::multi_turn_error) | StatusSet::of(StatusBit::battery_error);
  return profile_->profile().battery && frame.id() == DataId::everything &&
         (frame.status() & kTurnsLost).empty();
}

/// Writes every field, straight to where the sample is wanted: copying a record that was just written
/// field by field costs more than writing it twice (a store-forwarding stall per 16 bytes).
inline void PositionTracker::compose(Quality quality, Sample& sample) noexcept {
  const unsigned bits = profile_->profile().single_turn_bits;
  const auto single_turn = static_cast<std::uint32_t>(raw_) & ((1U << bits) - 1U);
  const std::uint32_t angle = (single_turn << (32 - bits)) * axis_.pole_pairs;
  const std::int64_t position = raw_ - offset_;
  sample.position_ = axis_.reversed ? -position : position;
  sample.latch_time_ = latch_;
  sample.sequence_ = ++sequence_;
  sample.single_turn_ = single_turn;
  sample.turns_ = turns_;
  sample.electrical_angle_ = (axis_.reversed ? 0U - angle : angle) + axis_.electrical_offset;
  sample.latch_uncertainty_ns_ = static_cast<std::uint32_t>(uncertainty_.count());
  sample.status_ = status_;
  sample.enid_ = enid_;
  sample.id_ = id_;
  sample.quality_ = quality;
  sample.alarm_ = alarm_;
  sample.referenced_ = referenced_;
  sample.has_position_ = has_position_ && quality != Quality::invalid;
  sample.announced_hold_ns_ = announced_hold_ns_;
}

/// Everything of a reply but its position.
inline void PositionTracker::take_fields(const Frame& frame) noexcept {
  const Layout& fields = frame.fields();
  const unsigned multi_turn_bits = profile_->profile().multi_turn_bits;
  if (fields.abm_at != 0 && multi_turn_bits != 0) turns_ = frame.turns(multi_turn_bits);
  if (fields.enid_at != 0) enid_ = frame.enid();
  if (fields.sf_at != 0) {
    const StatusSet heard(frame.sf(), frame.almc());  // no ALMC in this reply: none of its bits
    alarm_ = profile_->profile().alarms.level(heard);
    status_ = StatusSet(frame.sf(), fields.almc_at != 0 ? frame.almc() : status_.almc());
  }
}

inline Errc PositionTracker::seed(const Reply& reply, Time latch, Time uncertainty) noexcept {
  const Frame& frame = reply.frame();
  const Layout& fields = frame.fields();
  if (fields.abs_at != 0) {
    // The longest time that can have passed since the last position.
    const Time gap = latch - position_latch_ + uncertainty + uncertainty_;
    const auto raw = unwrap(frame, gap);
    if (!raw) return raw.error();
    if (!has_raw_) {
      referenced_ = turns_survived(frame);
    } else if (!reachable(*raw - raw_, gap)) {
      return Errc::frames_inconsistent;
    }
    raw_ = *raw;
    has_raw_ = true;
    position_latch_ = latch;
  }
  take_fields(frame);
  id_ = fields.id;
  has_position_ = fields.abs_at != 0;
  has_reply_ = true;
  latch_ = latch;
  uncertainty_ = uncertainty;
  return Errc::ok;
}

inline Errc PositionTracker::update(const Reply& reply, Time latch, Time uncertainty,
                                    Sample& sample) noexcept {
  const Errc error = seed(reply, latch, uncertainty);
  if (error == Errc::ok) compose(Quality::fresh, sample);
  return error;
}

}  // namespace tm485
