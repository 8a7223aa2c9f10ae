// Reset runs.
#include <gtest/gtest.h>

#include "ask.hpp"

namespace tm485::sim {
namespace {

/// `count` times `cf`, `spacing` apart; returns the time one spacing after the last.
Time run(EncoderModel& encoder, Time start, std::uint8_t cf, int count, Time spacing = Time{62'500}) {
  for (int k = 0; k < count; ++k, start += spacing) EXPECT_EQ(ask(encoder, start, {cf}).size(), 6u);
  return start;
}

EncoderModel with_latched_alarm() {
  EncoderModel encoder{{.sf = 0x20, .almc = 0x40}, at_rest(777)};
  encoder.latch_alarms(0x10, 0x04);
  return encoder;
}

TEST(Resets, NineDoNothing) {
  EncoderModel encoder = with_latched_alarm();
  const Time after = run(encoder, Time{0}, 0xBA, 9);
  EXPECT_EQ(ask(encoder, after, {0x1A})[9], 0x44);
  EXPECT_EQ(encoder.statistics().resets_done, 0u);
}

TEST(Resets, TheTenthClearsLatchedErrorsAndLeavesLastingOnes) {
  EncoderModel encoder = with_latched_alarm();
  const Time after = run(encoder, Time{0}, 0xBA, 10);
  const Bytes reply = ask(encoder, after, {0x1A});
  EXPECT_EQ(reply[1], 0x20);
  EXPECT_EQ(reply[9], 0x40);
  EXPECT_EQ(encoder.statistics().resets_done, 1u);
}

TEST(Resets, AnEleventhDoesNotActAgain) {
  EncoderModel encoder = with_latched_alarm();
  run(encoder, Time{0}, 0xBA, 11);
  EXPECT_EQ(encoder.statistics().resets_done, 1u);
}

TEST(Resets, AnotherRequestInBetweenStartsTheRunAnew) {
  EncoderModel encoder = with_latched_alarm();
  Time at = run(encoder, Time{0}, 0xBA, 9);
  ask(encoder, at, {0x02});
  at = run(encoder, at + us(63), 0xBA, 9);
  EXPECT_EQ(encoder.statistics().resets_done, 0u);
  run(encoder, at, 0xBA, 1);
  EXPECT_EQ(encoder.statistics().resets_done, 1u);
}

TEST(Resets, ABadRequestInBetweenStartsTheRunAnew) {
  EncoderModel encoder = with_latched_alarm();
  const Time at = run(encoder, Time{0}, 0xBA, 9);
  ask(encoder, at, {0x82});
  run(encoder, at + us(63), 0xBA, 9);
  EXPECT_EQ(encoder.statistics().resets_done, 0u);
}

TEST(Resets, AnotherResetInBetweenStartsItsOwnRun) {
  EncoderModel encoder = with_latched_alarm();
  Time at = run(encoder, Time{0}, 0xBA, 9);
  at = run(encoder, at, 0x62, 1);
  run(encoder, at, 0xBA, 1);
  EXPECT_EQ(encoder.statistics().resets_done, 0u);
}

TEST(Resets, AShortIntervalStartsTheRunAnew) {
  EncoderModel encoder = with_latched_alarm();
  Time at = run(encoder, Time{0}, 0xBA, 5);
  at = run(encoder, at - Time{1}, 0xBA, 9);  // the first of these counts as one
  EXPECT_EQ(encoder.statistics().resets_done, 0u);
  run(encoder, at, 0xBA, 1);
  EXPECT_EQ(encoder.statistics().resets_done, 1u);
}

TEST(Resets, Id8MakesThePresentPositionZeroAfterItsSettleTime) {
  EncoderModel encoder{{}, at_rest(3 * 131072 + 777)};
  const Time after = run(encoder, Time{0}, 0xC2, 10);
  ask(encoder, after, {0x1A});
  EXPECT_EQ(encoder.last_latch().abs, 777u);
  ask(encoder, after + ms(100), {0x1A});
  EXPECT_EQ(encoder.last_latch().abs, 0u);
  EXPECT_EQ(encoder.last_latch().turns, 1);
}

TEST(Resets, IdcClearsErrorsAndSetsTheTurnCountBack) {
  EncoderModel encoder{{.battery = true}, at_rest(-7 * 131072 + 5)};
  encoder.latch_alarms(0x10, 0x04);
  const Time after = run(encoder, Time{0}, 0x62, 10);
  const Bytes reply = ask(encoder, after, {0x1A});
  EXPECT_EQ(reply[6], 0x01);
  EXPECT_EQ(reply[7], 0x00);
  EXPECT_EQ(reply[9], 0x00);
  EXPECT_EQ(encoder.last_latch().abs, 5u);
}

TEST(Resets, Id8WhileTheShaftMovesIsRefusedAndSetsTheCountingError) {
  for (const double rpm : {0.2, -0.2}) {  // twice the tolerance
    EncoderModel encoder{{}, MotionProfile::constant(rpm, 0.25)};
    const Time after = run(encoder, ms(10), 0xC2, 10);
    const Bytes reply = ask(encoder, after, {0x1A});
    EXPECT_EQ(reply[1], 0x10);
    EXPECT_EQ(reply[9], 0x04);
    EXPECT_EQ(encoder.statistics().resets_done, 0u);
    EXPECT_EQ(encoder.statistics().zero_refused, 1u);
    ask(encoder, after + ms(200), {0x1A});
    EXPECT_NEAR(encoder.last_latch().abs, 32768.0, 200.0);  // the zero stays where it was
  }
}

TEST(Resets, Id8TakesACreepingShaftForStandstill) {
  EncoderModel encoder{{}, MotionProfile::constant(-0.05)};
  run(encoder, ms(10), 0xC2, 10);
  EXPECT_EQ(encoder.statistics().resets_done, 1u);
}

TEST(Resets, TheStandstillOfId8CanBeSet) {
  EncoderModel encoder{{.standstill_rpm = 10.0}, MotionProfile::constant(9.0)};
  run(encoder, ms(10), 0xC2, 10);
  EXPECT_EQ(encoder.statistics().resets_done, 1u);
  encoder.set_motion(MotionProfile::constant(11.0));
  run(encoder, ms(20), 0xC2, 10);
  EXPECT_EQ(encoder.statistics().resets_done, 1u);
}

TEST(Resets, ThoseOfTheErrorsAndTheTurnsMayMove) {
  EncoderModel encoder{{}, MotionProfile::constant(3000.0)};
  run(encoder, run(encoder, ms(10), 0xBA, 10), 0x62, 10);
  EXPECT_EQ(encoder.statistics().resets_done, 2u);
}

TEST(Resets, ASupplyThatFailsDuringTheSettleTimeLeavesTheZero) {
  EncoderModel encoder{{}, at_rest(777)};
  const Time after = run(encoder, Time{0}, 0xC2, 10);
  encoder.power_off(after + ms(50));
  encoder.power_on(after + ms(60));
  ask(encoder, after + ms(200), {0x1A});
  EXPECT_EQ(encoder.last_latch().abs, 777u);
}

}  // namespace
}  // namespace tm485::sim
