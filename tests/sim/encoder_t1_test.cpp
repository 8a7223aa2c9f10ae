// The model as the judge of T1.
#include <gtest/gtest.h>

#include "ask.hpp"

namespace tm485::sim {
namespace {

TEST(T1, AnExactSpanIsNoViolationAndItsMarginIsZero) {
  EncoderModel encoder;
  ask(encoder, us(0), {0x02});
  ask(encoder, us(40), {0x02});
  EXPECT_EQ(encoder.t1().violations(), 0u);
  EXPECT_EQ(encoder.t1().smallest_margin(), Time{0});
}

TEST(T1, OneNanosecondTooEarlyIsAViolation) {
  EncoderModel encoder;
  ask(encoder, us(0), {0x1A});
  ask(encoder, Time{62'499}, {0x1A});
  ask(encoder, us(200), {0x1A});
  EXPECT_EQ(encoder.t1().violations(), 1u);
  EXPECT_EQ(encoder.t1().first_violation(), Time{62'499});
  EXPECT_EQ(encoder.t1().smallest_margin(), Time{-1});
}

TEST(T1, TheRequestBeforeSetsTheSpan) {
  EncoderModel encoder;
  ask(encoder, us(0), {0x02});  // 40 us to the next, whatever it is
  ask(encoder, us(40), {0x1A});
  EXPECT_EQ(encoder.t1().violations(), 0u);
  ask(encoder, us(80), {0x02});  // but 62.5 us after an ID3
  EXPECT_EQ(encoder.t1().violations(), 1u);
}

TEST(T1, SpanOfEveryId) {
  const struct {
    Bytes request;
    std::int64_t ns;
  } kinds[] = {
      {{0x02}, 40'000},
      {{0x8A}, 40'000},
      {{0x92}, 40'000},
      {{0x1A}, 62'500},
      {{0x32, 0x05, 0xA5, 0x92}, 40'000},
      {{0xBA}, 62'500},
      {{0xC2}, 62'500},
      {{0x62}, 62'500},
      {{0xEA, 0x05, 0xEF}, 40'000},
  };
  for (const auto& kind : kinds) {
    EncoderModel encoder;
    ask(encoder, Time{0}, kind.request);
    ask(encoder, Time{kind.ns + 3}, {0x02});
    EXPECT_EQ(encoder.t1().smallest_margin(), Time{3}) << int{kind.request[0]};
  }
}

TEST(T1, AnUnreadableRequestDemandsTheLeastSpan) {
  EncoderModel encoder;
  ask(encoder, us(0), {0x55});
  ask(encoder, us(39), {0x02});
  EXPECT_EQ(encoder.t1().violations(), 1u);
}

TEST(T1, ARequestInTheMiddleOfAReplyIsJudgedThoughNotHeard) {
  EncoderModel encoder;
  ask(encoder, us(0), {0x1A});
  ask(encoder, us(30), {0x1A});
  EXPECT_EQ(encoder.t1().violations(), 1u);
}

TEST(T1, WhatIsNotTheHostsIsNotJudged) {
  EncoderModel encoder;
  Burst reply;
  ask(encoder, us(0), {0x02});
  EXPECT_FALSE(encoder.on_character(0x02, us(20), us(24), true, Judged::no, reply));
  ask(encoder, us(50), {0x02});
  EXPECT_EQ(encoder.t1().violations(), 0u);
}

TEST(T1, APowerCycleStartsAnew) {
  EncoderModel encoder;
  ask(encoder, us(0), {0x1A});
  encoder.power_off(us(52));
  encoder.power_on(us(53));
  ask(encoder, us(55), {0x1A});
  EXPECT_EQ(encoder.t1().violations(), 0u);
}

TEST(EepromInterval, AWriteTooSoonAfterAWriteIsCounted) {
  EncoderModel encoder;
  ask(encoder, ms(0), {0x32, 0x05, 0xA5, 0x92});
  ask(encoder, ms(10), {0x32, 0x05, 0xA5, 0x92});
  EXPECT_EQ(encoder.eeprom().interval_violations(), 0u);
  ask(encoder, ms(20) - us(1), {0x32, 0x05, 0xA5, 0x92});
  EXPECT_EQ(encoder.eeprom().interval_violations(), 1u);
}

TEST(EepromInterval, APageChangeTakesEighteenMilliseconds) {
  EncoderModel encoder;
  ask(encoder, ms(0), {0x32, 0x7F, 0x03, 0x4E});  // tm485-page-select
  ask(encoder, ms(17), {0x32, 0x05, 0xA5, 0x92});
  EXPECT_EQ(encoder.eeprom().interval_violations(), 1u);
}

}  // namespace
}  // namespace tm485::sim
