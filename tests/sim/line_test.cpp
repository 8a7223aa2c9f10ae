// The half-duplex line: character times, collisions, echo, what the host hears and when.
#include "tm485/sim/line.hpp"

#include <gtest/gtest.h>

#include "ask.hpp"

namespace tm485::sim {
namespace {

constexpr EncoderConfig kFixedT2{.t2_min = Time{3'000}, .t2_max = Time{3'000}};

bool host_sends(Line& line, Time start, const Bytes& bytes, Time release = Time{200}) {
  const Time end = start + line.character_time() * static_cast<std::int64_t>(bytes.size());
  return line.transmit(Talker::host, start, bytes, start - us(1), end + release);
}

struct Heard {
  Bytes bytes;
  Time first_start{0};
  bool framing_error = false;
  bool lost = false;
};

Heard host_hears(Line& line, Time now, std::size_t room = 64) {
  Bytes buffer(room);
  const HostReception reception = line.host_receive(buffer, now);
  buffer.resize(reception.count);
  return {buffer, reception.first_start, reception.framing_error, reception.lost};
}

TEST(Line, AReplyComesWhenTheWireSaysSo) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder};
  host_sends(line, us(100), {0x1A});
  EXPECT_EQ(line.next_event(), us(100 + 4 + 3 + 44));
  EXPECT_TRUE(host_hears(line, us(107)).bytes.empty());
  const Heard heard = host_hears(line, us(151));
  EXPECT_EQ(heard.bytes.size(), 11u);
  EXPECT_EQ(heard.first_start, us(107));
  EXPECT_FALSE(heard.framing_error);
  EXPECT_EQ(line.next_event(), kNever);
}

TEST(Line, CharactersArriveOneByOne) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder};
  host_sends(line, us(0), {0x92});
  EXPECT_TRUE(host_hears(line, us(11) - Time{1}).bytes.empty());
  const Heard first = host_hears(line, us(11));
  EXPECT_EQ(first.bytes, (Bytes{0x92}));
  EXPECT_EQ(first.first_start, us(7));
  const Heard rest = host_hears(line, us(23));
  EXPECT_EQ(rest.bytes, (Bytes{0x00, 0x11, 0x83}));
  EXPECT_EQ(rest.first_start, us(11));
}

TEST(Line, ASmallBufferIsFilledAndTheRestKept) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder};
  host_sends(line, us(0), {0x92});
  EXPECT_EQ(host_hears(line, us(30), 3).bytes, (Bytes{0x92, 0x00, 0x11}));
  EXPECT_EQ(host_hears(line, us(30), 3).bytes, (Bytes{0x83}));
}

TEST(Line, TheHostDoesNotHearItself) {
  Line line{nullptr};
  host_sends(line, us(0), {0x1A});
  EXPECT_EQ(line.next_event(), kNever);
  EXPECT_TRUE(host_hears(line, us(100)).bytes.empty());
}

TEST(Line, WithEchoTheHostHearsItselfFirst) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder, {.echo = true}};
  host_sends(line, us(0), {0x92});
  EXPECT_EQ(line.next_event(), us(4));
  const Heard echo = host_hears(line, us(23));
  EXPECT_EQ(echo.bytes, (Bytes{0x92}));
  EXPECT_EQ(echo.first_start, us(0));
  EXPECT_EQ(line.next_event(), us(23));
  EXPECT_EQ(host_hears(line, us(23)).bytes, (Bytes{0x92, 0x00, 0x11, 0x83}));
}

TEST(Line, ADriverReleasedInTimeDoesNoHarm) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder};
  host_sends(line, us(0), {0x1A}, Time{3'000});
  EXPECT_FALSE(host_hears(line, us(60)).framing_error);
  EXPECT_EQ(line.statistics().collisions, 0u);
}

TEST(Line, ADriverReleasedLateCorruptsTheFirstReplyByteOnly) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder};
  host_sends(line, us(0), {0x92}, Time{3'001});
  const Heard heard = host_hears(line, us(60));
  EXPECT_EQ(heard.bytes.size(), 4u);
  EXPECT_NE(heard.bytes[0], 0x92);
  EXPECT_EQ((Bytes{heard.bytes.begin() + 1, heard.bytes.end()}), (Bytes{0x00, 0x11, 0x83}));
  EXPECT_TRUE(heard.framing_error);
  EXPECT_EQ(line.statistics().collisions, 1u);
}

TEST(Line, TheFramingFlagBelongsToTheCharactersTaken) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder};
  host_sends(line, us(0), {0x92}, Time{3'001});
  EXPECT_TRUE(host_hears(line, us(11)).framing_error);
  EXPECT_FALSE(host_hears(line, us(60)).framing_error);
}

TEST(Line, TwoTalkersCorruptEachOther) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder};
  host_sends(line, us(0), {0x1A});
  const Bytes noise{0xAA, 0xAA};
  line.transmit(Talker::third, us(20), noise, us(20), us(28));
  Bytes heard;
  bool framing_error = false;
  for (Heard part = host_hears(line, us(60)); !part.bytes.empty(); part = host_hears(line, us(60))) {
    heard.insert(heard.end(), part.bytes.begin(), part.bytes.end());
    framing_error |= part.framing_error;
  }
  EXPECT_EQ(heard.size(), 13u);
  EXPECT_TRUE(framing_error);
  // The reply's characters from 19 to 31, and both of the noise.
  EXPECT_EQ(line.statistics().collisions, 5u);
}

