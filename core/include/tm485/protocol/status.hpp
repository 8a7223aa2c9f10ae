// SF and ALMC: the status and alarm bits of a reply, their names, and the policy that says what
// each of them means for this machine. Specification: section 3.
//
// A real encoder with no battery reports SF = 20 for ever, so "SF is not 0" is never a fault by
// itself: each bit is ignored, warned of, or a fault, as the policy says. No bit ever drops a
// position.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace tm485 {

/// The sixteen bits: SF is 0..7, ALMC is 8..15.
enum class StatusBit : std::uint8_t {
  sf_info_0 = 0,
  sf_info_1,
  sf_info_2,
  sf_info_3,
  single_turn_error,        ///< SF.4 (ea0)
  multi_turn_group,         ///< SF.5 (ea1): OR of the multi-turn, battery and over-heat bits of ALMC
  request_parity_error,     ///< SF.6 (ca0): the encoder saw a request with wrong parity
  request_delimiter_error,  ///< SF.7 (ca1): the encoder saw a request with a framing error
  over_speed,               ///< ALMC.0
  full_absolute_status,     ///< ALMC.1
  counting_error,           ///< ALMC.2
  counter_overflow,         ///< ALMC.3
  over_heat,                ///< ALMC.4
  multi_turn_error,         ///< ALMC.5
  battery_error,            ///< ALMC.6
  battery_alarm,            ///< ALMC.7
};

inline constexpr std::size_t kStatusBitCount = 16;

/// A set of status bits: SF in the low byte, ALMC in the high byte.
class StatusSet {
 public:
  constexpr StatusSet() noexcept = default;
  constexpr explicit StatusSet(std::uint16_t bits) noexcept : bits_(bits) {}
  constexpr StatusSet(std::uint8_t sf, std::uint8_t almc) noexcept
      : bits_(static_cast<std::uint16_t>(sf | static_cast<unsigned>(almc) << 8)) {}

  /// The set of one bit.
  [[nodiscard]] static constexpr StatusSet of(StatusBit bit) noexcept {
    return StatusSet(static_cast<std::uint16_t>(1U << static_cast<unsigned>(bit)));
  }

  [[nodiscard]] constexpr std::uint8_t sf() const noexcept { return static_cast<std::uint8_t>(bits_); }
  [[nodiscard]] constexpr std::uint8_t almc() const noexcept { return static_cast<std::uint8_t>(bits_ >> 8); }
  [[nodiscard]] constexpr std::uint16_t bits() const noexcept { return bits_; }
  [[nodiscard]] constexpr bool empty() const noexcept { return bits_ == 0; }
  /// What every known encoder of the family keeps to: SF.4 is ALMC.2, and SF.5 is one of ALMC.4 to ALMC.7. For the status of
  /// an ID3 reply; section 3 infers it, so nothing may depend on it for ever.
  [[nodiscard]] constexpr bool consistent() const noexcept {
    constexpr unsigned kSingleTurn = 1U << 4;
    constexpr unsigned kGroup = 1U << 5;
    const bool group = (bits_ & 0xF000U) != 0;
    return ((bits_ ^ (bits_ >> 6)) & kSingleTurn) == 0 && ((bits_ & kGroup) != 0) == group;
  }
  [[nodiscard]] constexpr bool has(StatusBit bit) const noexcept { return !(*this & of(bit)).empty(); }

  friend constexpr StatusSet operator|(StatusSet a, StatusSet b) noexcept {
    return StatusSet(static_cast<std::uint16_t>(a.bits_ | b.bits_));
  }
  friend constexpr StatusSet operator&(StatusSet a, StatusSet b) noexcept {
    return StatusSet(static_cast<std::uint16_t>(a.bits_ & b.bits_));
  }
  friend constexpr StatusSet operator~(StatusSet a) noexcept {
    return StatusSet(static_cast<std::uint16_t>(~a.bits_));
  }
  friend constexpr bool operator==(StatusSet, StatusSet) noexcept = default;

 private:
  std::uint16_t bits_ = 0;
};

/// What a person needs to know about a status bit. All texts are in static storage.
struct StatusInfo {
  StatusBit bit;
  std::string_view name;   ///< stable identifier, as printed in JSON
  std::string_view field;  ///< "SF.4", "ALMC.6"
  std::string_view cause;
  std::string_view remedy;
};

/// The table of all sixteen bits, in the order of StatusBit.
[[nodiscard]] const std::array<StatusInfo, kStatusBitCount>& status_table() noexcept;

/// The table entry of a bit. Any thread or interrupt; constant time.
[[nodiscard]] const StatusInfo& describe(StatusBit bit) noexcept;

/// What a status bit means for this machine.
enum class AlarmLevel : std::uint8_t {
  none,     ///< no bit set, or only ignored ones
  warning,  ///< shown, does not stop the axis
  fault,    ///< the drive should stop the axis
};

/// The policy: bits in neither set are ignored.
struct AlarmPolicy {
  StatusSet warn;
  StatusSet fault;

  /// The highest level among the bits that are set.
  [[nodiscard]] constexpr AlarmLevel level(StatusSet set) const noexcept {
    if (!(set & fault).empty()) return AlarmLevel::fault;
    return (set & warn).empty() ? AlarmLevel::none : AlarmLevel::warning;
  }
  /// The level of one bit.
  [[nodiscard]] constexpr AlarmLevel level(StatusBit bit) const noexcept { return level(StatusSet::of(bit)); }
};

namespace detail {
template <class... Bits>
[[nodiscard]] consteval StatusSet bits(Bits... bit) {
  return (StatusSet{} | ... | StatusSet::of(bit));
}
}  // namespace detail

/// What an encoder that calls these bits its own sets when its supply comes, and never later: T-format's full-absolute
/// status says that the shaft turned at that moment. Newly set, they are a restart.
inline constexpr StatusSet kSetAtPowerUp = StatusSet::of(StatusBit::full_absolute_status);

/// For an encoder with no battery: the multi-turn and battery group is its normal state, so it is ignored.
inline constexpr AlarmPolicy kAlarmsWithoutBattery{
    .warn = detail::bits(StatusBit::full_absolute_status, StatusBit::over_heat),
    .fault = detail::bits(StatusBit::single_turn_error, StatusBit::counting_error)};

/// For an encoder with a battery: a lost turn count is a fault, a weak battery and heat are warnings.
inline constexpr AlarmPolicy kAlarmsWithBattery{
    .warn = detail::bits(StatusBit::multi_turn_group, StatusBit::over_speed, StatusBit::full_absolute_status,
                         StatusBit::counter_overflow, StatusBit::over_heat, StatusBit::battery_alarm),
    .fault = detail::bits(StatusBit::single_turn_error, StatusBit::counting_error,
                          StatusBit::multi_turn_error, StatusBit::battery_error)};

}  // namespace tm485
