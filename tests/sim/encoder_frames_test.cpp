// The model's replies against frames computed by hand (the names in the comments are those of the golden
// vectors).
#include <gtest/gtest.h>

#include "ask.hpp"

namespace tm485::sim {
namespace {

constexpr std::int64_t kAbs1ABCD = 0x1ABCD;

TEST(EncoderFrames, SingleTurnPosition) {
  EncoderModel encoder{{}, at_rest(kAbs1ABCD)};
  EXPECT_EQ(ask(encoder, Time{0}, {0x02}), (Bytes{0x02, 0x00, 0xCD, 0xAB, 0x01, 0x65}));  // tm485-id0-reply
}

TEST(EncoderFrames, SingleTurnPositionWithSingleTurnError) {
  EncoderModel encoder{{.sf = 0x10}};
  EXPECT_EQ(ask(encoder, Time{0}, {0x02}), (Bytes{0x02, 0x10, 0, 0, 0, 0x12}));  // tm485-id0-reply-err
}

TEST(EncoderFrames, MultiTurnPositionAtPowerUp) {
  EncoderModel encoder;
  EXPECT_EQ(ask(encoder, Time{0}, {0x8A}), (Bytes{0x8A, 0, 0x01, 0, 0, 0x8B}));  // tm485-id1-reply-1
}

TEST(EncoderFrames, MultiTurnPositionOneTurnBelowZero) {
  EncoderModel encoder{{.battery = true, .start_turn = 0}, at_rest(-1)};
  EXPECT_EQ(ask(encoder, Time{0}, {0x8A}), (Bytes{0x8A, 0, 0xFF, 0xFF, 0, 0x8A}));  // tm485-id1-reply-ffff
}

TEST(EncoderFrames, EncoderIdOfSeventeenBitsMultiTurn) {
  EncoderModel encoder;
  EXPECT_EQ(ask(encoder, Time{0}, {0x92}), (Bytes{0x92, 0x00, 0x11, 0x83}));  // tm485-id2-reply-17mt
}

TEST(EncoderFrames, EncoderIdOfSeventeenBitsSingleTurn) {
  EncoderModel encoder{{.enid = 0x00, .multi_turn = false}};
  EXPECT_EQ(ask(encoder, Time{0}, {0x92}), (Bytes{0x92, 0x00, 0x00, 0x92}));  // tm485-id2-reply-17st
}

TEST(EncoderFrames, EncoderIdOfTwentyThreeBits) {
  EncoderModel encoder{{.single_turn_bits = 23, .enid = 0x17}};
  EXPECT_EQ(ask(encoder, Time{0}, {0x92}), (Bytes{0x92, 0x00, 0x17, 0x85}));  // tm485-id2-reply-23mt
}

TEST(EncoderFrames, Everything) {
  EncoderModel encoder{{}, at_rest(0x1FFFF)};
  EXPECT_EQ(ask(encoder, Time{0}, {0x1A}),  // tm485-id3-reply
            (Bytes{0x1A, 0x00, 0xFF, 0xFF, 0x01, 0x11, 0x01, 0x00, 0x00, 0x00, 0x0B}));
}

TEST(EncoderFrames, EverythingWithAllAlarms) {
  EncoderModel encoder{{.start_turn = 2, .sf = 0x30, .almc = 0xC4}, at_rest(0x1234)};
  EXPECT_EQ(ask(encoder, Time{0}, {0x1A}),  // tm485-id3-reply-alarm
            (Bytes{0x1A, 0x30, 0x34, 0x12, 0x00, 0x11, 0x02, 0x00, 0x00, 0xC4, 0xDB}));
}

TEST(EncoderFrames, TwentyThreeBitPositionFillsAllThreeBytes) {
  // A captured frame: 1a 20 13 82 6f 17 01 00 00 c1 13.
  EncoderModel encoder{{.single_turn_bits = 23, .enid = 0x17, .sf = 0x20, .almc = 0xC1},
                       MotionProfile::constant(0.0, static_cast<double>(0x6F8213) / 8388608.0)};
  EXPECT_EQ(ask(encoder, Time{0}, {0x1A}),
            (Bytes{0x1A, 0x20, 0x13, 0x82, 0x6F, 0x17, 0x01, 0x00, 0x00, 0xC1, 0x13}));
}

TEST(EncoderFrames, ErrorReset) {
  EncoderModel encoder{{}, at_rest(kAbs1ABCD)};
  EXPECT_EQ(ask(encoder, Time{0}, {0xBA}), (Bytes{0xBA, 0x00, 0xCD, 0xAB, 0x01, 0xDD}));  // tm485-id7-reply
}

TEST(EncoderFrames, SingleTurnReset) {
  EncoderModel encoder;
  EXPECT_EQ(ask(encoder, Time{0}, {0xC2}), (Bytes{0xC2, 0, 0, 0, 0, 0xC2}));  // tm485-id8-reply
}

TEST(EncoderFrames, MultiTurnReset) {
  EncoderModel encoder{{}, at_rest(kAbs1ABCD)};
  EXPECT_EQ(ask(encoder, Time{0}, {0x62}), (Bytes{0x62, 0x00, 0xCD, 0xAB, 0x01, 0x05}));  // tm485-idc-reply
}

TEST(EncoderFrames, EepromWriteEchoesAndReadReturnsTheByte) {
  EncoderModel encoder;
  EXPECT_EQ(ask(encoder, Time{0}, {0x32, 0x05, 0xA5, 0x92}), (Bytes{0x32, 0x05, 0xA5, 0x92}));  // tm485-eewr
  EXPECT_EQ(ask(encoder, ms(10), {0xEA, 0x05, 0xEF}), (Bytes{0xEA, 0x05, 0xA5, 0x4A}));         // tm485-eerd
}

TEST(EncoderFrames, ASingleTurnEncoderHasNoTurns) {
  EncoderModel encoder{{.enid = 0x00, .multi_turn = false}, at_rest(5 * 131072 + 7)};
  EXPECT_EQ(ask(encoder, Time{0}, {0x1A}), (Bytes{0x1A, 0, 0x07, 0, 0, 0, 0, 0, 0, 0, 0x1D}));
}

}  // namespace
}  // namespace tm485::sim
