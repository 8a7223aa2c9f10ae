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
      reversed_(axis.reversed) {
  const unsigned bits = profile.profile().single_turn_bits;
  const std::int64_t rpm = std::clamp<std::int32_t>(axis.max_speed_rpm, 1, 1'000'000);
  const bool counts_turns = profile.profile().multi_turn_bits != 0;
  offset_ = (std::int64_t{counts_turns ? axis.reference_turn.value_or(profile.profile().multi_turn_start) : 0}
             << bits) +
            std::clamp(axis.zero_offset, -kLargestOffset, kLargestOffset);  // made before start() refuses it
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
  gate_.forget();
  has_reply_ = false;
  referenced_ = false;
  Sample sample;
  compose(Quality::invalid, sample);
  return sample;
}

}  // namespace tm485
