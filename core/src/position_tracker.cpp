#include "tm485/motion/position_tracker.hpp"

#include <algorithm>

namespace tm485 {
namespace {

constexpr std::int64_t kNsPerMinute = 60'000'000'000;
constexpr std::int64_t kLargestOffset = std::int64_t{1} << 60;

}  // namespace

PositionTracker::PositionTracker(const CompiledProfile& profile, const AxisConfig& axis) noexcept
    : profile_(&profile),
      electrical_offset_(axis.electrical_offset),
      pole_pairs_(axis.pole_pairs),
      reversed_(axis.reversed) {
  const unsigned bits = profile.profile().single_turn_bits;
  const std::int64_t rpm = std::clamp<std::int32_t>(axis.max_speed_rpm, 1, 1'000'000);
  const bool counts_turns = profile.profile().multi_turn_bits != 0;
  offset_ = (std::int64_t{counts_turns ? axis.reference_turn.value_or(profile.profile().multi_turn_start) : 0}
             << bits) +
            std::clamp(axis.zero_offset, -kLargestOffset, kLargestOffset);  // made before start() refuses it
  // Rounded up: a limit may be a little wide, never too narrow.
  speed_limit_ = static_cast<std::uint32_t>((rpm << bits) / (kNsPerMinute >> 20) + 1);  // below 2^29
  unwrap_limit_ = Time(kNsPerMinute / 2 / rpm);
}

void PositionTracker::note(const Reply& reply) noexcept { take_fields(reply.frame()); }

Sample PositionTracker::hold(Time now, Time max_hold) noexcept {
  if (has_reply_ && now - latch_ > max_hold) has_reply_ = false;
  Sample sample;
  compose(has_reply_ ? Quality::held : Quality::invalid, sample);
  return sample;
}

Sample PositionTracker::forget() noexcept {
  has_raw_ = false;
  raw_ = 0;
  has_reply_ = false;
  referenced_ = false;
  Sample sample;
  compose(Quality::invalid, sample);
  return sample;
}

bool PositionTracker::consistent(const Frame& earlier, const Frame& later, Time elapsed) const noexcept {
  const Profile& profile = profile_->profile();
  const unsigned bits = profile.single_turn_bits;
  std::int64_t moved = 0;
  if (profile.multi_turn_bits != 0) {
    const std::int64_t turns = Frame::sign_extend(later.abm() - earlier.abm(), profile.multi_turn_bits);
    moved = turns * (std::int64_t{1} << bits) + later.abs() - earlier.abs();
  } else {
    moved = Frame::sign_extend(later.abs() - earlier.abs(), bits);
  }
  return reachable(moved, elapsed);
}

}  // namespace tm485
