// PositionTracker: replies in, samples out. Turns the wrapping counts of the encoder into one
// 64-bit position and remembers the last one for the cycles that bring none.
//
//   position = (turns - reference turn) * 2^bits + ABS - zero offset, then the direction.
//
// Turns and ABS of a sample come from one ID3 frame. Replies without turns (ID0, or an encoder that
// has none) are unwrapped by their distance from the last position; that is only possible while the
// shaft cannot have turned by half a revolution, so a longer gap is position_lost, never a guess.
// A position where the shaft cannot be is held back by the PlausibilityGate, and so are turns that come without a position
// (ID1): two flips in one bit column pass the CRC. Specification: sections 3 and 8.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>

#include "tm485/errc.hpp"
#include "tm485/motion/axis_config.hpp"
#include "tm485/motion/plausibility.hpp"
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
  /// Answers ok; position_lost (see above), after which only a reply with turns or `forget` helps; status_inconsistent: SF and
  /// ALMC contradict each other, in a way that neither the reply before nor this encoder otherwise shows;
  /// position_implausible: the shaft cannot be there, and not enough replies have agreed yet that it is; or
  /// encoder_restarted: they agree, and the turn count is back at its start value. Turns without a position (ID1) that agree on
  /// another turn are not followed: position_lost. After an error the last sample stands.
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
  /// latch time and its age stay. Errors as update()'s: its turns have to be those of the position.
  [[nodiscard]] Errc note(const Reply& reply, Time latch, Time uncertainty) noexcept;

  /// The last sample again, marked held; invalid if it is older than `max_hold` at `now`, or if there is none.
  [[nodiscard]] Sample hold(Time now, Time max_hold) noexcept;

  /// Positions that the shaft cannot have come to, and that were followed after replies had agreed; wraps.
  [[nodiscard]] std::uint32_t discontinuities() const noexcept { return discontinuities_; }

  /// Forgets the position (start-up, restart): the next reply starts anew, `referenced` is false.
  /// The sample that it answers is invalid.
  Sample forget() noexcept;

  /// Start-up is through, the next sample will be fresh; positions are read every `gap` from now on (0: at no fixed time), and
  /// if `reads_turns` some of the replies have turns as well. With Continuity::re_reference the turns of the last position
  /// before forget() are carried on.
  void found(Time gap, bool reads_turns) noexcept;
  /// Start-up begins: the time of the next position is not known.
  void search() noexcept { gate_.expect_every(Time{0}); }
  /// Zero or turns were reset on purpose: what is known of them does not outlive the next forget(), nor do turns that were
  /// carried on: the encoder's count is the axis's again.
  void drop_turns() noexcept {
    tracking_ = kept_ = false;
    offset_ -= carried_;
    carried_ = 0;
  }
  /// A position was asked for, and the exchange has failed.
  void missed() noexcept { gate_.missed(); }

  /// The axis was homed, or is no longer.
  void set_referenced(bool referenced) noexcept { referenced_ = referenced; }

  /// Samples announce from now on that the bus is held for `span`, or with 0 that it is not (Sample::announced_hold).
  void announce_hold(Time span) noexcept {
    announced_hold_ns_ = static_cast<std::uint32_t>(std::min(span, Time{UINT32_MAX}).count());
  }

  /// The longest gap over which single-turn data can be unwrapped: half a revolution at max_speed_rpm.
  [[nodiscard]] Time unwrap_limit() const noexcept { return unwrap_limit_; }

 private:
  [[nodiscard]] static std::int64_t extended(std::uint64_t value, unsigned above) noexcept;
  [[nodiscard]] std::int64_t moved(const Frame& frame, unsigned bits, unsigned turn_bits,
                                   Time gap) const noexcept;
  [[nodiscard]] std::int64_t moved_far(std::uint64_t sent, unsigned above) const noexcept;
  [[nodiscard]] Errc unwrap(const Frame& frame, Time gap, std::int64_t& step) const noexcept;
  [[nodiscard]] bool turns_survived(const Frame& frame) const noexcept;
  [[nodiscard]] bool restarted(const Frame& frame, Turns turns) const noexcept;
  [[nodiscard]] bool doubtful(const Frame& frame) noexcept;
  [[nodiscard]] Errc judge_turns(const Frame& frame, Time latch, Time uncertainty) noexcept;
  void compose(Quality quality, Sample& sample) noexcept;
  void take_fields(const Frame& frame) noexcept;

  const CompiledProfile* profile_;
  std::int64_t offset_;  ///< reference turn and zero offset, in counts
  Time unwrap_limit_;
  PlausibilityGate gate_;

  // What the last reply left.
  std::int64_t raw_ = 0;    ///< turns * 2^bits + ABS, unwrapped; 0 without a position
  Time position_latch_{0};  ///< when raw_ was latched
  Time latch_{0};           ///< when the last reply was latched, with a position or without
  Time uncertainty_{0};     ///< of both
  Time turns_latch_{0};     ///< when turns without a position were latched, if it was later
  std::uint32_t sequence_ = 0;
  std::uint32_t electrical_offset_;
  std::uint32_t far_;  ///< a quarter of what turns and ABS together can say, in 2^16 counts: see moved_far()
  std::int32_t turns_ = 0;
  std::int32_t contrary_by_ = 0;  ///< turns by which the last ones that were held back are off
  std::uint32_t announced_hold_ns_ = 0;
  std::uint32_t discontinuities_ = 0;
  StatusSet status_;
  StatusSet odd_status_;  ///< contradicts itself, and is what this encoder says
  StatusSet suspected_;   ///< has been held back, and nothing else was told since
  AlarmLevel alarm_ = AlarmLevel::none;
  std::uint8_t enid_ = 0;
  std::uint8_t contrary_ = 0;  ///< so many in a row are off by that
  DataId id_ = DataId::everything;
  std::uint16_t pole_pairs_;
  bool reversed_;
  bool has_raw_ = false;
  bool has_reply_ = false;
  bool has_position_ = false;
  bool referenced_ = false;
  bool reads_turns_ = false;  ///< some replies of the cycle have turns, though not all

  // Before forget(), for Continuity::re_reference.
  bool keeps_turns_;
  bool tracking_ = false;  ///< found() was called since
  bool kept_ = false;      ///< there is a last position
  bool kept_referenced_ = false;
  std::int64_t kept_raw_ = 0;
  std::int64_t carried_ = 0;  ///< what of offset_ are turns that were carried on
};

