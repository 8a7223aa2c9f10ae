// Bus on a scripted port: cyclic reads, bad replies, loss and recovery, restart, stop.
#include "tm485/bus/bus.hpp"

#include <gtest/gtest.h>

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

TEST_F(BusTest, RunsAtT1AndTheCountersAddUp) {
  begin_running();
  const std::size_t before = port.sent.size();
  run_cycles(1'000);
  const Statistics& s = bus->statistics();
  EXPECT_EQ(s.cycles, 1'000U);
  EXPECT_EQ(s.good, 1'000U);
  EXPECT_EQ(s.failed + s.slips + s.skipped + s.stray_bytes, 0U);
  for (std::size_t i = before + 1; i < port.sent.size(); ++i)
    ASSERT_EQ(port.sent[i].start - port.sent[i - 1].start, ns(62'500));
  EXPECT_EQ(s.t1.minimum(), ns(62'500));
  EXPECT_EQ(s.t1.maximum(), ns(62'500));
  EXPECT_EQ(s.reply_delay.minimum(), us(3));
  EXPECT_EQ(s.reply_delay.maximum(), us(3));
  const CycleRecord& record = bus->last_record();
  EXPECT_EQ(record.kind, CycleRecord::Kind::cyclic);
  EXPECT_EQ(record.result, Errc::ok);
  EXPECT_EQ(record.start, record.slot);
  EXPECT_TRUE(record.has_reply_delay);
  expect_t1_kept();
}

TEST_F(BusTest, EveryCyclicIdIsRead) {
  const struct {
    DataId id;
    std::uint8_t cf;
    bool position;
  } kCases[] = {{DataId::single_turn, 0x02, true},
                {DataId::multi_turn, 0x8A, false},
                {DataId::encoder_id, 0x92, false},
                {DataId::everything, 0x1A, true}};
  for (const auto& c : kCases) {
    config.cycle = Cycle{c.id, ns(0)};
    driver = Driver{};
    port.sent.clear();
    begin_running();
    run_cycles(50);
    EXPECT_EQ(bus->statistics().good, 50U) << number(c.id);
    EXPECT_EQ(port.sent.back().bytes, Bytes{c.cf});
    EXPECT_EQ(bus->latest().id(), c.id);
    EXPECT_EQ(bus->latest().has_position(), c.position);
    expect_t1_kept();
  }
}

TEST_F(BusTest, TheLatchTimeIsTheEndOfTheRequestPlusTheOffset) {
  Profile p = test::preset("tm485_17");
  p.latch_offset = ns(500);
  make(p);
  start();
  ASSERT_TRUE(run_until_running());
  run_cycles(3);
  EXPECT_EQ(bus->latest().latch_time(), bus->last_record().start + us(4) + ns(500));
}

TEST_F(BusTest, OneBadReplyIsHeldCountedAndForgotten) {
  begin_running();
  run_cycles(10);
  const Time good_latch = bus->latest().latch_time();
  hook = [](const Bytes&, Time, ScriptedPort::Answer& answer) { answer.bytes[3] ^= 1; };
  run_cycles(1);
  EXPECT_EQ(bus->latest().quality(), Quality::held);
  EXPECT_EQ(bus->latest().position(), 1'000);
  EXPECT_EQ(bus->latest().latch_time(), good_latch);
  EXPECT_EQ(bus->last_record().result, Errc::crc_error);
  EXPECT_EQ(errors(Errc::crc_error), 1U);
  hook = nullptr;
  run_cycles(1);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_EQ(bus->statistics().failed, 1U);
  EXPECT_EQ(bus->statistics().lost, 0U);
  EXPECT_EQ(bus->statistics().cycles, bus->statistics().good + bus->statistics().failed);
}

struct ReplyFault {
  const char* name;
  Errc cause;
  void (*edit)(ScriptedPort::Answer&);
};
class BusReplyFault : public BusTest, public testing::WithParamInterface<ReplyFault> {};

TEST_P(BusReplyFault, IsNamedAndNeverASample) {
  begin_running();
  run_cycles(3);
  bool once = false;
  hook = [&](const Bytes&, Time, ScriptedPort::Answer& answer) {
    if (!once) GetParam().edit(answer);
    once = true;
  };
  run_cycles(1);
  EXPECT_EQ(bus->last_record().result, GetParam().cause);
  EXPECT_EQ(errors(GetParam().cause), 1U);
  EXPECT_EQ(bus->latest().quality(), Quality::held);
  EXPECT_EQ(bus->latest().position(), 1'000);
  run_cycles(5);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_EQ(bus->state(), BusState::running);
  EXPECT_EQ(bus->statistics().lost, 0U);
}
INSTANTIATE_TEST_SUITE_P(
    Each, BusReplyFault,
    testing::Values(
        ReplyFault{"Silence", Errc::timeout, [](ScriptedPort::Answer& a) { a.bytes.clear(); }},
        ReplyFault{"Cut", Errc::incomplete_reply, [](ScriptedPort::Answer& a) { a.bytes.resize(7); }},
        ReplyFault{"Crc", Errc::crc_error, [](ScriptedPort::Answer& a) { a.bytes.back() ^= 0x80; }},
        ReplyFault{"AllZero", Errc::cf_sync_error, [](ScriptedPort::Answer& a) { a.bytes.assign(11, 0); }},
        ReplyFault{"AllOnes", Errc::cf_sync_error, [](ScriptedPort::Answer& a) { a.bytes.assign(11, 0xFF); }},
        ReplyFault{"CfParity", Errc::cf_parity_error, [](ScriptedPort::Answer& a) { a.bytes[0] = 0x9A; }},
        ReplyFault{"UnknownId", Errc::unknown_id, [](ScriptedPort::Answer& a) { a.bytes[0] = 0xA2; }},
        ReplyFault{"OtherId", Errc::cf_mismatch, [](ScriptedPort::Answer& a) { a.bytes[0] = 0x02; }},
        ReplyFault{"AbsRange", Errc::abs_out_of_range,
                   [](ScriptedPort::Answer& a) { a.bytes = test::id3_reply(0x20000, 1); }},
        ReplyFault{"Abm", Errc::abm_reserved_bits,
                   [](ScriptedPort::Answer& a) { a.bytes = test::id3_reply(0, 0x20000); }},
        ReplyFault{"Enid", Errc::enid_unexpected,
                   [](ScriptedPort::Answer& a) { a.bytes = test::id3_reply(0, 1, 0x12); }},
        ReplyFault{"TooEarly", Errc::t2_out_of_window, [](ScriptedPort::Answer& a) { a.t2 = ns(1'999); }},
        ReplyFault{"TooLate", Errc::t2_out_of_window, [](ScriptedPort::Answer& a) { a.t2 = ns(6'001); }},
        ReplyFault{"Framing", Errc::framing_error,
                   [](ScriptedPort::Answer& a) { a.fault = Errc::framing_error; }},
        ReplyFault{"Overrun", Errc::overrun, [](ScriptedPort::Answer& a) { a.fault = Errc::overrun; }}),
    [](const auto& row) { return std::string(row.param.name); });

TEST_F(BusTest, AByteTooManyFailsTheNextCycleWhenItComesAfterTheVerdict) {
  begin_running();
  bool once = false;
  hook = [&](const Bytes&, Time, ScriptedPort::Answer& answer) {
    if (!once) answer.bytes.push_back(0x00);
    once = true;
  };
  run_cycles(4);
  EXPECT_EQ(bus->statistics().failed, 1U);
  EXPECT_EQ(errors(Errc::line_not_quiet), 1U);
  EXPECT_EQ(bus->statistics().stray_bytes, 1U);
}

TEST_F(BusTest, AByteTooManyInOnePieceIsOverlong) {
  port.capability_.wire_timestamps = false;
  port.capability_.latency_allowance = us(200);
  port.capability_.shortest_exchange = us(400);
  begin_running();
  bool once = false;
  hook = [&](const Bytes&, Time, ScriptedPort::Answer& answer) {
    if (!once) answer.bytes.push_back(0x00);
    once = true;
  };
  // The host comes late and finds everything at once.
  const std::uint32_t before = bus->statistics().cycles;
  while (bus->statistics().cycles < before + 3) {
    const Time due = bus->poll(driver.now);
    driver.now = std::max(due, driver.now + us(60));
  }
  EXPECT_EQ(errors(Errc::overlong_reply), 1U);
}

TEST_F(BusTest, LostAfterATimeOfFailuresThenRecovers) {
  config.lost_after = us(500);
  begin_running();
  run_cycles(20);
  const Time last_good = bus->last_record().seen;
  hook = [](const Bytes&, Time, ScriptedPort::Answer& answer) { answer.bytes.clear(); };
  run_cycles(3);
  EXPECT_EQ(bus->state(), BusState::running);
  EXPECT_EQ(bus->latest().quality(), Quality::held);
  ASSERT_TRUE(driver.run(*bus, port, driver.now + ms(5), [&] { return bus->state() == BusState::startup; }));
  EXPECT_GE(bus->last_record().seen - last_good, us(500));
  EXPECT_LT(bus->last_record().seen - last_good, us(500) + ns(62'500));
  EXPECT_EQ(bus->latest().quality(), Quality::invalid);
  EXPECT_EQ(bus->statistics().lost, 1U);
  run(ms(20));
  EXPECT_EQ(bus->latest().quality(), Quality::invalid) << "nothing is fresh before start-up is through";
  hook = nullptr;
  encoder.abs = 77;
  ASSERT_TRUE(run_until_running());
  run_cycles(1);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_EQ(bus->latest().position(), 77);
  EXPECT_EQ(bus->statistics().startups, 2U);
  expect_t1_kept();
}

TEST_F(BusTest, ByDefaultLostAfterHalfTheShortestBootTime) {
  begin_running();
  run_cycles(1);
  const Time last_good = bus->last_record().seen;
  dead_from = ns(0);
  ASSERT_TRUE(
      driver.run(*bus, port, driver.now + ms(100), [&] { return bus->state() == BusState::startup; }));
  EXPECT_GE(driver.now - last_good, profile->profile().boot_time_min / 2);
  EXPECT_LT(driver.now - last_good, profile->profile().boot_time_min / 2 + us(100));
}

TEST_F(BusTest, NeverLostAfterFewerThanThreeFailuresWithinABootTime) {
  config.cycle = Cycle{DataId::everything, ms(10)};
  config.lost_after = ns(1);
  begin_running();
  run_cycles(2);
  dead_from = ns(0);
  run_cycles(2);
  EXPECT_EQ(bus->state(), BusState::running);
  run_cycles(1);
  EXPECT_EQ(bus->state(), BusState::startup);
}

TEST_F(BusTest, ASilenceInWhichTheEncoderCanHaveRestartedIsALossWhateverWasConfigured) {
  config.lost_after = ms(500);
  begin_running();
  run_cycles(1);
  const Time last_good = bus->last_record().seen;
  dead_from = ns(0);
  ASSERT_TRUE(
      driver.run(*bus, port, driver.now + ms(400), [&] { return bus->state() == BusState::startup; }));
  EXPECT_GE(driver.now - last_good, profile->profile().boot_time_min);
  EXPECT_LT(driver.now - last_good, profile->profile().boot_time_min + us(100));
}

TEST_F(BusTest, AGoodCycleStartsTheCountOfFailuresAnew) {
  config.axis.max_acceleration_rpm_s =
      AxisConfig::kSteepest;  // a single reply after seven bad ones is believed
  config.lost_after = us(500);
  begin_running();
  int n = 0;
  hook = [&](const Bytes&, Time, ScriptedPort::Answer& answer) {
    if (n++ % 8 != 7) answer.bytes.clear();  // seven bad, one good
  };
  run_cycles(80);
  EXPECT_EQ(bus->statistics().lost, 0U);
  EXPECT_EQ(bus->statistics().good, 10U);
}

TEST_F(BusTest, AHeldSampleBecomesInvalidWithAge) {
  begin_running();
  run_cycles(2);
  const Time latch = bus->latest().latch_time();
  dead_from = ns(0);
  driver.run(*bus, port, latch + ms(2), [] { return false; });
  EXPECT_EQ(bus->latest().quality(), Quality::held);
  run(us(200));
  EXPECT_EQ(bus->latest().quality(), Quality::invalid);
  EXPECT_EQ(bus->state(), BusState::running);
}

// Whichever finds it first, a failed cycle or the clock.
TEST_F(BusTest, ASampleBecomesInvalidOnce) {
  for (int k = 0; k < 64; ++k) {
    config.max_hold = us(500) + us(1) * k;
    driver = Driver{};
    port.sent.clear();
    dead_from = kNever;
    begin_running();
    run_cycles(2);
    dead_from = ns(0);
    run(ms(2));
    ASSERT_EQ(bus->latest().quality(), Quality::invalid) << k;
    EXPECT_EQ(bus->statistics().invalidated, 1U) << k;
  }
}

TEST_F(BusTest, OnRestartBeginsStartUpAgain) {
  begin_running();
  run_cycles(5);
  bus->set_referenced(true);
  run_cycles(1);
  EXPECT_TRUE(bus->latest().referenced());
  // In the middle of an exchange: its reply is still to come.
  driver.run(*bus, port, driver.now + ms(1), [&] { return port.next_event(driver.now) != kNever; });
  bus->on_restart(driver.now);
  EXPECT_EQ(bus->state(), BusState::startup);
  EXPECT_EQ(bus->latest().quality(), Quality::invalid);
  EXPECT_FALSE(bus->latest().referenced());
  EXPECT_EQ(bus->statistics().restarts, 1U);
  ASSERT_TRUE(run_until_running());
  EXPECT_GT(bus->statistics().stray_bytes, 0U) << "the late reply was taken for noise, not for an answer";
  run_cycles(1);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_FALSE(bus->latest().referenced());
  expect_t1_kept();
}

TEST_F(BusTest, StopSendsNothingMore) {
  begin_running();
  run_cycles(5);
  bus->stop();
  const std::size_t sent = port.sent.size();
  EXPECT_EQ(bus->latest().quality(), Quality::invalid);
  EXPECT_EQ(bus->poll(driver.now + ms(5)), kNever);
  EXPECT_EQ(port.sent.size(), sent);
  EXPECT_EQ(error_of(bus->offer(*Request::eeprom_read(0))), Errc::bad_state);
  bus->on_restart(driver.now);
  EXPECT_EQ(bus->state(), BusState::stopped) << "a restart of the encoder does not start a stopped bus";
  driver.now += ms(6);
  start();
  EXPECT_TRUE(run_until_running());
}

TEST_F(BusTest, StartingAgainWhileAReplyIsUnderWayGivesNothingFresh) {
  begin_running();
  run_cycles(5);
  driver.run(*bus, port, driver.now + ms(1), [&] { return port.next_event(driver.now) != kNever; });
  start();
  while (bus->state() == BusState::startup && driver.now < ms(100)) {
    ASSERT_NE(bus->latest().quality(), Quality::fresh) << "a reply of before the start-up became a sample";
    const Time asked = bus->poll(driver.now);
    driver.now = std::max(std::min(asked, port.next_event(driver.now)), driver.now + ns(1));
  }
}

TEST_F(BusTest, AnEchoIsDroppedAndAWrongOneReported) {
  Profile p = test::preset("tm485_17");
  p.echo = true;
  port.echo = true;
  make(p);
  start();
  ASSERT_TRUE(run_until_running());
  run_cycles(100);
  EXPECT_EQ(bus->statistics().good, 100U);
  EXPECT_EQ(bus->statistics().reply_delay.maximum(), us(3));
}

TEST_F(BusTest, AnEchoThatNobodyExpectsNeverGivesASample) {
  port.echo = true;
  make();
  start();
  ASSERT_TRUE(run_until_failure());
  EXPECT_EQ(bus->statistics().good, 0U);
  EXPECT_NE(bus->startup_error()->cause, Errc::ok);
}

TEST_F(BusTest, ReservedStatusBitsAreCountedAndDropNothing) {
  begin_running();
  encoder.sf = 0x0F;
  encoder.almc = 0x01;
  run_cycles(10);
  EXPECT_EQ(bus->statistics().good, 10U);
  EXPECT_EQ(bus->statistics().reserved_status, 10U);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  encoder.sf = 0x10;
  encoder.almc = 0x04;
  run_cycles(5);
  EXPECT_EQ(bus->statistics().faults, 5U);
  EXPECT_EQ(bus->latest().alarm(), AlarmLevel::fault);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_EQ(bus->statistics().good, 15U);
}

TEST_F(BusTest, PositionLostBeginsStartUpAgain) {
  config.cycle = Cycle{DataId::single_turn, us(40)};
  config.lost_after = ms(100);
  begin_running();
  run_cycles(5);
  const Time dead = driver.now;
  dead_from = dead;
  run(ms(6));  // longer than single-turn data can be unwrapped
  EXPECT_EQ(bus->state(), BusState::running);
  dead_from = kNever;
  encoder.abm = 4;
  ASSERT_TRUE(driver.run(*bus, port, driver.now + ms(1), [&] { return bus->state() == BusState::startup; }));
  EXPECT_EQ(bus->last_record().result, Errc::position_lost);
  EXPECT_EQ(bus->state(), BusState::startup);
  ASSERT_TRUE(run_until_running());
  run_cycles(1);
  EXPECT_EQ(bus->latest().position(), 3 * 131'072 + 1'000) << "the turns of the new start-up, not a guess";
}

}  // namespace
}  // namespace tm485
