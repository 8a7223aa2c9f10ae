// What a UART makes of a burst at another rate, on a swapped pair, after a glitch. The expected bytes were written down
// from the bits by hand.
#include "tm485/sim/distortion.hpp"

#include <gtest/gtest.h>

#include "ask.hpp"
#include "tm485/sim/line.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::sim {
namespace {

constexpr std::int64_t kUsual = 2'500'000;

Burst burst_of(Talker talker, const Bytes& bytes, Time driver_lead = Time{900}) {
  Burst burst;
  burst.talker = talker;
  burst.start = us(100);
  burst.driver_on = burst.start - driver_lead;
  burst.driver_off = burst.start + kCharacter * static_cast<std::int64_t>(bytes.size()) + Time{200};
  burst.count = static_cast<std::uint8_t>(bytes.size());
  std::copy(bytes.begin(), bytes.end(), burst.bytes.begin());
  return burst;
}

Bytes bytes_of(const Burst& burst) { return {burst.bytes.begin(), burst.bytes.begin() + burst.count}; }

Burst at_encoder(const Bytes& bytes, std::int64_t encoder_rate, Swap swap = Swap::none) {
  const Distortion distortion{{.encoder_bits_per_second = encoder_rate, .swap = swap}};
  Burst burst = burst_of(Talker::host, bytes);
  distortion.host_at_encoder(burst);
  return burst;
}

Bytes every_byte_from(unsigned first) {
  Bytes bytes;
  for (unsigned k = 0; k < Burst::kCapacity; ++k) bytes.push_back(static_cast<std::uint8_t>(first + k));
  return bytes;
}

TEST(Distortion, WithoutAReasonNothingIsDistorted) {
  EXPECT_FALSE(Distortion{{}}.distorts());
  EXPECT_TRUE((Distortion{{.encoder_bits_per_second = kUsual - 1}}.distorts()));
  EXPECT_TRUE((Distortion{{.swap = Swap::pair}}.distorts()));
  EXPECT_TRUE((Distortion{{.glitches = 1e-9}}.distorts()));
}

TEST(Distortion, WithinThreePercentEveryByteIsUnderstood) {
  for (unsigned first = 0; first < 256; first += Burst::kCapacity) {
    for (const std::int64_t rate : {kUsual, kUsual * 97 / 100, kUsual * 103 / 100}) {
      const Burst heard = at_encoder(every_byte_from(first), rate);
      EXPECT_EQ(bytes_of(heard), every_byte_from(first)) << rate;
      EXPECT_EQ(heard.framing_errors, 0u) << rate;
      EXPECT_EQ(heard.start, us(100));
    }
  }
}

TEST(Distortion, TenPercentOffIsGarbage) {
  EXPECT_NE(bytes_of(at_encoder(every_byte_from(0), kUsual * 9 / 10)), every_byte_from(0));
  EXPECT_NE(bytes_of(at_encoder(every_byte_from(0), kUsual * 11 / 10)), every_byte_from(0));
}

TEST(Distortion, AtHalfTheRateEverySecondBitIsRead) {
  // 1A on the wire: 0 01011000 1, then mark. Read at bits 3, 5, 7, 9 and beyond: 0 1 0 1 1 1 1 1.
  const Burst heard = at_encoder({0x1A}, kUsual / 2);
  EXPECT_EQ(bytes_of(heard), (Bytes{0xFA}));
  EXPECT_EQ(heard.framing_errors, 0u);
}

TEST(Distortion, AtTwiceTheRateALongSpaceHasNoStopBit) {
  const Burst heard = at_encoder({0x00}, kUsual * 2);
  EXPECT_EQ(bytes_of(heard), (Bytes{0x00}));
  EXPECT_EQ(heard.framing_errors, 1u);
}

TEST(Distortion, OnASwappedPairTheDriversLeadIsTheStartBit) {
  // From 0.9 us before the start bit on: space, then 1A inverted: 1 10100111 0. Read: 0 | 0 1 1 0 1 0 0 1 | 1. The space
  // of the stop bit and of the driver's tail is one more start bit, and the idle line its data.
  const Burst heard = at_encoder({0x1A}, kUsual, Swap::pair);
  EXPECT_EQ(bytes_of(heard), (Bytes{0x96, 0xFF}));
  EXPECT_EQ(heard.framing_errors, 0u);
  EXPECT_EQ(bytes_of(at_encoder({0x1A}, kUsual, Swap::receive)), (Bytes{0x1A}));
}

TEST(Distortion, ASwappedReceiverInvertsTheRepliesAndTheEcho) {
  Distortion distortion{{.swap = Swap::receive}};
  Burst echo = burst_of(Talker::host, {0x1A});
  distortion.host_at_host(echo);
  EXPECT_EQ(bytes_of(echo), (Bytes{0x96, 0xFF}));
  Burst reply = burst_of(Talker::encoder, {0x1A});
  distortion.encoder_at_host(reply);
  EXPECT_EQ(bytes_of(reply), (Bytes{0x96, 0xFF}));
  EXPECT_EQ(reply.start, us(100) - Time{900});
}

TEST(Distortion, ASlowEncodersReplyIsManyCharactersWithBrokenStopBits) {
  Distortion distortion{{.encoder_bits_per_second = kUsual / 5}};
  Burst reply = burst_of(Talker::encoder, {0x92, 0x00, 0x11, 0x83});
  distortion.encoder_at_host(reply);
  EXPECT_GT(reply.count, 4u);
  EXPECT_LE(reply.count, 21u);
  EXPECT_NE(reply.framing_errors, 0u);
  EXPECT_EQ(reply.driver_off, us(100) + us(80) + Time{200});
}

TEST(Distortion, AGlitchBeforeTheReplyPutsTheReceiverOutOfStep) {
  Distortion distortion{{.glitches = 1.0}};
  const Bytes sent{0x1A, 0x00, 0x13, 0x6E, 0x01, 0x11, 0x05, 0x00, 0x00, 0x00, 0x72};
  for (int k = 0; k < 100; ++k) {
    Burst reply = burst_of(Talker::encoder, sent, Time{500});
    distortion.encoder_at_host(reply);
    EXPECT_NE(bytes_of(reply), sent);
    EXPECT_LT(reply.start, us(100));
    EXPECT_GE(reply.start, us(98));
  }
  EXPECT_EQ(distortion.glitches(), 100u);
}

TEST(Distortion, TheHostsOwnEchoIsNotDistortedByTheEncodersRate) {
  EncoderModel encoder;
  Line line{&encoder, {.echo = true}};
  Distortion distortion{{.encoder_bits_per_second = kUsual / 2}};
  line.set_distortion(&distortion);
  const Bytes request{0x1A};
  line.transmit(Talker::host, us(10), request, us(9), us(14));
  Bytes heard(8);
  heard.resize(line.host_receive(heard, us(200)).count);
  EXPECT_EQ(heard, request);
  EXPECT_EQ(encoder.statistics().unknown_cf, 1u);
  EXPECT_EQ(encoder.statistics().replies, 0u);
  EXPECT_EQ(encoder.t1().violations(), 0u);
}

TEST(Distortion, TheSimulatedEncoderHasThemFromItsOptions) {
  const auto heard = [](std::string_view text, std::int64_t host_rate) {
    SimOptions options = *parse_sim_options(text);
    options.line.encoder_bits_per_second = options.line.bits_per_second;
    options.line.bits_per_second = host_rate;
    SimulatedEncoder encoder{options};
    const Bytes request{0x92};
    EXPECT_TRUE(encoder.port().try_send(request, us(10)).has_value());
    Bytes bytes(64);
    bytes.resize(encoder.port().try_receive(bytes, ms(1)).count);
    return bytes;
  };
  const Bytes reply{0x92, 0x00, 0x11, 0x83};
  EXPECT_EQ(heard("", kUsual), reply);
  EXPECT_EQ(heard("baud=1000000", 1'000'000), reply);
  EXPECT_TRUE(heard("baud=1000000", kUsual).empty());
  EXPECT_TRUE(heard("power=off", kUsual).empty());
  EXPECT_TRUE(heard("swap=pair", kUsual).empty());
  EXPECT_FALSE(heard("swap=receive", kUsual).empty());
  EXPECT_NE(heard("swap=receive", kUsual), reply);
  EXPECT_NE(heard("glitch=1", kUsual), reply);
}

}  // namespace
}  // namespace tm485::sim
