#include "tm485/protocol/status.hpp"

namespace tm485 {
namespace {

using enum StatusBit;

constexpr std::array<StatusInfo, kStatusBitCount> kStatus{{
    {sf_info_0, "sf_bit0", "SF.0", "reserved by the document",
     "none known: note it and tell the encoder's maker"},
    {sf_info_1, "sf_bit1", "SF.1", "reserved by the document",
     "none known: note it and tell the encoder's maker"},
    {sf_info_2, "sf_bit2", "SF.2", "reserved by the document",
     "none known: note it and tell the encoder's maker"},
    {sf_info_3, "sf_bit3", "SF.3", "reserved by the document",
     "none known: note it and tell the encoder's maker"},
    {single_turn_error, "single_turn_error", "SF.4", "the encoder chip works abnormally",
     "reset errors; if it comes back, replace the encoder"},
    {multi_turn_group, "multi_turn_or_battery", "SF.5",
     "a multi-turn, battery or over-heat bit of ALMC is set; normal with no battery",
     "see the ALMC bits; with no battery use a profile without battery"},
    {request_parity_error, "request_parity_error", "SF.6", "the encoder received a request with wrong parity",
     "look for noise on the host's transmission"},
    {request_delimiter_error, "request_delimiter_error", "SF.7",
     "the encoder received a request with a framing error", "check the bit rate and the host's driver"},
    {over_speed, "over_speed", "ALMC.0",
     "the shaft turned faster than the turn counter follows while powered off",
     "reset errors and multi-turn, then reference the axis"},
    {full_absolute_status, "full_absolute_status", "ALMC.1",
     "powered on while the shaft was turning: resolution is not full yet",
     "let the shaft stand still for a moment"},
    {counting_error, "counting_error", "ALMC.2", "single-turn position deviated: encoder chip or disc",
     "reset errors; if it comes back, replace the encoder"},
    {counter_overflow, "counter_overflow", "ALMC.3", "the multi-turn counter ran over",
     "reset errors and multi-turn, then reference the axis"},
    {over_heat, "over_heat", "ALMC.4", "the encoder is too hot", "let the motor cool, check its load"},
    {multi_turn_error, "multi_turn_error", "ALMC.5", "a bit jumped in the multi-turn signal",
     "reset errors and multi-turn, then reference the axis"},
    {battery_error, "battery_error", "ALMC.6", "the battery is empty or absent: turns were lost",
     "replace the battery, reset errors and multi-turn, reference the axis"},
    {battery_alarm, "battery_alarm", "ALMC.7", "the battery is low",
     "replace the battery while the encoder is powered"},
}};

consteval bool ordered() {
  for (std::size_t i = 0; i < kStatusBitCount; ++i)
    if (static_cast<std::size_t>(kStatus[i].bit) != i) return false;
  return true;
}
static_assert(ordered(), "describe() indexes the table by the bit");

// Two public masters mask the low nibble of SF and can never see an error: the error bits are 4 and 5.
static_assert(StatusSet::of(single_turn_error).sf() == 0x10 && StatusSet::of(multi_turn_group).sf() == 0x20);
static_assert(StatusSet::of(counting_error).almc() == 0x04 && StatusSet::of(battery_alarm).almc() == 0x80);

}  // namespace

const std::array<StatusInfo, kStatusBitCount>& status_table() noexcept { return kStatus; }

const StatusInfo& describe(StatusBit bit) noexcept {
  return kStatus[static_cast<std::size_t>(bit) % kStatusBitCount];
}

}  // namespace tm485
