// Frames written by hand from the specification's section 2, with no help from the code under test.
#pragma once

#include <cstdint>
#include <initializer_list>
#include <random>
#include <vector>

namespace tm485::test {

using Bytes = std::vector<std::uint8_t>;
using Rng = std::mt19937_64;

/// The low `bits` of a fresh random number.
inline std::uint32_t random_bits(Rng& rng, unsigned bits) {
  return static_cast<std::uint32_t>(rng() & ((1ULL << bits) - 1));
}
inline std::uint8_t random_byte(Rng& rng) { return static_cast<std::uint8_t>(rng()); }
/// 0 .. n - 1.
inline std::size_t random_below(Rng& rng, std::size_t n) { return static_cast<std::size_t>(rng() % n); }

/// The nine IDs of section 2 with their CF, bytes out and bytes back, typed off the table.
struct Kind {
  unsigned id;
  std::uint8_t cf;
  std::size_t out;
  std::size_t back;
};
inline constexpr Kind kKinds[] = {{0, 0x02, 1, 6},  {1, 0x8A, 1, 6},  {2, 0x92, 1, 4},
                                  {3, 0x1A, 1, 11}, {6, 0x32, 4, 4},  {7, 0xBA, 1, 6},
                                  {8, 0xC2, 1, 6},  {12, 0x62, 1, 6}, {13, 0xEA, 3, 4}};

/// Appends the XOR of the bytes so far.
inline Bytes sealed(Bytes bytes) {
  std::uint8_t sum = 0;
  for (const std::uint8_t byte : bytes) sum ^= byte;
  bytes.push_back(sum);
  return bytes;
}

inline void put24(Bytes& bytes, std::uint32_t value) {
  for (int i = 0; i < 3; ++i) bytes.push_back(static_cast<std::uint8_t>(value >> (8 * i)));
}

/// CF SF ABS0 ABS1 ABS2 CRC (ID0, 7, 8, C), or with ABM the reply to ID1.
inline Bytes short_reply(std::uint8_t cf, std::uint32_t value, std::uint8_t sf = 0) {
  Bytes bytes{cf, sf};
  put24(bytes, value);
  return sealed(bytes);
}
inline Bytes id0_reply(std::uint32_t abs, std::uint8_t sf = 0) { return short_reply(0x02, abs, sf); }
inline Bytes id1_reply(std::uint32_t abm, std::uint8_t sf = 0) { return short_reply(0x8A, abm, sf); }
inline Bytes id2_reply(std::uint8_t enid, std::uint8_t sf = 0) { return sealed({0x92, sf, enid}); }
inline Bytes id3_reply(std::uint32_t abs, std::uint32_t abm, std::uint8_t enid = 0x11, std::uint8_t sf = 0,
                       std::uint8_t almc = 0) {
  Bytes bytes{0x1A, sf};
  put24(bytes, abs);
  bytes.push_back(enid);
  put24(bytes, abm);
  bytes.push_back(almc);
  return sealed(bytes);
}
inline Bytes eeprom_reply(std::uint8_t cf, std::uint8_t adf, std::uint8_t edf) {
  return sealed({cf, adf, edf});
}

/// A random reply of a kind that a 17-bit TM485 (ENID 11) may send; SF, ALMC and EEPROM bytes are free.
inline Bytes random_reply(Rng& rng, const Kind& kind, unsigned bits = 17, std::uint8_t enid = 0x11) {
  switch (kind.id) {
    case 1:
      return id1_reply(random_bits(rng, 16), random_byte(rng));
    case 2:
      return id2_reply(enid, random_byte(rng));
    case 3:
      return id3_reply(random_bits(rng, bits), random_bits(rng, 16), enid, random_byte(rng),
                       random_byte(rng));
    case 6:
    case 13:
      return eeprom_reply(kind.cf, random_byte(rng), random_byte(rng));
    default:
      return short_reply(kind.cf, random_bits(rng, bits), random_byte(rng));
  }
}

}  // namespace tm485::test
