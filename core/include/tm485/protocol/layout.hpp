// Where the fields of each exchange are: lengths of request and reply, offsets within the reply.
// One table for code, tools and documentation. Specification: section 2.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "tm485/protocol/control_field.hpp"

namespace tm485 {

/// Longest request and reply of the family, in bytes.
inline constexpr std::size_t kMaxRequest = 4;
inline constexpr std::size_t kMaxReply = 11;

/// One exchange. Offsets are byte indices into the reply; 0 means that the reply has no such field
/// (index 0 is always CF). ABS and ABM are three bytes, little endian.
struct Layout {
  DataId id;
  std::uint8_t request_length;  ///< CF included
  std::uint8_t reply_length;    ///< CF and CRC included
  std::uint8_t sf_at, abs_at, enid_at, abm_at, almc_at, adf_at, edf_at;
};

// clang-format off
inline constexpr std::array<Layout, kDataIdCount> kLayouts{{
    //                          out back  SF ABS ENID ABM ALMC ADF EDF
    {DataId::single_turn,        1,  6,   1,  2,  0,   0,  0,   0,  0},
    {DataId::multi_turn,         1,  6,   1,  0,  0,   2,  0,   0,  0},
    {DataId::encoder_id,         1,  4,   1,  0,  2,   0,  0,   0,  0},
    {DataId::everything,         1, 11,   1,  2,  5,   6,  9,   0,  0},
    {DataId::eeprom_write,       4,  4,   0,  0,  0,   0,  0,   1,  2},
    {DataId::reset_errors,       1,  6,   1,  2,  0,   0,  0,   0,  0},
    {DataId::reset_single_turn,  1,  6,   1,  2,  0,   0,  0,   0,  0},
    {DataId::reset_multi_turn,   1,  6,   1,  2,  0,   0,  0,   0,  0},
    {DataId::eeprom_read,        3,  4,   0,  0,  0,   0,  0,   1,  2},
}};
// clang-format on

namespace detail {
consteval std::array<std::uint8_t, 16> dense_indices() {
  std::array<std::uint8_t, 16> table{};
  for (std::size_t i = 0; i < kDataIdCount; ++i) table[number(kDataIds[i])] = static_cast<std::uint8_t>(i);
  return table;
}
inline constexpr std::array<std::uint8_t, 16> kDenseIndex = dense_indices();
}  // namespace detail

/// 0..8: the row of an ID in tables that have one row for each of the nine IDs.
[[nodiscard]] constexpr std::size_t index_of(DataId id) noexcept {
  return detail::kDenseIndex[number(id) & 0xFU];
}

/// The layout of an ID.
[[nodiscard]] constexpr const Layout& layout(DataId id) noexcept { return kLayouts[index_of(id)]; }

static_assert([] {
  for (std::size_t i = 0; i < kDataIdCount; ++i)
    if (kLayouts[i].id != kDataIds[i]) return false;
  return true;
}());

}  // namespace tm485
