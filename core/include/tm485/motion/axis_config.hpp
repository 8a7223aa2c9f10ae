// AxisConfig: how encoder counts become the position of this axis. Specification: sections 1, 3, 7.
#pragma once

#include <cstdint>
#include <optional>

#include "tm485/protocol/profile.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// Units for people; the loop itself works in counts.
enum class Units : std::uint8_t { counts, rev, deg, rad };

/// What becomes of an axis whose encoder was lost or restarted. In each case the position is invalid until start-up is
/// through, and the drive is told to let go.
enum class Continuity : std::uint8_t {
  /// A fault: an Axis stays invalid until somebody resumes. The turns are those that the encoder counts now; the axis is
  /// referenced only if a battery has kept them.
  until_resumed,
  /// Likewise, and nobody can resume before the axis was referenced (homed) again.
  until_homed,
  /// The turns are carried on: the position is the one nearest to the last, the axis as referenced as before, and an Axis
  /// goes on by itself. Only for a shaft that cannot turn by half a turn meanwhile: a brake, a screw.
  re_reference,
};

/// What is known about the axis. All integers, so that nothing is lost over 64 bits.
struct AxisConfig {
  static constexpr std::int32_t kFastest = 1'000'000;     ///< rpm
  static constexpr std::int32_t kSteepest = 100'000'000;  ///< rpm/s

  bool reversed = false;         ///< false: counter-clockwise seen from the output shaft is positive
  std::int64_t zero_offset = 0;  ///< encoder counts that become position 0, before direction
  std::optional<std::int32_t>
      reference_turn;               ///< turn count that becomes turn 0; none: the profile's multi_turn_start
  std::int32_t gear_numerator = 1;  ///< load revolutions = motor revolutions * numerator / denominator
  std::int32_t gear_denominator = 1;    ///< not 0
  std::uint16_t pole_pairs = 1;         ///< electrical turns per mechanical turn
  std::uint32_t electrical_offset = 0;  ///< added to the electrical angle; 2^32 is one electrical turn
  std::int32_t max_speed_rpm =
      6000;  ///< faster than the shaft can turn; bounds what single-turn data can tell
  /// The shaft is never accelerated more; together with the speed it says where the shaft can be (PlausibilityGate). The
  /// default is that of a small servo motor without a load, 105 000 rad/s^2.
  std::int32_t max_acceleration_rpm_s = 1'000'000;
  Continuity after_restart = Continuity::until_resumed;
  Units units = Units::counts;  ///< of `to_units`

  /// False if no position can be computed from it: an offset of 2^60 counts or more, a gear ratio over or under
  /// zero, no pole pairs, no speed, no acceleration. A bus refuses to start with it.
  [[nodiscard]] constexpr bool valid() const noexcept {
    constexpr std::int64_t kLargest = std::int64_t{1} << 60;
    return zero_offset > -kLargest && zero_offset < kLargest && gear_numerator != 0 &&
           gear_denominator != 0 && pole_pairs != 0 && max_speed_rpm > 0 && max_speed_rpm <= kFastest &&
           max_acceleration_rpm_s > 0 && max_acceleration_rpm_s <= kSteepest;
  }
};

/// A position in motor counts as load-side `axis.units` (counts are motor counts, without gear).
/// Any thread; floating point.
[[nodiscard]] constexpr double to_units(std::int64_t position, const AxisConfig& axis,
                                        unsigned single_turn_bits) noexcept {
  const auto counts = static_cast<double>(position);
  if (axis.units == Units::counts) return counts;
  const double motor_turns = counts / static_cast<double>(std::int64_t{1} << single_turn_bits);
  const double turns = motor_turns * axis.gear_numerator / axis.gear_denominator;
  switch (axis.units) {
    case Units::deg:
      return turns * 360.0;
    case Units::rad:
      return turns * 6.283185307179586;
    case Units::rev:
    case Units::counts:
      break;
  }
  return turns;
}

}  // namespace tm485
