// What the checks find and what they cannot, as counts that follow from the mathematics.
#include <gtest/gtest.h>

#include <algorithm>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/protocol/frame.hpp"

namespace tm485 {
namespace {

using test::Bytes;
using test::compiled;
using test::error_of;
using test::kKinds;

TEST(FrameFaults, EverySingleBitErrorOfEveryKindIsRefused) {
  test::Rng rng(20);
  const CompiledProfile profile = compiled("any");  // the least that is checked
  for (const auto& kind : kKinds) {
    const auto id = static_cast<DataId>(kind.id);
    for (int round = 0; round < 2'000; ++round) {
      Bytes bytes = test::random_reply(rng, kind);
      ASSERT_TRUE(Reply::parse(bytes, id, profile));
      for (std::size_t bit = 0; bit < bytes.size() * 8; ++bit) {
        bytes[bit / 8] ^= static_cast<std::uint8_t>(1 << (bit % 8));
        ASSERT_FALSE(Frame::parse(bytes, id)) << kind.id << " bit " << bit;
        ASSERT_FALSE(Frame::parse(bytes)) << kind.id << " bit " << bit;
        ASSERT_FALSE(Reply::parse(bytes, id, profile)) << kind.id << " bit " << bit;
        bytes[bit / 8] ^= static_cast<std::uint8_t>(1 << (bit % 8));
      }
    }
  }
}

TEST(FrameFaults, EveryWrongLengthIsRefused) {
  test::Rng rng(21);
  const CompiledProfile profile = compiled("any");
  for (const auto& kind : kKinds) {
    const auto id = static_cast<DataId>(kind.id);
    for (std::size_t length = 0; length <= 40; ++length) {
      if (length == kind.back) continue;
      for (int round = 0; round < 20; ++round) {
        Bytes bytes(length);
        for (auto& byte : bytes) byte = round == 0 ? 0 : test::random_byte(rng);
        if (length > 0) bytes[0] = kind.cf;
        if (length > 1) {  // the CRC holds, so only the length can tell
          bytes.pop_back();
          bytes = test::sealed(bytes);
        }
        ASSERT_EQ(error_of(Reply::parse(bytes, id, profile)), Errc::length_error) << kind.id << " " << length;
        ASSERT_EQ(error_of(Frame::parse(bytes, id)), Errc::length_error) << kind.id << " " << length;
        ASSERT_EQ(error_of(Frame::parse(bytes)), Errc::length_error) << kind.id << " " << length;
      }
    }
  }
}

// Of the public decoders measured, five accept every reply to another ID.
TEST(FrameFaults, AReplyToAnotherIdIsNeverTaken) {
  test::Rng rng(22);
  const CompiledProfile profile = compiled("any");
  std::size_t mismatches = 0;
  std::size_t accepted = 0;
  for (const auto& asked : kKinds) {
    for (const auto& got : kKinds) {
      if (asked.id == got.id || asked.back != got.back) continue;
      for (int round = 0; round < 100; ++round) {
        const auto reply = Reply::parse(test::random_reply(rng, got), static_cast<DataId>(asked.id), profile);
        accepted += reply ? 1U : 0U;
        mismatches += error_of(reply) == Errc::cf_mismatch ? 1U : 0U;
      }
    }
  }
  EXPECT_EQ(accepted, 0U);
  EXPECT_EQ(mismatches, (5U * 4 + 3 * 2) * 100);  // five kinds of six bytes, three of four
}

TEST(FrameFaults, EveryOtherCfWithARightCrcIsRefusedByName) {
  const CompiledProfile profile = compiled("tm485_17");
  std::size_t sync = 0, parity = 0, unknown = 0, mismatch = 0;
  for (unsigned cf = 0; cf < 256; ++cf) {
    if (cf == 0x1A) continue;
    Bytes bytes = test::id3_reply(0x12345, 3);
    bytes.pop_back();
    bytes[0] = static_cast<std::uint8_t>(cf);
    switch (error_of(Reply::parse(test::sealed(bytes), DataId::everything, profile))) {
      case Errc::cf_sync_error:
        ++sync;
        break;
      case Errc::cf_parity_error:
        ++parity;
        break;
      case Errc::unknown_id:
        ++unknown;
        break;
      case Errc::cf_mismatch:
        ++mismatch;
        break;
      default:
        ADD_FAILURE() << "CF " << cf;
    }
  }
  EXPECT_EQ(sync, 224U);   // 7 of 8 values of the sync bits
  EXPECT_EQ(parity, 16U);  // one of the two parities of each ID
  EXPECT_EQ(unknown, 7U);
  EXPECT_EQ(mismatch, 8U);
}

TEST(FrameFaults, AllZerosAndAllOnesAreNoFrames) {
  const CompiledProfile profile = compiled("any");
  for (const auto& kind : kKinds) {
    for (const std::size_t length : {4U, 6U, 11U}) {
      for (const int fill : {0x00, 0xFF}) {
        const Bytes bytes(length, static_cast<std::uint8_t>(fill));
        EXPECT_EQ(error_of(Frame::parse(bytes)), Errc::cf_sync_error);
        EXPECT_EQ(error_of(Reply::parse(bytes, static_cast<DataId>(kind.id), profile)),
                  length == kind.back ? Errc::cf_sync_error : Errc::length_error);
      }
    }
  }
}

// The own CF comes before the reply and the last byte is lost: CF CF SF ABS0 ABS1 ABS2. The XOR of the whole
// reply is 0, so the shifted one holds exactly if its lost byte, the CRC, equals the CF.
TEST(FrameFaults, EchoShiftedId0PassesTheCrcOnceIn256AndTheProfileOnceIn32768) {
  const CompiledProfile profile = compiled("tm485_17");
  std::size_t frames = 0;
  std::size_t replies = 0;
  for (std::uint32_t abs = 0; abs < 1U << 17; ++abs) {
    Bytes bytes = test::id0_reply(abs);
    bytes.insert(bytes.begin(), 0x02);
    bytes.pop_back();
    frames += Frame::parse(bytes, DataId::single_turn) ? 1U : 0U;
    replies += Reply::parse(bytes, DataId::single_turn, profile) ? 1U : 0U;
  }
  EXPECT_EQ(frames, 512U);  // ABS0 = ABS1 ^ ABS2: 256 values of ABS1 and 2 of ABS2
  EXPECT_EQ(replies, 4U);   // and ABS1, now in the place of ABS2, is 0 or 1
}

TEST(FrameFaults, EchoShiftedId3) {
  test::Rng rng(23);
  const CompiledProfile profile = compiled("tm485_17");
  std::size_t predicted = 0, frames = 0, replies = 0;
  for (int round = 0; round < 200'000; ++round) {
    Bytes bytes = test::id3_reply(test::random_bits(rng, 17), test::random_bits(rng, 16), 0x11,
                                  test::random_byte(rng), test::random_byte(rng));
    predicted += bytes.back() == 0x1A ? 1U : 0U;
    bytes.insert(bytes.begin(), 0x1A);
    bytes.pop_back();
    frames += Frame::parse(bytes, DataId::everything) ? 1U : 0U;
    replies += Reply::parse(bytes, DataId::everything, profile) ? 1U : 0U;
  }
  EXPECT_GT(predicted, 0U);
  EXPECT_EQ(frames, predicted);
  EXPECT_EQ(replies, 0U);  // ABS2 (0 or 1) stands where ENID 11 must be
}

// Two flips in one column keep the XOR. Only the CF echo and the profile's fixed bits can see them.
TEST(FrameFaults, TwoFlipsInOneColumnOfId3) {
  test::Rng rng(24);
  const CompiledProfile profile = compiled("tm485_17");
  for (int round = 0; round < 200; ++round) {
    const Bytes good = test::random_reply(rng, kKinds[3]);
    std::size_t pairs = 0, frames = 0, replies = 0;
    for (std::size_t first = 0; first < 11; ++first) {
      for (std::size_t second = first + 1; second < 11; ++second) {
        for (int column = 0; column < 8; ++column) {
          Bytes bytes = good;
          bytes[first] ^= static_cast<std::uint8_t>(1 << column);
          bytes[second] ^= static_cast<std::uint8_t>(1 << column);
          ++pairs;
          frames += Frame::parse(bytes, DataId::everything) ? 1U : 0U;
          replies += Reply::parse(bytes, DataId::everything, profile) ? 1U : 0U;
        }
      }
    }
    ASSERT_EQ(pairs, 440U);   // 55 pairs of bytes, 8 columns
    ASSERT_EQ(frames, 360U);  // 45 pairs without CF: CRC and CF echo cannot see them
    // Fixed by the profile: ABS2 and ABM2 bits 1..7, all of ENID. Free in column 0: 9 bytes, in each other: 7.
    ASSERT_EQ(replies, 36U + 7 * 21);
  }
}

// Swapped neighbours keep the XOR as well.
TEST(FrameFaults, SwappedNeighboursOfId3) {
  const CompiledProfile profile = compiled("tm485_17");
  const Bytes good = test::id3_reply(0x11234, 2, 0x11, 0x20, 0xC1);
  std::vector<std::size_t> frames, replies;
  for (std::size_t at = 0; at + 1 < good.size(); ++at) {
    Bytes bytes = good;
    std::swap(bytes[at], bytes[at + 1]);
    if (Frame::parse(bytes, DataId::everything)) frames.push_back(at);
    if (Reply::parse(bytes, DataId::everything, profile)) replies.push_back(at);
  }
  EXPECT_EQ(frames, (std::vector<std::size_t>{1, 2, 3, 4, 5, 6, 7, 8, 9}));  // all but CF with SF
  // Seen: ABS1 in ABS2 (out of range), ABS2 in ENID, ENID in ABM0, ALMC in ABM2. At 7 both bytes are 0.
  EXPECT_EQ(replies, (std::vector<std::size_t>{1, 2, 6, 7, 9}));
}

TEST(FrameFaults, InsertedZeroBytesAreALengthError) {
  const CompiledProfile profile = compiled("tm485_17");
  const Bytes good = test::id3_reply(0x11234, 2);
  for (std::size_t at = 0; at <= good.size(); ++at) {
    Bytes bytes = good;
    bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at), 0x00);
    EXPECT_EQ(error_of(Reply::parse(bytes, DataId::everything, profile)), Errc::length_error);
  }
}

}  // namespace
}  // namespace tm485
