// CRC X^8 + 1 against long division of polynomials.
#include "tm485/protocol/crc.hpp"

#include <gtest/gtest.h>

#include "support/bit_serial.hpp"
#include "support/frames.hpp"

namespace tm485 {
namespace {

using test::Bytes;
using test::Rng;

TEST(Crc, EqualsTheBitSerialDivisionInBothBitOrders) {
  Rng rng(1);
  for (int round = 0; round < 20'000; ++round) {
    Bytes message(1 + test::random_below(rng, 20));
    for (auto& byte : message) byte = test::random_byte(rng);
    ASSERT_EQ(crc(message), test::divide_by_x8_plus_1(message, true));
    ASSERT_EQ(crc(message), test::divide_by_x8_plus_1(message, false));
  }
}

TEST(Crc, OfAWordIsThatOfItsEightBytes) {
  Rng rng(2);
  for (int round = 0; round < 20'000; ++round) {
    const std::uint64_t word = round < 64 ? std::uint64_t{1} << round : rng();
    Bytes bytes;
    for (int i = 0; i < 8; ++i) bytes.push_back(static_cast<std::uint8_t>(word >> (8 * i)));
    ASSERT_EQ(crc(word), test::divide_by_x8_plus_1(bytes, true)) << word;
  }
}

TEST(Crc, OfNothingIsTheInitialValue) { EXPECT_EQ(crc(Bytes{}), 0); }

TEST(Crc, AWholeFrameGivesZero) {
  Rng rng(3);
  for (int round = 0; round < 1'000; ++round) {
    Bytes message(1 + test::random_below(rng, 20));
    for (auto& byte : message) byte = test::random_byte(rng);
    message.push_back(test::divide_by_x8_plus_1(message, true));
    ASSERT_EQ(crc(message), 0);
  }
}

// Every burst of at most eight bits is found, wherever it begins.
TEST(Crc, FindsEveryBurstOfUpToEightBits) {
  const Bytes frame = test::id3_reply(0x1ABCD, 0x1234);
  for (std::size_t start = 0; start < frame.size() * 8; ++start) {
    for (unsigned pattern = 1; pattern < 256; ++pattern) {
      Bytes hit = frame;
      for (std::size_t i = 0; i < 8 && start + i < hit.size() * 8; ++i)
        if (((pattern >> i) & 1) != 0)
          hit[(start + i) / 8] ^= static_cast<std::uint8_t>(1 << ((start + i) % 8));
      if (hit != frame) {
        ASSERT_NE(crc(hit), 0) << start << " " << pattern;
      }
    }
  }
}

constexpr std::uint8_t kPrinted[] = {0x02, 0x00, 0xCD, 0xAB, 0x01};
static_assert(crc(kPrinted) == 0x65);
static_assert(crc(std::uint64_t{0x01ABCD0002}) == 0x65);

}  // namespace
}  // namespace tm485
