// Oracles that work bit by bit, as the specification words it: CF classification and polynomial division.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

namespace tm485::test {

/// The remainder of the message, followed by eight zero bits, divided by X^8 + 1 over GF(2): schoolbook long
/// division on a list of coefficients, highest first. `lsb_first`: the order of the bits within a byte as the
/// line carries them; the remainder is then read in the same order.
inline std::uint8_t divide_by_x8_plus_1(std::span<const std::uint8_t> message, bool lsb_first) {
  std::vector<bool> terms;
  for (const std::uint8_t byte : message)
    for (int i = 0; i < 8; ++i) terms.push_back(((byte >> (lsb_first ? i : 7 - i)) & 1) != 0);
  terms.resize(terms.size() + 8, false);
  for (std::size_t i = 0; i + 8 < terms.size(); ++i) {
    if (!terms[i]) continue;
    terms[i] = false;
    terms[i + 8] = !terms[i + 8];
  }
  unsigned remainder = 0;
  for (int i = 0; i < 8; ++i) {
    const unsigned bit = terms[terms.size() - 8 + static_cast<std::size_t>(i)] ? 1U : 0U;
    remainder |= bit << (lsb_first ? i : 7 - i);
  }
  return static_cast<std::uint8_t>(remainder);
}

/// What a CF byte is, read bit by bit in the order of the line.
struct CfVerdict {
  std::string_view error;  ///< "ok" or the name of the error
  unsigned id = 0;
};
inline CfVerdict classify_cf(std::uint8_t cf) {
  bool bit[8];
  for (int i = 0; i < 8; ++i) bit[i] = ((cf >> i) & 1) != 0;
  if (bit[0] || !bit[1] || bit[2]) return {"cf_sync_error"};
  unsigned id = 0;
  bool parity = false;
  for (int i = 0; i < 4; ++i) {
    if (!bit[3 + i]) continue;
    id += 1U << i;
    parity = !parity;
  }
  if (bit[7] != parity) return {"cf_parity_error"};
  switch (id) {
    case 0:
    case 1:
    case 2:
    case 3:
    case 6:
    case 7:
    case 8:
    case 12:
    case 13:
      return {"ok", id};
    default:
      return {"unknown_id"};
  }
}

}  // namespace tm485::test
