#include "tm485/motion/position_tracker.hpp"

#include <algorithm>

namespace tm485 {
namespace {

constexpr std::int64_t kNsPerMinute = 60'000'000'000;
constexpr std::int64_t kLargestOffset = std::int64_t{1} << 60;

}  // namespace

PositionTracker::PositionTracker(const CompiledProfile& profile, const AxisConfig& axis) noexcept
    : profile_(&profile),
      gate_(profile.profile().single_turn_bits, axis),
      electrical_offset_(axis.electrical_offset),
      pole_pairs_(axis.pole_pairs),
      reversed_(axis.reversed),
      keeps_turns_(axis.after_restart == Continuity::re_reference) {
  const unsigned bits = profile.profile().single_turn_bits;
  const std::int64_t rpm = std::clamp<std::int32_t>(axis.max_speed_rpm, 1, 1'000'000);
  const bool counts_turns = profile.profile().multi_turn_bits != 0;
  offset_ = (std::int64_t{counts_turns ? axis.reference_turn.value_or(profile.profile().multi_turn_start) : 0}
             << bits) +
            std::clamp(axis.zero_offset, -kLargestOffset, kLargestOffset);  // made before start() refuses it
  unwrap_limit_ = Time(kNsPerMinute / 2 / rpm);
  far_ = 1U << (std::max(bits + profile.profile().multi_turn_bits, 18U) - 18);
}

/// The shaft has not turned so far: it is a step, and where that goes the nearest does not tell. Half of all turns is as far up
/// as down. It stays in the round of the turn counter in which it was.
std::int64_t PositionTracker::moved_far(std::uint64_t sent, unsigned above) const noexcept {
  return extended(sent, above) - extended(static_cast<std::uint64_t>(raw_), above);
}

Errc PositionTracker::note(const Reply& reply, Time latch, Time uncertainty) noexcept {
  const Errc error = judge_turns(reply.frame(), latch, uncertainty);
  if (error == Errc::ok) take_fields(reply.frame());
  return error;
}

/// Turns without a position: is the shaft in that turn, by its last position, or where no position is read by the last turns? Some
/// that agree on another one say that what is known is wrong, and not which of the two is right: start-up asks for both at once.
[[gnu::noinline]] Errc PositionTracker::judge_turns(const Frame& frame, Time latch,
                                                    Time uncertainty) noexcept {
  const Profile& profile = profile_->profile();
  const unsigned turn_bits = profile.multi_turn_bits;
  if (frame.fields().abm_at == 0 || turn_bits == 0 || !has_raw_) return Errc::ok;
  const unsigned bits = profile.single_turn_bits;
  std::int64_t lowest = turns_;
  std::int64_t highest = turns_;
  if (has_position_) {
    const PlausibilityGate::Range can_be = gate_.range_at(latch, uncertainty);
    lowest = can_be.lowest >> bits;
    highest = can_be.highest >> bits;
  } else {
    const Time since = latch - std::max(turns_latch_, position_latch_) + uncertainty + uncertainty_;
    const std::int64_t most = (gate_.reach(since) >> bits) + 1;
    lowest -= most;
    highest += most;
  }
  const auto off_by = [&](std::int64_t turns) {
    return Frame::sign_extend(frame.abm() - static_cast<std::uint32_t>(turns), turn_bits);
  };
  const std::int64_t width = highest - lowest;
  const std::uint32_t all = (std::uint32_t{1} << turn_bits) - 1;
  if (((frame.abm() - static_cast<std::uint32_t>(lowest)) & all) <= width) {
    contrary_ = 0;
    turns_latch_ = latch;
    return Errc::ok;
  }
  const std::int32_t off = off_by(lowest + width / 2);
  const std::int32_t apart = Frame::sign_extend(
      static_cast<std::uint32_t>(off) - static_cast<std::uint32_t>(contrary_by_), turn_bits);
  contrary_ = contrary_ != 0 && apart >= -1 && apart <= 1 ? static_cast<std::uint8_t>(contrary_ + 1) : 1;
  contrary_by_ = off;
  if (contrary_ < PlausibilityGate::kAgree) return Errc::position_implausible;
  contrary_ = 0;
  const std::int32_t start = profile.multi_turn_start;
  return turns_ != start && frame.turns(turn_bits) == start ? Errc::encoder_restarted : Errc::position_lost;
}

Sample PositionTracker::hold(Time now, Time max_hold) noexcept {
  if (has_reply_ && now - latch_ > max_hold) has_reply_ = false;
  Sample sample;
  compose(has_reply_ ? Quality::held : Quality::invalid, sample);
  return sample;
}

/// SF and ALMC contradict each other, and not in the way that this encoder is known to do, by two replies in a row: one that
/// means something else by these bits costs one reply, wrong bits are not taken for it.
bool PositionTracker::doubtful(const Frame& frame) noexcept {
  const StatusSet told = frame.status();
  if (told != odd_status_ && told != suspected_) {
    suspected_ = told;
    return true;
  }
  odd_status_ = told;
  suspected_ = StatusSet();
  return false;
}

/// Without a battery the turns begin anew with every power-up; with one a reset by somebody else looks the same.
/// A reply that has no turns itself may be the last of those that agree: then the gate has found them.
bool PositionTracker::restarted(const Frame& frame, Turns turns) const noexcept {
  const Profile& profile = profile_->profile();
  if (profile.multi_turn_bits == 0 || turns_ == profile.multi_turn_start) return false;
  if (turns == Turns::to_come) return gate_.raw() >> profile.single_turn_bits == profile.multi_turn_start;
  return frame.id() == DataId::everything && frame.turns(profile.multi_turn_bits) == profile.multi_turn_start;
}

void PositionTracker::found(Time gap, bool reads_turns) noexcept {
  gate_.expect_every(gap);
  reads_turns_ = reads_turns;
  tracking_ = true;
  if (!kept_) return;
  // Whole turns, so that the last position is at most half a turn away.
  const unsigned bits = profile_->profile().single_turn_bits;
  const std::int64_t half = std::int64_t{1} << (bits - 1);
  const std::int64_t turns = ((raw_ - kept_raw_ + half) >> bits) * (std::int64_t{1} << bits);
  offset_ += turns;
  carried_ += turns;
  referenced_ = referenced_ || kept_referenced_;
  kept_ = false;
}

Sample PositionTracker::forget() noexcept {
  if (keeps_turns_ && tracking_ && has_raw_) {
    kept_ = true;
    kept_raw_ = raw_;
    kept_referenced_ = referenced_;
  }
  tracking_ = false;
  has_raw_ = false;
  raw_ = 0;
  gate_.forget();
  contrary_ = 0;
  has_reply_ = false;
  referenced_ = false;
  Sample sample;
  compose(Quality::invalid, sample);
  return sample;
}

}  // namespace tm485
