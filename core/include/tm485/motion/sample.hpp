// Sample: one position of the shaft, with everything needed to judge it.
//
// Only PositionTracker makes samples, and only from a Reply; there is no other way to a fresh one.
// Specification: sections 3 and 4.
#pragma once

#include <cstdint>
#include <string_view>
#include <type_traits>

#include "tm485/protocol/control_field.hpp"
#include "tm485/protocol/status.hpp"
#include "tm485/time.hpp"

namespace tm485 {

enum class Quality : std::uint8_t {
  invalid,       ///< nothing known, or held for too long
  held,          ///< the last good sample; this cycle brought none
  extrapolated,  ///< computed for a later instant than its latch time
  fresh,         ///< from this cycle's reply
};

/// "invalid", "held", "extrapolated", "fresh".
[[nodiscard]] std::string_view name(Quality quality) noexcept;

/// At most 64 bytes and trivially copyable, so that it crosses threads in one piece.
/// All accessors: any thread or interrupt, constant time.
class Sample {
 public:
  /// No sample yet: invalid.
  constexpr Sample() noexcept = default;

  [[nodiscard]] constexpr Quality quality() const noexcept { return quality_; }
  /// False until the axis is homed, or the encoder keeps its turns over a power-off and says they are good.
  [[nodiscard]] constexpr bool referenced() const noexcept { return referenced_; }
  /// True if `position` and `single_turn` mean anything: ID0 and ID3 have them, ID1 and ID2 do not.
  [[nodiscard]] constexpr bool has_position() const noexcept { return has_position_; }
  /// Motor counts by AxisConfig: direction, zero offset and reference turn applied.
  [[nodiscard]] constexpr std::int64_t position() const noexcept { return position_; }
  /// ABS as sent: 0 .. 2^single_turn_bits - 1.
  [[nodiscard]] constexpr std::uint32_t single_turn() const noexcept { return single_turn_; }
  /// The encoder's turn count, signed, as of the last reply that had one.
  [[nodiscard]] constexpr std::int32_t turns() const noexcept { return turns_; }
  /// 2^32 is one electrical turn; pole pairs, direction and offset by AxisConfig.
  [[nodiscard]] constexpr std::uint32_t electrical_angle() const noexcept { return electrical_angle_; }
  /// When the encoder latched this position: end of the request's last stop bit + latch_offset.
  [[nodiscard]] constexpr Time latch_time() const noexcept { return latch_time_; }
  /// ± of the latch time.
  [[nodiscard]] constexpr Time latch_uncertainty() const noexcept { return Time(latch_uncertainty_ns_); }
  /// By how much `position` can be wrong, in counts: this is where the shaft was at `latch_time`, give or take so much, even
  /// if wrong bits have passed every check, in this reply and in each of the two before; behind an outage in one of those that
  /// ended it (docs/adr/0013). With right bits it is right to a count and what the shaft turns in
  /// `latch_uncertainty`.
  [[nodiscard]] constexpr std::uint32_t half_width() const noexcept { return half_width_; }
  /// Counts the times that the shaft was found where it cannot have come to (a slipped coupling, a zero reset, a restart that
  /// nobody saw); wraps. A new number: this position has nothing to do with the one before.
  [[nodiscard]] constexpr std::uint32_t discontinuities() const noexcept { return discontinuities_; }
  /// Age of the data at `now`.
  [[nodiscard]] constexpr Time age(Time now) const noexcept { return now - latch_time_; }
  /// Counts samples, fresh, held or invalid; wraps.
  [[nodiscard]] constexpr std::uint32_t sequence() const noexcept { return sequence_; }
  /// SF and ALMC; ALMC as of the last reply that had one. `alarm` judges only what this reply had.
  [[nodiscard]] constexpr StatusSet status() const noexcept { return status_; }
  /// What `status` means by the profile's alarm policy.
  [[nodiscard]] constexpr AlarmLevel alarm() const noexcept { return alarm_; }
  /// ENID as of the last reply that had one.
  [[nodiscard]] constexpr std::uint8_t enid() const noexcept { return enid_; }
  /// The ID of the reply that it came from.
  [[nodiscard]] constexpr DataId id() const noexcept { return id_; }
  /// An EEPROM write is about to have the line to itself, or has it: no fresh sample comes for so long after it began.
  /// 0: none. Stated by the last sample before it begins, at the latest (BusConfig::eeprom_may_hold); at most 4.2 s.
  [[nodiscard]] constexpr Time announced_hold() const noexcept { return Time(announced_hold_ns_); }

 private:
  friend class PositionTracker;

  std::int64_t position_ = 0;
  Time latch_time_{0};
  std::uint32_t sequence_ = 0;
  std::uint32_t single_turn_ = 0;
  std::int32_t turns_ = 0;
  std::uint32_t electrical_angle_ = 0;
  std::uint32_t latch_uncertainty_ns_ = 0;
  StatusSet status_;
  std::uint8_t enid_ = 0;
  DataId id_ = DataId::everything;
  Quality quality_ = Quality::invalid;
  AlarmLevel alarm_ = AlarmLevel::none;
  bool referenced_ = false;
  bool has_position_ = false;
  std::uint32_t announced_hold_ns_ = 0;
  std::uint32_t half_width_ = 0;
  std::uint32_t discontinuities_ = 0;
};

// No padding: every byte of a sample has a value.
static_assert(sizeof(Sample) <= 64 && std::has_unique_object_representations_v<Sample>);

}  // namespace tm485
