// How the model behaves: what ends a request, when it is silent, when it answers, what it counts.
#include "tm485/sim/encoder_model.hpp"

#include <gtest/gtest.h>

#include "ask.hpp"

namespace tm485::sim {
namespace {

constexpr Time kGap{12'000};

TEST(EncoderRequests, AnUnknownIdGetsNoReply) {
  for (const std::uint8_t cf : Bytes{0xA2, 0x2A, 0x4A, 0x52, 0xDA, 0xF2, 0x7A}) {
    EncoderModel encoder;
    EXPECT_TRUE(ask(encoder, Time{0}, {cf}).empty());
    EXPECT_EQ(encoder.statistics().unknown_cf, 1u);
  }
}

TEST(EncoderRequests, AWrongSyncCodeGetsNoReply) {
  EncoderModel encoder;
  EXPECT_TRUE(ask(encoder, Time{0}, {0x03}).empty());  // tm485-neg-sync
}

TEST(EncoderRequests, AWrongParityGetsNoReply) {
  EncoderModel encoder;
  EXPECT_TRUE(ask(encoder, Time{0}, {0x82}).empty());  // tm485-neg-parity
}

TEST(EncoderRequests, AWrongCrcGetsNoReplyAndStoresNothing) {
  EncoderModel encoder;
  EXPECT_TRUE(ask(encoder, Time{0}, {0x32, 0x05, 0xA5, 0x93}).empty());
  EXPECT_EQ(encoder.eeprom().read(5), 0xFF);
  EXPECT_EQ(encoder.statistics().bad_requests, 1u);
}

TEST(EncoderRequests, AMissingStopBitGetsNoReply) {
  EncoderModel encoder;
  Burst reply;
  EXPECT_FALSE(encoder.on_character(0x1A, Time{0}, kCharacter, false, Judged::yes, reply));
  EXPECT_EQ(encoder.statistics().bad_requests, 1u);
}

TEST(EncoderRequests, EverythingAfterABadByteIsDroppedUntilAGap) {
  EncoderModel encoder;
  EXPECT_TRUE(ask(encoder, Time{0}, {0x55, 0x1A, 0x1A}).empty());
  const Time end = 3 * kCharacter;
  EXPECT_TRUE(ask(encoder, end + kGap - Time{1}, {0x1A}).empty());
  EXPECT_EQ(ask(encoder, end + kGap + kCharacter + kGap, {0x1A}).size(), 11u);
}

TEST(EncoderRequests, AGapOfTwelveMicrosecondsEndsAnIncompleteRequest) {
  EncoderModel encoder;
  EXPECT_TRUE(ask(encoder, Time{0}, {0x32, 0x05}).empty());
  EXPECT_TRUE(encoder.mid_request());
  EXPECT_EQ(ask(encoder, 2 * kCharacter + kGap, {0x02}).size(), 6u);
  EXPECT_EQ(encoder.statistics().bad_requests, 1u);
}

TEST(EncoderRequests, AShorterPauseBelongsToTheRequest) {
  EncoderModel encoder;
  EXPECT_TRUE(ask(encoder, Time{0}, {0x32, 0x05}).empty());
  EXPECT_EQ(ask(encoder, 2 * kCharacter + kGap - Time{1}, {0xA5, 0x92}), (Bytes{0x32, 0x05, 0xA5, 0x92}));
}

TEST(EncoderRequests, AControlFieldInsideARequestIsData) {
  EncoderModel encoder;
  EXPECT_EQ(ask(encoder, Time{0}, {0x32, 0x02, 0x1A, 0x2A}), (Bytes{0x32, 0x02, 0x1A, 0x2A}));
  EXPECT_EQ(encoder.eeprom().read(2), 0x1A);
  EXPECT_EQ(encoder.statistics().requests[3], 0u);
}

TEST(EncoderRequests, AnAddressWithTheBusyBitIsBad) {
  EncoderModel encoder;
  EXPECT_TRUE(ask(encoder, Time{0}, {0xEA, 0x85, 0x6F}).empty());
}

TEST(EncoderRequests, ARequestDuringTheOwnReplyIsNotHeard) {
  EncoderModel encoder;
  EXPECT_EQ(ask(encoder, Time{0}, {0x1A}).size(), 11u);
  EXPECT_TRUE(ask(encoder, us(30), {0x1A}).empty());
  EXPECT_EQ(encoder.statistics().deaf_requests, 1u);
}

TEST(EncoderRequests, RequestsAreCountedById) {
  EncoderModel encoder;
  ask(encoder, us(0), {0x1A});
  ask(encoder, us(100), {0x1A});
  ask(encoder, us(200), {0x02});
  EXPECT_EQ(encoder.statistics().requests[3], 2u);
  EXPECT_EQ(encoder.statistics().requests[0], 1u);
  EXPECT_EQ(encoder.statistics().replies, 3u);
}

TEST(EncoderTFormat, AParityErrorIsReportedOnceInTheNextId3) {
  EncoderModel encoder{{.flavour = Flavour::t_format}};
  ask(encoder, us(0), {0x82});
  EXPECT_EQ(ask(encoder, us(100), {0x02})[1], 0x00);
  EXPECT_EQ(ask(encoder, us(200), {0x1A})[1], 0x40);
  EXPECT_EQ(ask(encoder, us(300), {0x1A})[1], 0x00);
}

TEST(EncoderTFormat, AMissingStopBitIsReportedInTheNextId3) {
  EncoderModel encoder{{.flavour = Flavour::t_format}};
  Burst reply;
  EXPECT_FALSE(encoder.on_character(0x1A, us(0), us(4), false, Judged::yes, reply));
  EXPECT_EQ(ask(encoder, us(100), {0x1A})[1], 0x80);
}

TEST(EncoderTFormat, Tm485ReportsNoRequestErrors) {
  EncoderModel encoder;
  ask(encoder, us(0), {0x82});
  EXPECT_EQ(ask(encoder, us(100), {0x1A})[1], 0x00);
}

TEST(EncoderReplyTime, T2StaysWithinItsWindowAndUsesIt) {
  EncoderModel encoder{{.t2_min = Time{2'800}, .t2_max = Time{3'200}, .seed = 7}};
  Time shortest = kNever;
  Time longest{0};
  for (int cycle = 0; cycle < 2000; ++cycle) {
    const Time start = us(100) * cycle;
    Burst reply;
    ask(encoder, start, {0x1A}, &reply);
    shortest = std::min(shortest, reply.start - start - kCharacter);
    longest = std::max(longest, reply.start - start - kCharacter);
  }
  EXPECT_GE(shortest, Time{2'800});
  EXPECT_LT(shortest, Time{2'810});
  EXPECT_LE(longest, Time{3'200});
  EXPECT_GT(longest, Time{3'190});
}

TEST(EncoderLatch, PositionIsThatOfTheEndOfTheRequestPlusTheOffset) {
  // 60 rpm and 23 bits: 8388608 counts a second.
  const auto motion = MotionProfile::constant(60.0);
  EncoderModel encoder{{.single_turn_bits = 23, .latch_offset = Time{500}}, motion};
  ask(encoder, ms(125), {0x1A});
  EXPECT_EQ(encoder.last_latch().time, ms(125) + kCharacter + Time{500});
  EXPECT_EQ(encoder.last_latch().abs, 1048576u + 37u);  // 4.5 us are 37.7 counts
  EXPECT_EQ(encoder.last_latch().counts, 1048576 + 37);
}

TEST(EncoderLatch, ALongerRequestIsLatchedAtItsOwnEnd) {
  EncoderModel encoder;
  ask(encoder, us(10), {0xEA, 0x05, 0xEF});
  EXPECT_EQ(encoder.last_latch().time, us(10) + 3 * kCharacter);
}

TEST(EncoderTurns, CountIsOneAtPowerUpWhereverTheShaftIs) {
  EncoderModel encoder{{}, at_rest(40 * 131072 + 5)};
  EXPECT_EQ(ask(encoder, Time{0}, {0x8A})[2], 1);
  EXPECT_EQ(encoder.last_latch().counts, 5);
}

TEST(EncoderTurns, BelowTheFirstTurnComesZeroThenFFFF) {
  EncoderModel encoder;
  encoder.set_motion(at_rest(-1));
  EXPECT_EQ(ask(encoder, us(0), {0x1A}), (Bytes{0x1A, 0, 0xFF, 0xFF, 0x01, 0x11, 0, 0, 0, 0, 0x0A}));
  EXPECT_EQ(encoder.last_latch().counts, -1);
  encoder.set_motion(at_rest(-131073));
  EXPECT_EQ(ask(encoder, us(100), {0x1A}), (Bytes{0x1A, 0, 0xFF, 0xFF, 0x01, 0x11, 0xFF, 0xFF, 0, 0, 0x0A}));
  EXPECT_EQ(encoder.last_latch().turns, -1);
  EXPECT_EQ(encoder.last_latch().abm, 0xFFFF);
}

TEST(EncoderTurns, AboveFFFFComesZeroAndTheThirdByteStaysZero) {
  EncoderModel encoder{{.battery = true, .start_turn = 0}, at_rest(std::int64_t{65535} * 131072)};
  EXPECT_EQ(ask(encoder, us(0), {0x8A}), (Bytes{0x8A, 0, 0xFF, 0xFF, 0, 0x8A}));
  encoder.set_motion(at_rest(std::int64_t{65536} * 131072));
  EXPECT_EQ(ask(encoder, us(100), {0x8A}), (Bytes{0x8A, 0, 0, 0, 0, 0x8A}));
  EXPECT_EQ(encoder.last_latch().turns, 65536);
}

TEST(EncoderPower, ABootingEncoderIsSilent) {
  EncoderModel encoder{{.boot_time = ms(5)}};
  EXPECT_TRUE(ask(encoder, ms(4), {0x1A}).empty());
  EXPECT_EQ(ask(encoder, ms(5), {0x1A}).size(), 11u);
}

TEST(EncoderPower, OffIsSilentAndBackComesAfterTheBootTime) {
  EncoderModel encoder{{.boot_time = ms(5)}};
  EXPECT_TRUE(encoder.power_off(ms(10)));
  EXPECT_TRUE(encoder.power_on(ms(20)));
  EXPECT_EQ(ask(encoder, ms(9), {0x1A}).size(), 11u);
  EXPECT_TRUE(ask(encoder, ms(11), {0x1A}).empty());
  EXPECT_TRUE(ask(encoder, ms(24), {0x1A}).empty());
  EXPECT_EQ(ask(encoder, ms(25), {0x1A}).size(), 11u);
  EXPECT_EQ(encoder.statistics().power_ups, 2u);
}

TEST(EncoderPower, TurnsAreLostWithoutABatteryAndKeptWithOne) {
  for (const bool battery : {false, true}) {
    EncoderModel encoder{{.battery = battery}, MotionProfile::constant(60'000.0)};  // a turn a millisecond
    encoder.power_off(ms(10));
    encoder.power_on(ms(20));
    EXPECT_EQ(ask(encoder, ms(9), {0x8A})[2], 10);
    EXPECT_EQ(ask(encoder, ms(23), {0x8A})[2], battery ? 24 : 4);
  }
}

TEST(EncoderPower, AReplyIsCutWhereTheSupplyEnds) {
  EncoderModel encoder{{.t2_min = us(3), .t2_max = us(3)}};
  encoder.power_off(us(20));  // request 0..4, reply from 7: three characters are complete by 19
  EXPECT_EQ(ask(encoder, Time{0}, {0x1A}).size(), 3u);
}

TEST(EncoderPower, TooManyAnnouncedChangesAreRefused) {
  EncoderModel encoder;
  for (std::size_t k = 0; k < EncoderModel::kPowerChanges; ++k) {
    EXPECT_TRUE(encoder.power_off(ms(static_cast<std::int64_t>(k) + 1)));
  }
  EXPECT_FALSE(encoder.power_on(ms(100)));
}

TEST(EncoderAlarms, LatchedOnesGoWithThePower) {
  EncoderModel encoder{{.almc = 0x01}};
  encoder.latch_alarms(0x10, 0x04);
  EXPECT_EQ(ask(encoder, Time{0}, {0x1A})[9], 0x05);
  encoder.power_off(ms(1));
  encoder.power_on(ms(2));
  EXPECT_EQ(ask(encoder, ms(3), {0x1A})[9], 0x01);
}

TEST(EncoderAlarms, StatusFollowsFromTheAlarmCode) {
  EXPECT_EQ(EncoderModel::sf_of(0xC4), 0x30);
  EXPECT_EQ(EncoderModel::sf_of(0xC1), 0x20);
  EXPECT_EQ(EncoderModel::sf_of(0x01), 0x00);
}

}  // namespace
}  // namespace tm485::sim
