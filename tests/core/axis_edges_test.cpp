// Axis and bus where things come together: an owner that calls late, several things due at once, long exchanges.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "support/bus_fixture.hpp"
#include "tm485/bus/axis.hpp"

namespace tm485 {
namespace {

using test::BusTest;
using test::Bytes;
using test::error_of;
using test::ms;
using test::ns;
using test::ScriptedPort;
using test::us;

class AxisEdges : public testing::Test {
 protected:
  AxisEdges() {
    setup.bus.cycle = Cycle{DataId::everything, us(110)};
    setup.bus.max_hold = ms(1);
    setup.on_invalid = {[](void* count, Time) { ++*static_cast<int*>(count); }, &torque_offs};
    port.answer = [this](const Bytes& request, Time) {
      ScriptedPort::Answer answer;
      if (alive) answer.bytes = encoder.reply(request);
      return answer;
    };
  }
  void make() {
    profile = std::make_unique<CompiledProfile>(test::compiled("tm485_17"));
    axis = std::make_unique<Axis<ScriptedPort>>(port, *profile, setup);
    ASSERT_TRUE(axis->start(driver.now));
  }
  void begin_running() {
    make();
    ASSERT_TRUE(driver.run(*axis, port, driver.now + ms(3'000), [&] { return read().usable(); }));
  }
  void run(Time span) { driver.run(*axis, port, driver.now + span); }
  LoopState read() { return axis->client().read(driver.now); }
  void run_until_in_flight() {
    ASSERT_TRUE(
        driver.run(*axis, port, driver.now + ms(1), [&] { return axis->reply_expected() != kNever; }));
  }

  test::PlainEncoder encoder;
  bool alive = true;
  int torque_offs = 0;
  ScriptedPort port;
  test::Driver driver;
  AxisSetup setup;
  std::unique_ptr<CompiledProfile> profile;
  std::unique_ptr<Axis<ScriptedPort>> axis;
};

TEST_F(AxisEdges, AStallWithAnExchangeUnderWayIsALossAndRaisedOnce) {
  begin_running();
  run_until_in_flight();
  driver.now += ms(10);
  run(ms(5));
  (void)read();
  EXPECT_EQ(axis->bus().statistics().invalidated, 1U);
  EXPECT_EQ(torque_offs, 1);
  EXPECT_TRUE(axis->client().view().latched);
}

TEST_F(AxisEdges, AReplyThatWaitedTenMillisecondsIsNotFresh) {
  begin_running();
  run_until_in_flight();
  driver.now += ms(10);
  for (int i = 0; i < 5; ++i) {
    axis->poll(driver.now);
    const Sample& sample = axis->bus().latest();
    EXPECT_TRUE(sample.quality() != Quality::fresh || sample.age(driver.now) < ms(2));
  }
}

TEST_F(AxisEdges, OnASlowPortASilentBusIsOverdueAtOnceAndNotAfterTheAllowance) {
  port.be_slow(ms(20));
  setup.bus.cycle = Cycle{DataId::everything, us(500)};
  begin_running();
  run(ms(5));
  run_until_in_flight();
  driver.now += ms(1);
  EXPECT_NE(read().validity, SampleValidity::fresh);
  driver.now += ms(1);
  EXPECT_EQ(read().validity, SampleValidity::invalid);
}

TEST_F(AxisEdges, ARestartCommandIsDueAtOnce) {
  setup.bus.cycle = std::nullopt;
  make();
  ASSERT_TRUE(driver.run(*axis, port, driver.now + ms(3'000),
                         [&] { return axis->bus().state() == BusState::running; }));
  ASSERT_TRUE(axis->client().post(Command::of(Command::Kind::restart)));
  EXPECT_LE(axis->poll(driver.now), driver.now);
  EXPECT_EQ(axis->bus().state(), BusState::startup);
}

TEST_F(AxisEdges, RepliesWithoutAPositionNeitherAgeTheSampleNorHinderResume) {
  setup.bus.cycle = Pattern(us(70), {{DataId::everything, 1}, {DataId::encoder_id, 9}});
  setup.bus.max_hold = ms(2);
  begin_running();
  for (int i = 0; i < 1'000; ++i) {
    run(us(7));
    ASSERT_EQ(read().validity, SampleValidity::fresh);
  }
  alive = false;
  run(ms(10));
  alive = true;
  run(ms(200));
  EXPECT_FALSE(read().usable());
  ASSERT_TRUE(axis->client().post(Command::of(Command::Kind::resume)));
  run(us(150));
  const auto result = axis->client().poll_completion();
  ASSERT_TRUE(result);
  EXPECT_EQ(result->error, Errc::ok);
}

TEST_F(AxisEdges, ReferencedDuringStartUpIsRefusedAndNotForgotten) {
  make();
  ASSERT_TRUE(axis->client().post(Command::of(Command::Kind::set_referenced)));
  axis->poll(driver.now);
  EXPECT_EQ(axis->client().poll_completion()->error, Errc::bad_state);
}

TEST_F(AxisEdges, ASampleThatIsSeenWhenTheNextSlotIsStolenIsNotPassedOver) {
  setup.bus.cycle = Cycle{};
  setup.bus.steal_every = 2;
  begin_running();
  run(ms(2));
  for (int i = 0; i < 1'000; ++i) {
    if (i % 6 == 0) (void)axis->client().post(Command::exchange(*Request::make(DataId::encoder_id)));
    driver.now += ns(62'600);
    const std::uint32_t good = axis->bus().statistics().good;
    const Time before = axis->client().view().fresh_until;
    axis->poll(driver.now);
    (void)read();
    ASSERT_TRUE(axis->bus().statistics().good == good || axis->client().view().fresh_until != before);
    while (axis->client().poll_completion()) {
    }
  }
}

TEST_F(AxisEdges, ResetsThroughTheRingStayTogetherWhenTheOwnerCallsLate) {
  begin_running();
  run(ms(2));
  port.sent.clear();
  for (int i = 0; i < 8; ++i)
    ASSERT_TRUE(axis->client().post(Command::exchange(*Request::make(DataId::reset_errors))));
  for (int i = 0; i < 60; ++i) {
    driver.now += us(70);
    axis->poll(driver.now);
  }
  std::string order;
  for (const auto& sent : port.sent) order += sent.bytes[0] == 0xBA ? 'R' : '3';
  EXPECT_NE(order.find("RRRRRRRR"), std::string::npos) << order;
}

TEST_F(AxisEdges, ResetsDoNotStarveTheCycle) {
  begin_running();
  const std::uint32_t before = axis->bus().statistics().cycles;
  const Time end = driver.now + ms(50);
  driver.run(*axis, port, end, [&] {
    while (axis->client().poll_completion()) {
    }
    while (axis->client().post(Command::exchange(*Request::make(DataId::reset_errors)))) {
    }
    return false;
  });
  EXPECT_GT(axis->bus().statistics().cycles - before, 50U) << "one in eleven";
}

TEST_F(AxisEdges, TicksDuringStartUpLetThePatternBeginInPhase) {
  setup.bus.cycle = Cycle{DataId::everything, ms(4)};
  setup.bus.phase = Phase::locked_to({ms(4), us(60)});
  setup.bus.max_hold = ms(2);
  make();
  Time tick = us(100);
  for (int i = 0; i < 200; ++i) {
    driver.run(*axis, port, tick);
    driver.now = tick;
    axis->client().servo_tick(tick);
    (void)read();
    axis->poll(tick);
    tick += ms(4);
  }
  EXPECT_EQ(torque_offs, 0);
  EXPECT_EQ(axis->bus().statistics().servo_locks, 1U);
}

// --- Buses alone ---

TEST_F(BusTest, AStealBehindAWideMarginStillPaysForItself) {
  port.capability_.jitter_margin = us(60);
  config.cycle = Cycle{DataId::everything, us(130)};
  config.steal_every = 16;
  begin_running();
  run_cycles(10);
  const std::uint32_t cycles = bus->statistics().cycles;
  const std::uint32_t background = bus->statistics().background;
  driver.run(*bus, port, driver.now + ms(10), [&] {
    while (bus->take_completion()) {
    }
    (void)bus->offer(*Request::eeprom_read(3));
    return false;
  });
  EXPECT_LE((bus->statistics().background - background) * 15, bus->statistics().cycles - cycles + 16);
}

TEST_F(BusTest, AWriteOnAFreeGridPaysForTheSlotsThatItTakes) {
  config.cycle = Cycle{};
  config.steal_every = 4;
  config.max_hold = ms(12);
  begin_running();
  run_cycles(10);
  const std::uint32_t cycles = bus->statistics().cycles;
  driver.run(*bus, port, driver.now + ms(500), [&] {
    while (bus->take_completion()) {
    }
    (void)bus->offer(*Request::eeprom_write(3, 4));
    return false;
  });
  EXPECT_GE(bus->statistics().cycles - cycles, 5'600U)
      << "of 8000 slots three in four, but for the last write";
}

TEST_F(BusTest, AnExchangeDuringWhichThePositionCouldBeLostIsRefused) {
  config.cycle = Cycle{DataId::single_turn, Time{0}};
  config.steal_every = 4;
  config.max_hold = ms(12);
  begin_running();
  EXPECT_EQ(error_of(bus->offer(*Request::eeprom_write(3, 4))), Errc::no_gap) << "half a turn in 5 ms";
  EXPECT_TRUE(bus->offer(*Request::eeprom_read(3)));
}

TEST_F(BusTest, WhatFollowsALongStealWaitsForItsTurnAndNotInVain) {
  config.cycle = Cycle{};
  config.steal_every = 4;
  config.max_hold = ms(12);
  begin_running();
  run_cycles(600);
  for (int i = 0; i < 4; ++i) {
    ASSERT_TRUE(bus->offer(*Request::eeprom_write(3, 4)));
    std::optional<Completion> completion;
    driver.run(*bus, port, driver.now + ms(300),
               [&] { return (completion = bus->take_completion()).has_value(); });
    ASSERT_TRUE(completion);
    EXPECT_TRUE(completion->result);
  }
  EXPECT_EQ(bus->statistics().starved, 0U);
}

TEST_F(BusTest, AdmissionLeavesRoomForALateStart) {
  port.capability_.jitter_margin = us(2);
  config.cycle = Cycle{DataId::everything, ns(104'500)};
  begin_running();
  EXPECT_EQ(error_of(bus->offer(*Request::eeprom_read(1))), Errc::no_gap) << "62.5 + 40 + twice 2 us";
  config.cycle = Cycle{DataId::everything, ns(106'500)};
  driver = test::Driver{};
  begin_running();
  EXPECT_TRUE(bus->offer(*Request::eeprom_read(1)));
}

TEST_F(BusTest, WithoutTicksTheLockSaysSo) {
  config.cycle = Cycle{DataId::everything, us(100)};
  config.phase = Phase::locked_to({us(100), us(60)});
  begin_running();
  Time tick = driver.now + us(30);
  for (int i = 0; i < 500; ++i) {
    driver.run(*bus, port, tick);
    driver.now = tick;
    bus->on_servo_tick(tick);
    tick += us(100);
  }
  EXPECT_EQ(bus->scheduler()->servo_lock()->state(), ServoLock::State::locked);
  run(ms(10));
  EXPECT_EQ(bus->scheduler()->servo_lock()->state(), ServoLock::State::waiting);
}

TEST_F(BusTest, T1OfAWriteHoldsBehindARestartOnAPortThatOnlyEstimates) {
  for (const bool arrived : {false, true}) {
    for (const bool stopped : {false, true}) {
      config.cycle = std::nullopt;
      driver = test::Driver{};
      port.sent.clear();
      port.lateness = [] { return us(0); };
      port.be_slow(ms(1));
      begin_running();
      port.lateness = [] { return us(800); };
      ASSERT_TRUE(bus->offer(*Request::eeprom_write(3, 4)));
      ASSERT_TRUE(
          driver.run(*bus, port, driver.now + ms(50), [&] { return port.sent.back().bytes[0] == 0x32; }));
      if (arrived) {
        driver.now += us(900);
        bus->poll(driver.now);
      }
      port.lateness = [] { return us(0); };
      if (stopped) {
        bus->stop();
        ASSERT_TRUE(bus->start(driver.now));
      } else {
        bus->on_restart(driver.now);
      }
      run(ms(30));
      const auto write =
          std::find_if(port.sent.begin(), port.sent.end(), [](const auto& s) { return s.bytes[0] == 0x32; });
      ASSERT_NE(write, port.sent.end());
      ASSERT_NE(write + 1, port.sent.end());
      EXPECT_GE((write + 1)->start - write->start, ms(10));
      (void)bus->take_completion();
    }
  }
}

TEST_F(AxisEdges, InvalidFromTheInstantThatIsStatedOn) {
  begin_running();
  (void)read();
  const Time until = axis->client().view().valid_until;
  EXPECT_TRUE(axis->client().read(until - ns(1)).usable());
  EXPECT_FALSE(axis->client().read(until).usable());
}

TEST_F(AxisEdges, WithoutNewsNothingIsPublishedAnew) {
  begin_running();
  ASSERT_TRUE(driver.run(*axis, port, driver.now + ms(1),
                         [&] { return axis->reply_expected() == kNever && read().usable(); }));
  const Sample* const newest = &axis->client().latest();
  for (int i = 0; i < 5; ++i) {
    axis->poll(driver.now);
    EXPECT_EQ(&axis->client().latest(), newest) << "the same place, for the same sample";
  }
}

// The command and the sample that makes it possible meet in one poll.
TEST_F(AxisEdges, AResumeLooksAtTheSampleOfItsOwnPoll) {
  begin_running();
  alive = false;
  run(ms(3));
  ASSERT_EQ(axis->client().read(driver.now).sample->quality(), Quality::invalid);
  alive = true;
  Errc error = Errc::bad_state;
  for (int polls = 0; polls < 500 && error != Errc::ok; ++polls) {
    ASSERT_TRUE(axis->client().post(Command::of(Command::Kind::resume)));
    (void)axis->poll(driver.now);
    error = axis->client().poll_completion()->error;
    const bool fresh = axis->bus().latest().quality() == Quality::fresh;
    ASSERT_EQ(error, fresh ? Errc::ok : Errc::bad_state) << polls;
    driver.now += us(1);
  }
  EXPECT_EQ(error, Errc::ok);
  EXPECT_TRUE(read().usable());
}

}  // namespace
}  // namespace tm485
