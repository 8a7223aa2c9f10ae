// CF: every byte value against a reference that reads it bit by bit.
#include "tm485/protocol/control_field.hpp"

#include <gtest/gtest.h>

#include <set>

#include "support/bit_serial.hpp"
#include "support/frames.hpp"
#include "support/print.hpp"

namespace tm485 {
namespace {

using test::kKinds;

TEST(ControlField, EveryByteIsClassifiedAsTheBitsSay) {
  std::size_t good = 0;
  for (unsigned value = 0; value < 256; ++value) {
    const auto cf = static_cast<std::uint8_t>(value);
    const auto expected = test::classify_cf(cf);
    const auto id = parse_control_field(cf);
    ASSERT_EQ(name(test::error_of(id)), expected.error) << "CF " << value;
    if (!id) continue;
    ++good;
    EXPECT_EQ(number(*id), expected.id) << "CF " << value;
    EXPECT_EQ(control_field(*id), cf);
  }
  EXPECT_EQ(good, 9U);
}

TEST(ControlField, TheNineOfTheTable) {
  ASSERT_EQ(std::size(kKinds), kDataIdCount);
  for (std::size_t i = 0; i < kDataIdCount; ++i) {
    EXPECT_EQ(number(kDataIds[i]), kKinds[i].id);
    EXPECT_EQ(control_field(kDataIds[i]), kKinds[i].cf) << "ID " << kKinds[i].id;
  }
}

TEST(ControlField, TheSevenUndefinedIdsAreUnknown) {
  for (const int cf : {0xA2, 0x2A, 0x4A, 0x52, 0xDA, 0xF2, 0x7A})
    EXPECT_EQ(test::error_of(parse_control_field(static_cast<std::uint8_t>(cf))), Errc::unknown_id) << cf;
}

TEST(ControlField, IsDataIdAgreesForEveryNumber) {
  const std::set<unsigned> defined{0, 1, 2, 3, 6, 7, 8, 12, 13};
  for (unsigned id = 0; id < 64; ++id) EXPECT_EQ(is_data_id(id), defined.contains(id)) << id;
}

TEST(ControlField, AnySingleBitErrorIsSeen) {
  for (const auto& kind : kKinds)
    for (int bit = 0; bit < 8; ++bit)
      EXPECT_FALSE(parse_control_field(static_cast<std::uint8_t>(kind.cf ^ (1 << bit))))
          << kind.id << " bit " << bit;
}

// Both ways at compile time.
static_assert(control_field(DataId::single_turn) == 0x02 && control_field(DataId::multi_turn) == 0x8A &&
              control_field(DataId::encoder_id) == 0x92 && control_field(DataId::everything) == 0x1A &&
              control_field(DataId::eeprom_write) == 0x32 && control_field(DataId::reset_errors) == 0xBA &&
              control_field(DataId::reset_single_turn) == 0xC2 &&
              control_field(DataId::reset_multi_turn) == 0x62 && control_field(DataId::eeprom_read) == 0xEA);
static_assert(parse_control_field(0x1A) == DataId::everything);
static_assert(parse_control_field(0x82).error() == Errc::cf_parity_error);
static_assert(parse_control_field(0x03).error() == Errc::cf_sync_error);
static_assert(parse_control_field(0xA2).error() == Errc::unknown_id);

}  // namespace
}  // namespace tm485
