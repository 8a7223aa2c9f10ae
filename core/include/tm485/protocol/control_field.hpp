// CF, the control field: sync code 010, a 4-bit data ID (LSB first) and its even parity.
// Specification: section 2.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>

#include "tm485/errc.hpp"

namespace tm485 {

/// The nine data IDs. The value is the ID itself, as in CF bits 3..6.
enum class DataId : std::uint8_t {
  single_turn = 0x0,        ///< ID0: ABS
  multi_turn = 0x1,         ///< ID1: ABM
  encoder_id = 0x2,         ///< ID2: ENID
  everything = 0x3,         ///< ID3: ABS, ENID, ABM, ALMC
  eeprom_write = 0x6,       ///< ID6
  reset_errors = 0x7,       ///< ID7, ten in a row
  reset_single_turn = 0x8,  ///< ID8, ten in a row: the present position becomes zero
  reset_multi_turn = 0xC,   ///< IDC, ten in a row: errors and the turn count
  eeprom_read = 0xD,        ///< IDD
};

inline constexpr std::array kDataIds{
    DataId::single_turn,       DataId::multi_turn,       DataId::encoder_id,
    DataId::everything,        DataId::eeprom_write,     DataId::reset_errors,
    DataId::reset_single_turn, DataId::reset_multi_turn, DataId::eeprom_read};
inline constexpr std::size_t kDataIdCount = kDataIds.size();

/// The ID as a number, 0..13.
[[nodiscard]] constexpr unsigned number(DataId id) noexcept { return static_cast<unsigned>(id); }

/// True if the 4-bit number names one of the nine IDs.
[[nodiscard]] constexpr bool is_data_id(unsigned id) noexcept {
  constexpr unsigned kDefined =
      1U << 0 | 1U << 1 | 1U << 2 | 1U << 3 | 1U << 6 | 1U << 7 | 1U << 8 | 1U << 12 | 1U << 13;
  return id < 16 && ((kDefined >> id) & 1U) != 0;
}

/// The CF byte of a 4-bit ID number, defined or not.
[[nodiscard]] constexpr std::uint8_t make_cf(unsigned id) noexcept {
  constexpr unsigned kSync = 0b010;
  constexpr unsigned kOddParity = 0b0110'1001'1001'0110;  // bit n: n has an odd number of ones
  const unsigned parity = (kOddParity >> (id & 0xFU)) & 1U;
  return static_cast<std::uint8_t>(kSync | (id & 0xFU) << 3 | parity << 7);
}

/// The CF byte of a data ID: 02 8A 92 1A 32 BA C2 62 EA.
[[nodiscard]] constexpr std::uint8_t control_field(DataId id) noexcept { return make_cf(number(id)); }

/// Classifies a received CF: the ID, or cf_sync_error, cf_parity_error, unknown_id (in this order).
[[nodiscard]] constexpr std::expected<DataId, Errc> parse_control_field(std::uint8_t cf) noexcept {
  if ((cf & 0b111U) != 0b010U) return std::unexpected(Errc::cf_sync_error);
  const unsigned id = (cf >> 3) & 0xFU;
  if (make_cf(id) != cf) return std::unexpected(Errc::cf_parity_error);
  if (!is_data_id(id)) return std::unexpected(Errc::unknown_id);
  return static_cast<DataId>(id);
}

}  // namespace tm485