/// A number whose upper `above` bits say nothing.
inline std::int64_t PositionTracker::extended(std::uint64_t value, unsigned above) noexcept {
  // Sign extension in the half that has the sign: 64-bit shifts by a variable are long.
  if (above < 32) {
    const auto high = static_cast<std::int32_t>(static_cast<std::uint32_t>(value >> 32) << above) >> above;
    return static_cast<std::int64_t>(std::uint64_t{static_cast<std::uint32_t>(high)} << 32 |
                                     static_cast<std::uint32_t>(value));
  }
  return Frame::sign_extend(static_cast<std::uint32_t>(value), 64 - above);
}

/// How far a frame with turns is from the last position: as a number of as many bits as turns and ABS have together, so
/// the shaft may have turned by half of them in `gap`.
inline std::int64_t PositionTracker::moved(const Frame& frame, unsigned bits, unsigned turn_bits,
                                           Time gap) const noexcept {
  const std::uint32_t turns = frame.abm();
  const std::uint64_t sent = (std::uint64_t{turns >> (32 - bits)} << 32 | turns << bits) + frame.abs();
  const unsigned above = 64 - bits - turn_bits;
  const std::int64_t nearest = extended(sent - static_cast<std::uint64_t>(raw_), above);
  constexpr int kHalfTurns = 64;  // that the shaft can have made; a quarter of all turns is as many or more
  if (static_cast<std::uint32_t>(nearest >> 16) + far_ >= 2 * far_ && gap < unwrap_limit_ * kHalfTurns)
      [[unlikely]]
    return moved_far(sent, above);
  return nearest;
}

