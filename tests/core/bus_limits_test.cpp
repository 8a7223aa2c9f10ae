// The limits of what a bus does: implausible frames, long failures, abandoned exchanges, offers that find no gap,
// what start() refuses, and what is counted.
#include <gtest/gtest.h>

#include <string_view>
#include <type_traits>
#include <utility>

#include "support/bus_fixture.hpp"

namespace tm485 {
namespace {

using test::BusTest;
using test::Bytes;
using test::Driver;
using test::error_of;
using test::ms;
using test::ns;
using test::ScriptedPort;
using test::us;

// A bus keeps a reference to its profile: a temporary one must not compile.
static_assert(std::is_constructible_v<Bus<ScriptedPort>, ScriptedPort&, CompiledProfile&, BusConfig>);
static_assert(std::is_constructible_v<Bus<ScriptedPort>, ScriptedPort&, const CompiledProfile&, BusConfig>);
static_assert(!std::is_constructible_v<Bus<ScriptedPort>, ScriptedPort&, CompiledProfile, BusConfig>);
static_assert(!std::is_constructible_v<Bus<ScriptedPort>, ScriptedPort&, const CompiledProfile, BusConfig>);

class BusLimits : public BusTest {
 protected:
  /// Runs until a reply is on its way, after `request` if that is not 0.
  void run_until_reply_under_way(std::uint8_t request = 0) {
    ASSERT_TRUE(driver.run(*bus, port, driver.now + ms(5), [&] {
      return port.next_event(driver.now) != kNever && (request == 0 || port.sent.back().bytes[0] == request);
    }));
  }
  std::optional<Completion> run_until_completion(Time limit = ms(50)) {
    std::optional<Completion> completion;
    driver.run(*bus, port, driver.now + limit,
               [&] { return (completion = bus->take_completion()).has_value(); });
    return completion;
  }
  /// A new line and a new time, so that a test can begin again.
  void reset() {
    driver = Driver{};
    port.sent.clear();
    while (port.next_event(ns(-1)) != kNever) {
      std::uint8_t byte = 0;
      (void)port.try_receive({&byte, 1}, kNever);
    }
  }
};

// --- Frames that pass the CRC and are wrong ---

TEST_F(BusLimits, TwoFlipsInOneColumnAreHeldAndTheNextGoodFrameIsFresh) {
  begin_running();
  run_cycles(10);
  bool flip = true;
  hook = [&](const Bytes&, Time, ScriptedPort::Answer& answer) {
    if (!std::exchange(flip, false)) return;
    answer.bytes[3] ^= 0x80;  // ABS1
    answer.bytes[7] ^= 0x80;  // ABM1: the same column of the CRC
  };
  run_cycles(1);
  EXPECT_EQ(bus->last_record().result, Errc::position_implausible);
  EXPECT_EQ(errors(Errc::position_implausible), 1U);
  EXPECT_EQ(bus->latest().quality(), Quality::held);
  EXPECT_EQ(bus->latest().position(), 1'000);
  EXPECT_EQ(bus->latest().turns(), 1) << "nothing of the frame was taken over";
  run_cycles(1);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_EQ(bus->latest().position(), 1'000);
  EXPECT_EQ(bus->state(), BusState::running);
  EXPECT_EQ(bus->statistics().failed, 1U);
}

TEST_F(BusLimits, AJumpThatLastsIsFollowedAndIsADiscontinuity) {
  begin_running();
  run_cycles(10);
  bus->set_referenced(true);
  encoder.abm = 41;
  for (int k = 0; k < PlausibilityGate::kAgree - 1; ++k) {
    run_cycles(1);
    ASSERT_EQ(bus->latest().quality(), Quality::held) << k;
    ASSERT_EQ(bus->latest().position(), 1'000) << k;
    ASSERT_EQ(bus->last_record().result, Errc::position_implausible);
  }
  run_cycles(1);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_EQ(bus->latest().position(), 40 * 131'072 + 1'000);
  EXPECT_EQ(bus->latest().discontinuities(), 1U);
  EXPECT_FALSE(bus->latest().referenced()) << "nobody knows what has happened";
  EXPECT_EQ(bus->statistics().discontinuities, 1U);
  EXPECT_EQ(bus->statistics().failed, PlausibilityGate::kAgree - 1U);
  EXPECT_EQ(bus->state(), BusState::running);
  run_cycles(1);
  EXPECT_EQ(bus->latest().discontinuities(), 1U) << "once";
}

// --- Failures, restarts, what is abandoned ---

TEST_F(BusLimits, AGoodFrameAfterFailuresAsLongAsARestartIsAStartUp) {
  config.cycle = Cycle{DataId::everything, ms(30)};
  config.lost_after = ms(500);
  begin_running();
  run_cycles(3);
  dead_from = driver.now;
  run_cycles(1);
  ASSERT_EQ(bus->state(), BusState::running) << "30 ms: no encoder restarts so fast";
  dead_from = kNever;
  ASSERT_TRUE(driver.run(*bus, port, driver.now + ms(40), [&] {
    EXPECT_NE(bus->latest().quality(), Quality::fresh) << "it may have begun to count anew";
    return bus->state() == BusState::startup || HasFailure();
  }));
  const Statistics& s = bus->statistics();
  EXPECT_EQ(s.lost, 1U);
  EXPECT_EQ(s.good + s.failed, s.cycles) << "a cycle is either";
  EXPECT_EQ(bus->latest().quality(), Quality::invalid);
  ASSERT_TRUE(run_until_running());
  run_cycles(1);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
}

TEST_F(BusLimits, AShorterFailureIsNotALoss) {
  config.cycle = Cycle{DataId::everything, ms(20)};
  config.lost_after = ms(500);
  begin_running();
  run_cycles(3);
  dead_from = driver.now;
  run_cycles(1);
  dead_from = kNever;
  run_cycles(1);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_EQ(bus->statistics().lost, 0U);
}

TEST_F(BusLimits, NothingFreshComesFromAReplyThatWasAbandoned) {
  for (const char* event : {"start", "stop and start", "stop, late start", "on_restart"}) {
    for (const Time late : {us(0), us(200)}) {
      reset();
      if (late != us(0)) port.be_slow(us(250));
      encoder.abs = 1'000;
      hook = [&](const Bytes&, Time, ScriptedPort::Answer& answer) { answer.late = late; };
      begin_running();
      run_cycles(5);
      run_until_reply_under_way(0x1A);
      encoder.abs = 2'000;  // what is under way says 1000
      const std::string_view what = event;
      if (what == "on_restart") {
        bus->on_restart(driver.now);
      } else if (what == "start") {
        start();
      } else {
        bus->stop();
        EXPECT_EQ(bus->poll(driver.now), kNever);
        if (what == "stop, late start") {
          run(ms(1));
          EXPECT_EQ(bus->latest().quality(), Quality::invalid);
        }
        start();
      }
      EXPECT_EQ(bus->latest().quality(), Quality::invalid) << event;
      const std::uint32_t good = bus->statistics().good;
      driver.run(*bus, port, driver.now + ms(10), [&] {
        if (bus->state() == BusState::startup) {
          EXPECT_NE(bus->latest().quality(), Quality::fresh) << event;
        }
        if (bus->latest().quality() == Quality::fresh) {
          EXPECT_EQ(bus->latest().position(), 2'000) << event;
        }
        return HasFailure();
      });
      EXPECT_EQ(bus->state(), BusState::running);
      EXPECT_GT(bus->statistics().good, good);
      EXPECT_EQ(bus->statistics().startup_failures, 0U);
      expect_t1_kept();
    }
  }
}

TEST_F(BusLimits, ALongPeriodDoesNotMakeSamplesInvalidBetweenCycles) {
  config.cycle = Cycle{DataId::everything, ms(500)};
  config.max_hold = ms(2);
  begin_running();
  run_cycles(1);
  driver.run(*bus, port, driver.now + ms(5'000), [&] {
    EXPECT_EQ(bus->latest().quality(), Quality::fresh);
    return HasFailure();
  });
  EXPECT_EQ(bus->statistics().good, 11U);
  EXPECT_EQ(bus->statistics().invalidated, 0U);
}

// --- The line before the first request ---

TEST_F(BusLimits, AnotherUsersId3IsFollowedByItsT1) {
  make();
  start();  // the other's start bit has just been sent, and its encoder does not answer
  ASSERT_TRUE(run_until_running());
  EXPECT_GE(port.sent[0].start, ns(62'500));
  reset();
  make();
  start();
  port.inject(us(7), test::id3_reply(5, 1));  // this one answers
  ASSERT_TRUE(run_until_running());
  EXPECT_GE(port.sent[0].start, us(7 + 44) + ns(62'500));
  EXPECT_EQ(bus->statistics().stray_bytes, 11U);
}

// --- Offers ---

TEST_F(BusLimits, AnOfferThatLateStartsKeepOutEndsInNoGap) {
  config.cycle = Cycle{DataId::everything, us(250)};
  Time late = us(150);
  port.lateness = [&] { return late; };
  begin_running();
  run_cycles(3);
  std::optional<Completion> completion;
  for (int i = 0; i < 2; ++i) {  // the count begins anew with each
    ASSERT_TRUE(bus->offer(*Request::eeprom_read(1)));
    const std::uint32_t before = bus->statistics().cycles;
    completion = run_until_completion(ms(200));
    ASSERT_TRUE(completion);
    EXPECT_EQ(error_of(completion->result), Errc::no_gap);
    EXPECT_GE(bus->statistics().cycles - before, 62U);
    EXPECT_LE(bus->statistics().cycles - before, 65U);
  }
  EXPECT_EQ(bus->statistics().background, 0U) << "it was never sent";
  late = us(0);
  run_cycles(3);
  ASSERT_TRUE(bus->offer(*Request::eeprom_read(1)));
  completion = run_until_completion();
  ASSERT_TRUE(completion);
  EXPECT_TRUE(completion->result);
}

TEST_F(BusLimits, AnOfferEndsWithTheStateThatItNeeded) {
  config.cycle = Cycle{DataId::everything, us(250)};
  for (const bool stop : {true, false}) {
    for (const bool sent : {true, false}) {
      reset();
      begin_running();
      run_cycles(3);
      ASSERT_TRUE(bus->offer(*Request::eeprom_read(1)));
      if (sent) run_until_reply_under_way(0xEA);
      EXPECT_FALSE(bus->take_completion());
      if (stop) {
        bus->stop();
      } else {
        bus->on_restart(driver.now);
      }
      auto completion = bus->take_completion();
      ASSERT_TRUE(completion) << stop << sent;
      EXPECT_EQ(error_of(completion->result), sent ? Errc::abandoned : Errc::bad_state) << stop << sent;
      EXPECT_EQ(completion->request.address(), 1);
      EXPECT_FALSE(bus->take_completion()) << "once";
      EXPECT_EQ(error_of(bus->offer(*Request::eeprom_read(1))), Errc::bad_state);
      if (stop) start();
      ASSERT_TRUE(run_until_running());
      EXPECT_FALSE(bus->take_completion()) << "its reply completes nothing";
      ASSERT_TRUE(bus->offer(*Request::eeprom_read(2)));
      completion = run_until_completion();
      ASSERT_TRUE(completion);
      EXPECT_TRUE(completion->result);
      expect_t1_kept();
    }
  }
}

TEST_F(BusLimits, ALossWhileACycleWaitsLeavesAnUnsentOfferUnsent) {
  config.cycle = Cycle{DataId::everything, us(150)};
  config.lost_after = us(500);
  port.lateness = [] { return us(60); };  // no room behind a late start
  begin_running();
  run_cycles(3);
  hook = [](const Bytes&, Time, ScriptedPort::Answer& answer) { answer.bytes.clear(); };
  ASSERT_TRUE(bus->offer(*Request::eeprom_read(1)));
  const auto completion = run_until_completion(ms(5));
  ASSERT_TRUE(completion);
  EXPECT_EQ(error_of(completion->result), Errc::bad_state);
  EXPECT_EQ(bus->statistics().lost, 1U);
}

// --- What start() refuses ---

TEST_F(BusLimits, APeriodThatSingleTurnDataCannotCrossIsRefusedWithTheNearest) {
  const struct {
    const char* profile;
    DataId id;
    bool refused;
  } kCases[] = {{"tm485_17", DataId::single_turn, true},    {"tm485_17_st", DataId::single_turn, true},
                {"tm485_17_st", DataId::everything, true},  {"tm485_17", DataId::everything, false},
                {"tm485_17_st", DataId::encoder_id, false}, {"tm485_17", DataId::multi_turn, false}};
  for (const auto& c : kCases) {
    reset();
    encoder.enid = std::string_view(c.profile) == "tm485_17" ? 0x11 : 0x00;
    config.cycle = Cycle{c.id, ms(5)};  // half a turn at 6000 rpm
    make(c.profile);
    const auto result = bus->start(driver.now);
    ASSERT_EQ(!result, c.refused) << c.profile << " ID" << number(c.id);
    if (!c.refused) continue;
    EXPECT_EQ(result.error().code, Errc::position_lost);
    EXPECT_EQ(bus->state(), BusState::stopped);
    EXPECT_GT(result.error().nearest, ms(4));
    config.cycle = Cycle{c.id, result.error().nearest};
    make(c.profile);
    start();
    ASSERT_TRUE(run_until_running());
    run_cycles(20);
    EXPECT_EQ(bus->statistics().good, 20U) << "the nearest works";
    EXPECT_EQ(bus->statistics().lost, 0U);
  }
}

TEST_F(BusLimits, WhereThePortIsTooSlowForItNoPeriodIsTheNearest) {
  config.cycle = Cycle{DataId::single_turn, ms(8)};
  port.capability_.shortest_exchange = ms(6);
  make();
  const auto result = bus->start(driver.now);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::position_lost);
  EXPECT_EQ(result.error().nearest, Time{0});
}

TEST_F(BusLimits, APeriodOfMoreThanAnHourIsRefusedWithTheNearest) {
  config.cycle = Cycle{DataId::encoder_id, std::chrono::hours(1) + ns(1)};
  make();
  const auto result = bus->start(driver.now);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::bad_argument);
  EXPECT_EQ(result.error().nearest, std::chrono::hours(1));
  config.cycle = Cycle{DataId::encoder_id, std::chrono::hours(1)};
  make();
  EXPECT_TRUE(bus->start(driver.now));
}

}  // namespace
}  // namespace tm485
