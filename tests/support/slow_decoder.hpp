// A slow decoder written from the specification only. It shares no code and no table with the core: a reply is
// described by one letter a byte, and everything is read byte by byte.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "support/bit_serial.hpp"

namespace tm485::test {

/// What a profile fixes, as the specification says it.
struct SlowProfile {
  std::string_view name;
  unsigned abs_bits;
  bool abm_high_bits_zero;  ///< ABM bits 17..23 are 0; bit 16 is not judged
  int enid_count;           ///< 0: any
  std::uint8_t enids[2];
};
inline constexpr SlowProfile kSlowProfiles[] = {
    {"tm485_17", 17, true, 1, {0x11}},
    {"tm485_17_battery", 17, true, 1, {0x11}},
    {"tm485_17_st", 17, false, 1, {0x00}},
    {"tm485_23", 23, true, 1, {0x17}},
    {"tm485_23_battery", 23, true, 1, {0x17}},
    {"tformat_17", 17, true, 2, {0x11, 0x17}},
    {"tformat_17_battery", 17, true, 2, {0x11, 0x17}},
    {"tformat_23", 23, true, 1, {0x17}},
    {"tformat_23_battery", 23, true, 1, {0x17}},
    {"any", 24, false, 0, {}},
};

struct SlowReply {
  std::string_view error;  ///< "ok" or the name of the error
  unsigned id = 0;
  std::uint32_t sf = 0, abs = 0, enid = 0, abm = 0, almc = 0, adf = 0, edf = 0;
};

/// One letter a byte: C CF, s SF, a ABS, e ENID, m ABM, l ALMC, d ADF, D EDF, X CRC. Empty: no such ID.
inline std::string_view shape_of(unsigned id) {
  if (id == 0 || id == 7 || id == 8 || id == 12) return "CsaaaX";
  if (id == 1) return "CsmmmX";
  if (id == 2) return "CseX";
  if (id == 3) return "CsaaaemmmlX";
  if (id == 6 || id == 13) return "CdDX";
  return {};
}

inline SlowReply slow_parse(std::span<const std::uint8_t> bytes, unsigned asked, const SlowProfile& profile) {
  const std::string_view shape = shape_of(asked);
  if (bytes.size() != shape.size()) return {"length_error"};
  const CfVerdict cf = classify_cf(bytes[0]);
  if (cf.error != "ok") return {cf.error};
  if (cf.id != asked) return {"cf_mismatch"};
  for (int column = 0; column < 8; ++column) {  // X^8 + 1: every bit column has even parity
    int ones = 0;
    for (const std::uint8_t byte : bytes) ones += (byte >> column) & 1;
    if (ones % 2 != 0) return {"crc_error"};
  }
  SlowReply reply{"ok", asked};
  std::uint32_t abs_weight = 1;
  std::uint32_t abm_weight = 1;
  bool has_enid = false;
  for (std::size_t i = 0; i < shape.size(); ++i) {
    const std::uint32_t value = bytes[i];
    switch (shape[i]) {
      case 's':
        reply.sf = value;
        break;
      case 'e':
        reply.enid = value;
        has_enid = true;
        break;
      case 'l':
        reply.almc = value;
        break;
      case 'd':
        reply.adf = value;
        break;
      case 'D':
        reply.edf = value;
        break;
      case 'a':
        reply.abs += value * abs_weight;
        abs_weight *= 256;
        break;
      case 'm':
        reply.abm += value * abm_weight;
        abm_weight *= 256;
        break;
      default:
        break;
    }
  }
  std::uint32_t range = 1;
  for (unsigned i = 0; i < profile.abs_bits; ++i) range *= 2;
  if (reply.abs >= range)
    reply.error = "abs_out_of_range";
  else if (profile.abm_high_bits_zero && reply.abm / 131072 != 0)
    reply.error = "abm_reserved_bits";
  else if (has_enid && profile.enid_count > 0) {
    bool known = false;
    for (int i = 0; i < profile.enid_count; ++i) known = known || profile.enids[i] == reply.enid;
    if (!known) reply.error = "enid_unexpected";
  }
  return reply;
}

}  // namespace tm485::test
