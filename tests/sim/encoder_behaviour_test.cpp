// What the unit tests of a public T-format slave assert of it, as tests of the model: one test a behaviour, in their
// order. Their device has six user pages.
#include <gtest/gtest.h>

#include "ask.hpp"

namespace tm485::sim {
namespace {

constexpr int kPageRegister = 127;
constexpr Time kResetSpacing{62'500};

EncoderModel slave(const MotionProfile& motion = {}, EepromConfig eeprom = {}) {
  eeprom.pages = 6;
  return EncoderModel{{.flavour = Flavour::t_format, .eeprom = eeprom}, motion};
}

/// `count` times `cf`; returns the time one spacing after the last.
Time run(EncoderModel& encoder, Time start, std::uint8_t cf, int count, Time spacing = kResetSpacing) {
  for (int k = 0; k < count; ++k, start += spacing) ask(encoder, start, {cf});
  return start;
}

struct Alarms {
  int sf;
  int almc;
  bool operator==(const Alarms&) const = default;
};
Alarms alarms(EncoderModel& encoder, Time start) {
  const Bytes reply = ask(encoder, start, {0x1A});
  return reply.empty() ? Alarms{-1, -1} : Alarms{reply.at(1), reply.at(9)};
}

TEST(Behaviour, APauseOfTwelveMicrosecondsEndsARequest) {
  for (const bool paused : {false, true}) {
    EncoderModel encoder = slave();
    ask(encoder, us(0), {0xEA, 0x05});
    EXPECT_EQ(ask(encoder, us(8) + us(12) - Time{paused ? 0 : 1}, {0xEF}).empty(), paused);
  }
}

TEST(Behaviour, AControlFieldInsideARequestIsData) {
  EncoderModel encoder = slave();
  ask(encoder, us(0), write_request(0x02, 0x1A));
  EXPECT_EQ(encoder.eeprom().read(0x02), 0x1A);
  EXPECT_EQ(encoder.statistics().requests[3], 0u);
}

TEST(Behaviour, AnUnknownControlFieldIsSilentAndEverythingIsDiscardedUntilAPause) {
  EncoderModel encoder = slave();
  EXPECT_TRUE(ask(encoder, us(0), {0xA2, 0x1A, 0x02}).empty());
  EXPECT_EQ(ask(encoder, us(24), {0x1A}).size(), 11u);
}

TEST(Behaviour, ABadCrcIsSilent) {
  EncoderModel encoder = slave();
  EXPECT_TRUE(ask(encoder, us(0), {0x32, 0x05, 0xA5, 0x93}).empty());
  EXPECT_TRUE(ask(encoder, us(100), {0xEA, 0x05, 0xEE}).empty());
  EXPECT_EQ(encoder.eeprom().read(0x05), 0xFF);
}

TEST(Behaviour, AParityErrorIsSilentAndTheNextId3ReportsIt) {
  EncoderModel encoder = slave();
  EXPECT_TRUE(ask(encoder, us(0), {0x82}).empty());
  EXPECT_EQ(alarms(encoder, us(100)).sf, 0x40);
  EXPECT_EQ(alarms(encoder, us(200)).sf, 0x00);
}

TEST(Behaviour, AFramingErrorIsReportedByTheNextId3) {
  EncoderModel encoder = slave();
  Burst reply;
  EXPECT_FALSE(encoder.on_character(0x1A, us(0), us(4), false, Judged::yes, reply));
  EXPECT_EQ(alarms(encoder, us(100)).sf, 0x80);
}

TEST(Behaviour, AWriteWhileBusyIsAnsweredBusyWithZeroAndNotStored) {
  EncoderModel encoder = slave();
  ask(encoder, ms(0), write_request(0x05, 0xA5));
  EXPECT_EQ(ask(encoder, ms(5), write_request(0x20, 0xA5)), (Bytes{0x32, 0xA0, 0x00, 0x92}));
  EXPECT_EQ(ask(encoder, ms(10), read_request(0x20)), (Bytes{0xEA, 0x20, 0xFF, 0x35}));
}

TEST(Behaviour, AReadWhileBusyIsAnsweredBusyWithZero) {
  EncoderModel encoder = slave();
  ask(encoder, ms(0), write_request(0x20, 0xA5));
  EXPECT_EQ(ask(encoder, ms(5), read_request(0x20)), (Bytes{0xEA, 0xA0, 0x00, 0x4A}));
}

TEST(Behaviour, TheReplyToAnAcceptedWriteIsBusyAlreadyAndEchoesTheData) {
  EncoderModel encoder = slave();
  EXPECT_EQ(ask(encoder, ms(0), write_request(0x20, 0xA5)), (Bytes{0x32, 0xA0, 0xA5, 0x37}));
}

TEST(Behaviour, APageSelectIsNeverBusy) {
  EncoderModel encoder = slave();
  EXPECT_EQ(ask(encoder, ms(0), write_request(kPageRegister, 1)), (Bytes{0x32, 0x7F, 0x01, 0x4C}));
  EXPECT_EQ(ask(encoder, us(40), read_request(kPageRegister)), (Bytes{0xEA, 0x7F, 0x01, 0x94}));
}

TEST(Behaviour, TheLastUserByteIs7EOnPageFive) {
  EncoderModel encoder = slave();
  ask(encoder, ms(0), write_request(kPageRegister, 5));
  ask(encoder, ms(20), write_request(0x7E, 0x42));
  EXPECT_EQ(ask(encoder, ms(40), read_request(0x7E)).at(2), 0x42);
  EXPECT_EQ(encoder.eeprom().image().back(), 0x42);
}

TEST(Behaviour, PagesSixAndSevenReadFfAndIgnoreWrites) {
  EncoderModel encoder = slave();
  const EepromModel::Image before = encoder.eeprom().settled_image(ms(0));
  for (const int page : {6, 7}) {
    const Time start = ms(100) * page;
    ask(encoder, start, write_request(kPageRegister, page));
    EXPECT_EQ(ask(encoder, start + ms(20), write_request(0x05, 0xA5)), write_request(0x05, 0xA5));
    EXPECT_EQ(ask(encoder, start + ms(21), read_request(0x05)), (Bytes{0xEA, 0x05, 0xFF, 0x10}));
    EXPECT_EQ(ask(encoder, start + ms(22), read_request(kPageRegister)).at(2), page);
  }
  EXPECT_EQ(encoder.eeprom().settled_image(ms(900)), before);
  EXPECT_EQ(encoder.eeprom().writes(), 0u);
}

TEST(Behaviour, AWriteThatCannotBeKeptRestoresTheOldValue) {
  EncoderModel encoder = slave({}, {.failed_writes = 1.0});
  EXPECT_EQ(ask(encoder, ms(0), write_request(0x20, 0xA5)), (Bytes{0x32, 0xA0, 0xA5, 0x37}));
  EXPECT_EQ(ask(encoder, ms(5), read_request(0x20)).at(1), 0xA0);
  EXPECT_EQ(ask(encoder, ms(10), read_request(0x20)), (Bytes{0xEA, 0x20, 0xFF, 0x35}));
  EXPECT_EQ(encoder.eeprom().failed_writes(), 1u);
}

TEST(Behaviour, Id8WhileMovingIsRefusedAndSetsTheCountingError) {
  EncoderModel encoder = slave(MotionProfile::constant(60.0));
  const Time after = run(encoder, ms(10), 0xC2, 10);
  EXPECT_EQ(alarms(encoder, after), (Alarms{0x10, 0x04}));
  ask(encoder, ms(500) - us(4), {0x02});
  EXPECT_EQ(encoder.last_latch().abs, 65536u);  // the zero stays where it was
  run(encoder, ms(501), 0xBA, 10);
  EXPECT_EQ(alarms(encoder, ms(502)), (Alarms{0, 0}));
}

TEST(Behaviour, NineResetsDoNothingAndTheTenthActsOnce) {
  EncoderModel encoder = slave();
  encoder.latch_alarms(0x10, 0x04);
  Time at = run(encoder, us(0), 0xBA, 9);
  EXPECT_EQ(encoder.statistics().resets_done, 0u);
  at = run(encoder, at, 0xBA, 1);
  EXPECT_EQ(encoder.statistics().resets_done, 1u);
  encoder.latch_alarms(0x10, 0x04);
  at = run(encoder, at, 0xBA, 9);
  EXPECT_EQ(encoder.statistics().resets_done, 1u);
  EXPECT_EQ(alarms(encoder, at), (Alarms{0x10, 0x04}));
}

TEST(Behaviour, TooShortAnIntervalRestartsTheCount) {
  EncoderModel encoder = slave();
  Time at = run(encoder, us(0), 0xBA, 9);
  at = run(encoder, at - Time{1}, 0xBA, 9);
  EXPECT_EQ(encoder.statistics().resets_done, 0u);
  run(encoder, at, 0xBA, 1);
  EXPECT_EQ(encoder.statistics().resets_done, 1u);
}

TEST(Behaviour, AnotherCommandRestartsTheCount) {
  for (const Bytes& other : {Bytes{0x1A}, Bytes{0x62}, read_request(5), write_request(5, 5)}) {
    EncoderModel encoder = slave();
    Time at = run(encoder, us(0), 0xBA, 9);
    ask(encoder, at, other);
    at = run(encoder, at + us(100), 0xBA, 9);
    EXPECT_EQ(encoder.statistics().resets_done, 0u);
    run(encoder, at, 0xBA, 1);
    EXPECT_EQ(encoder.statistics().resets_done, 1u);
  }
}

TEST(Behaviour, AStaleSampleLatchesTheCountingErrorUntilId7) {
  EncoderModel encoder = slave(MotionProfile::constant(60.0));
  encoder.sample_stale(ms(500));
  EXPECT_EQ(alarms(encoder, ms(600)), (Alarms{0x10, 0x04}));
  EXPECT_EQ(encoder.last_latch().abs, 65536u);
  encoder.set_motion(MotionProfile::constant(120.0));
  run(encoder, ms(610), 0xBA, 10);
  EXPECT_EQ(alarms(encoder, ms(620)), (Alarms{0x10, 0x04}));  // its cause lasts
  encoder.sample_fresh();
  EXPECT_EQ(alarms(encoder, ms(630)), (Alarms{0x10, 0x04}));
  run(encoder, ms(640), 0xBA, 10);
  EXPECT_EQ(alarms(encoder, ms(760) - us(4)), (Alarms{0x00, 0x00}));
  EXPECT_EQ(encoder.last_latch().abs, 68157u);  // 1.52 turns: the shaft went on, at its new speed
}

TEST(Behaviour, ACountingErrorIsSf10AndAlmc04) {
  EncoderModel encoder = slave();
  encoder.latch_alarms(EncoderModel::sf_of(0x04), 0x04);
  EXPECT_EQ(alarms(encoder, us(0)), (Alarms{0x10, 0x04}));
}

TEST(Behaviour, AnOverspeedIsAlmc01WithSfZero) {
  EncoderModel encoder = slave();
  encoder.latch_alarms(EncoderModel::sf_of(0x01), 0x01);
  EXPECT_EQ(alarms(encoder, us(0)), (Alarms{0x00, 0x01}));
}

TEST(Behaviour, ATimeoutWhileBusyMustBeTolerated) {
  EncoderModel encoder = slave({}, {.deaf_while_busy = true});
  ask(encoder, ms(0), write_request(0x05, 0xA5));
  EXPECT_TRUE(ask(encoder, ms(5), {0x1A}).empty());
  EXPECT_EQ(ask(encoder, ms(10), read_request(0x05)), (Bytes{0xEA, 0x05, 0xA5, 0x4A}));
}

}  // namespace
}  // namespace tm485::sim