TEST(Line, ACorruptedRequestIsNotAnswered) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder};
  const Bytes noise{0x00};
  line.transmit(Talker::third, us(2), noise, us(2), us(6));
  host_sends(line, us(0), {0x1A});
  line.advance_to(us(200));
  EXPECT_EQ(encoder.statistics().replies, 0u);
  EXPECT_EQ(encoder.statistics().bad_requests, 1u);
}

TEST(Line, ABabblerIsHeardByTheHost) {
  Line line{nullptr};
  const Bytes babble(100, 0x55);
  EXPECT_TRUE(line.transmit(Talker::third, us(0), babble, us(0), us(400)));
  std::size_t heard = 0;
  while (line.next_event() != kNever) heard += host_hears(line, line.next_event()).bytes.size();
  EXPECT_EQ(heard, 100u);
  EXPECT_EQ(line.statistics().collisions, 0u);
}

TEST(Line, ABabblerDoesNotCountAgainstTheHostsT1) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder};
  for (int k = 0; k < 10; ++k) {
    const Bytes noise{0x02};
    line.transmit(Talker::third, us(20) * k, noise, us(20) * k, us(20) * k + us(4));
  }
  line.advance_to(us(500));
  EXPECT_EQ(encoder.t1().violations(), 0u);
}

TEST(Line, WhatNobodyTakesIsLostInTheEnd) {
  Line line{nullptr};
  const Bytes byte{0x55};
  for (std::uint32_t k = 0; k <= Line::kBursts; ++k) {
    const Time start = us(100) * k;
    EXPECT_TRUE(line.transmit(Talker::third, start, byte, start, start + us(4)));
    line.advance_to(start + us(50));
  }
  const Heard heard = host_hears(line, ms(100));
  EXPECT_TRUE(heard.lost);
  EXPECT_EQ(heard.first_start, us(100));
  EXPECT_FALSE(host_hears(line, ms(100)).lost);
  EXPECT_EQ(line.statistics().lost, 1u);
}

TEST(Line, TooManyWaitingBurstsAreRefused) {
  Line line{nullptr};
  const Bytes byte{0x55};
  for (std::uint32_t k = 0; k < Line::kBursts; ++k) {
    EXPECT_TRUE(line.transmit(Talker::third, us(100) * k, byte, us(100) * k, us(100) * k + us(4)));
  }
  EXPECT_FALSE(line.transmit(Talker::third, ms(50), byte, ms(50), ms(51)));
  EXPECT_EQ(line.statistics().refused, 1u);
}

TEST(Line, TheSameSeedMakesTheSameGarbage) {
  Bytes heard[2];
  for (Bytes& bytes : heard) {
    EncoderModel encoder{kFixedT2};
    Line line{&encoder, {.seed = 99}};
    host_sends(line, us(0), {0x1A}, us(20));
    bytes = host_hears(line, us(60)).bytes;
  }
  EXPECT_EQ(heard[0], heard[1]);
}

TEST(Line, TheRateIsAdjustable) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder, {.bits_per_second = 1'000'000}};
  EXPECT_EQ(line.character_time(), us(10));
  host_sends(line, us(0), {0x92});
  EXPECT_EQ(line.next_event(), us(10 + 3 + 40));
}

TEST(Line, CutRepliesOfADyingEncoderEndEarly) {
  EncoderModel encoder{kFixedT2};
  Line line{&encoder};
  encoder.power_off(us(20));
  host_sends(line, us(0), {0x1A});
  EXPECT_EQ(line.next_event(), us(19));
  EXPECT_EQ(host_hears(line, us(100)).bytes.size(), 3u);
}

TEST(Line, AMillionCyclesStayInOrder) {
  EncoderModel encoder{{}, MotionProfile::constant(3000.0)};
  Line line{&encoder};
  for (std::int64_t cycle = 0; cycle < 1'000'000; ++cycle) {
    const Time start = Time{62'500} * cycle;
    const std::uint8_t cf = 0x1A;
    line.transmit(Talker::host, start, {&cf, 1}, start - us(1), start + Time{4'200});
    std::array<std::uint8_t, 16> buffer{};
    const HostReception reception = line.host_receive(buffer, line.next_event());
    ASSERT_EQ(reception.count, 11u);
    const std::uint32_t abs = buffer[2] | std::uint32_t{buffer[3]} << 8 | std::uint32_t{buffer[4]} << 16;
    ASSERT_EQ(abs, encoder.last_latch().abs);
  }
  EXPECT_EQ(encoder.t1().violations(), 0u);
  EXPECT_EQ(encoder.t1().smallest_margin(), Time{0});
  EXPECT_EQ(line.statistics().lost + line.statistics().refused + line.statistics().collisions, 0u);
}

}  // namespace
}  // namespace tm485::sim