/// The step from the last position. Without one, raw_ is zero.
inline Errc PositionTracker::unwrap(const Frame& frame, Time gap, std::int64_t& step) const noexcept {
  const Profile& profile = profile_->profile();
  const unsigned bits = profile.single_turn_bits;
  const unsigned turn_bits = profile.multi_turn_bits;
  if (frame.id() == DataId::everything && turn_bits != 0) {
    step = moved(frame, bits, turn_bits, gap);
    return Errc::ok;
  }
  if (!has_raw_) {
    if (turn_bits != 0) return Errc::position_lost;
    step = frame.abs();
    return Errc::ok;
  }
  if (gap >= unwrap_limit_) return Errc::position_lost;
  step = Frame::sign_extend(frame.abs() - static_cast<std::uint32_t>(raw_), bits);
  return Errc::ok;
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
  const std::uint32_t angle = (single_turn << (32 - bits)) * pole_pairs_;
  const std::int64_t position = raw_ - offset_;
  sample.position_ = reversed_ ? -position : position;
  sample.latch_time_ = latch_;
  sample.sequence_ = ++sequence_;
  sample.single_turn_ = single_turn;
  sample.turns_ = turns_;
  sample.electrical_angle_ = (reversed_ ? 0U - angle : angle) + electrical_offset_;
  sample.latch_uncertainty_ns_ = static_cast<std::uint32_t>(uncertainty_.count());
  sample.status_ = status_;
  sample.enid_ = enid_;
  sample.id_ = id_;
  sample.quality_ = quality;
  sample.alarm_ = alarm_;
  sample.referenced_ = referenced_;
  sample.has_position_ = has_position_ && quality != Quality::invalid;
  sample.announced_hold_ns_ = announced_hold_ns_;
  sample.half_width_ = gate_.half_width();
  sample.discontinuities_ = discontinuities_;
}

/// Everything of a reply but its position.
inline void PositionTracker::take_fields(const Frame& frame) noexcept {
  const Profile& profile = profile_->profile();
  if (frame.id() == DataId::everything) [[likely]] {
    if (profile.multi_turn_bits != 0) turns_ = frame.turns(profile.multi_turn_bits);
    enid_ = frame.enid();
    status_ = frame.status();
    alarm_ = profile.alarms.level(status_);
    return;
  }
  const Layout& fields = frame.fields();
  if (fields.abm_at != 0 && profile.multi_turn_bits != 0) turns_ = frame.turns(profile.multi_turn_bits);
  if (fields.enid_at != 0) enid_ = frame.enid();
  if (fields.sf_at != 0) {  // no ALMC in these: none of its bits
    alarm_ = profile.alarms.level(StatusSet(frame.sf(), 0));
    status_ = StatusSet(frame.sf(), status_.almc());
  }
}

inline Errc PositionTracker::seed(const Reply& reply, Time latch, Time uncertainty) noexcept {
  const Frame& frame = reply.frame();
  const DataId id = frame.id();
  const bool positioned = layout(id).abs_at != 0;
  if (id == DataId::everything) {
    if (frame.status().consistent()) [[likely]]
      suspected_ = StatusSet();
    else if (doubtful(frame))
      return Errc::status_inconsistent;
  }
  if (positioned) {
    // The longest time that can have passed since the last position.
    const Time gap = latch - position_latch_ + uncertainty + uncertainty_;
    std::int64_t step = 0;
    if (const Errc error = unwrap(frame, gap, step); error != Errc::ok) [[unlikely]]
      return error;
    const Turns turns = id == DataId::everything ? Turns::known
                        : reads_turns_           ? Turns::to_come
                                                 : Turns::guessed;
    switch (gate_.judge({raw_ + step, latch, uncertainty, turns})) {
      case GateVerdict::accepted:
        break;
      case GateVerdict::reacquired:
        if (restarted(frame, turns)) return Errc::encoder_restarted;
        ++discontinuities_;
        referenced_ = false;
        break;
      case GateVerdict::held_back:
        return Errc::position_implausible;
    }
    if (!has_raw_) referenced_ = turns_survived(frame);
    raw_ = gate_.raw();
    has_raw_ = true;
    position_latch_ = latch;
  } else if (const Errc error = judge_turns(frame, latch, uncertainty); error != Errc::ok) {
    return error;
  }
  take_fields(frame);
  id_ = id;
  has_position_ = positioned;
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
