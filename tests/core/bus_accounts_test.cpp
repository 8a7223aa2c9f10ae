// What a bus refuses, reports and counts: axes, alarms, errors by cause, sequence numbers, start-up retries.
#include <gtest/gtest.h>

#include <limits>

#include "support/bus_fixture.hpp"

namespace tm485 {
namespace {

using test::BusTest;
using test::Bytes;
using test::Driver;
using test::ms;
using test::ns;
using test::ScriptedPort;
using test::us;

using BusAccounts = BusTest;

constexpr std::int64_t kLargestOffset = std::int64_t{1} << 60;

TEST_F(BusAccounts, AnAxisThatGivesNoPositionIsRefused) {
  constexpr auto kLowest = std::numeric_limits<std::int32_t>::min();
  constexpr std::int64_t kFarthest = std::numeric_limits<std::int64_t>::max();
  const AxisConfig kCases[] = {{.zero_offset = kLargestOffset, .reference_turn = {}},
                               {.zero_offset = -kLargestOffset, .reference_turn = {}},
                               {.zero_offset = kFarthest, .reference_turn = {}},
                               {.zero_offset = -kFarthest - 1, .reference_turn = -1},
                               {.reference_turn = {}, .gear_numerator = 0},
                               {.reference_turn = {}, .gear_denominator = 0},
                               {.reference_turn = {}, .pole_pairs = 0},
                               {.reference_turn = {}, .max_speed_rpm = 0},
                               {.reference_turn = {}, .max_speed_rpm = -1},
                               {.reference_turn = {}, .max_speed_rpm = kLowest},
                               {.reference_turn = {}, .max_speed_rpm = 1'000'001}};
  for (const AxisConfig& axis : kCases) {
    config.axis = axis;
    make();
    const auto result = bus->start(ns(0));
    ASSERT_FALSE(result) << &axis - kCases;
    EXPECT_EQ(result.error().code, Errc::bad_argument);
    EXPECT_EQ(result.error().nearest, ns(0));
    EXPECT_EQ(bus->state(), BusState::stopped);
    EXPECT_EQ(bus->poll(us(100)), kNever);
  }
}

// Meant for the sanitizer of undefined behaviour, too.
TEST_F(BusAccounts, AnAxisJustInsideTheLimitsWorks) {
  constexpr auto kLowest = std::numeric_limits<std::int32_t>::min();
  constexpr auto kHighest = std::numeric_limits<std::int32_t>::max();
  for (const std::int64_t offset : {kLargestOffset - 1, 1 - kLargestOffset}) {
    for (const std::int32_t extreme : {kLowest, kHighest}) {
      for (const std::int32_t rpm : {1, 1'000'000}) {
        for (const bool reversed : {false, true}) {
          config.axis = {.reversed = reversed,
                         .zero_offset = offset,
                         .reference_turn = extreme,
                         .gear_numerator = extreme,
                         .gear_denominator = extreme == kLowest ? kHighest : kLowest,
                         .pole_pairs = 65'535,
                         .electrical_offset = 0xFFFFFFFF,
                         .max_speed_rpm = rpm,
                         .units = Units::deg};
          driver = Driver{};
          encoder = {.abs = 0xFFFFFF, .abm = extreme == kLowest ? 0x7FFFFFU : 0x800000U};
          Profile p = test::preset("any");
          p.multi_turn_bits = 24;
          make(p);
          start();
          ASSERT_TRUE(run_until_running());
          run_cycles(3);
          const std::int64_t turns = extreme == kLowest ? 0x7FFFFF : -0x800000;
          const std::int64_t position = (turns - std::int64_t{extreme}) * 0x1000000 + 0xFFFFFF - offset;
          EXPECT_EQ(bus->latest().position(), reversed ? -position : position);
          const double units = to_units(bus->latest().position(), config.axis, 24);
          EXPECT_LT(units, 1e15);
          EXPECT_GT(units, -1e15);
        }
      }
    }
  }
}

TEST_F(BusAccounts, ByDefaultPositionZeroIsTheTurnAtWhichTheProfileBegins) {
  const struct {
    const char* profile;
    std::uint32_t abm;
    std::uint8_t enid;
  } kCases[] = {{"tformat_17", 0, 0x11}, {"tformat_23_battery", 0, 0x17}, {"tm485_17", 1, 0x11},
                {"tm485_23", 1, 0x17},   {"tm485_17_st", 0, 0x00},        {"any", 0, 0x55}};
  for (const auto& c : kCases) {
    driver = Driver{};
    encoder = {.abs = 0, .abm = c.abm, .enid = c.enid};
    begin_running(c.profile);
    run_cycles(1);
    EXPECT_EQ(bus->latest().quality(), Quality::fresh);
    EXPECT_EQ(bus->latest().position(), 0) << c.profile;
  }
}

TEST_F(BusAccounts, RequestErrorsThatATFormatEncoderReportsAreCounted) {
  for (const unsigned bits : {0x40U, 0x80U, 0xC0U}) {
    driver = Driver{};
    encoder.sf = 0;
    encoder.abm = 0;
    begin_running("tformat_17");
    run_cycles(3);
    encoder.sf = static_cast<std::uint8_t>(bits);
    run_cycles(5);
    EXPECT_EQ(bus->statistics().reserved_status, 5U);
    EXPECT_EQ(bus->statistics().good, 8U) << "and drop nothing";
    EXPECT_EQ(bus->statistics().faults, 0U);
  }
}

TEST_F(BusAccounts, AnAlarmOfTheStartUpsId3IsNotAFaultOfEveryId0) {
  config.cycle = Cycle{DataId::single_turn, us(100)};
  encoder.almc = 0x05;  // counting error, and a bit that the document reserves
  begin_running();
  run_cycles(5);
  const Sample& sample = bus->latest();
  EXPECT_EQ(sample.quality(), Quality::fresh);
  EXPECT_EQ(sample.status(), StatusSet(0x00, 0x05)) << "ALMC as of the last reply that had one";
  EXPECT_EQ(sample.alarm(), AlarmLevel::none) << "SF of this reply has no error";
  EXPECT_EQ(bus->statistics().faults, 0U);
  EXPECT_EQ(bus->statistics().reserved_status, 0U) << "no reply of the cycle had such a bit";
  encoder.sf = 0x10;
  run_cycles(2);
  EXPECT_EQ(bus->latest().alarm(), AlarmLevel::fault);
  EXPECT_EQ(bus->statistics().faults, 2U);
}

TEST_F(BusAccounts, ACauseThatTheSequenceRepeatsIsCountedOnce) {
  bool once = true;
  hook = [&](const Bytes&, Time, ScriptedPort::Answer& answer) {
    if (once) {
      answer.bytes = {0x92, 0x00, 0x11, 0x00};
    } else {
      answer.bytes.clear();
    }
    once = false;
  };
  make();
  start();
  ASSERT_TRUE(run_until_failure());
  EXPECT_EQ(bus->startup_error()->stage, StartupStage::answer);
  EXPECT_EQ(bus->startup_error()->cause, Errc::crc_error);
  EXPECT_EQ(errors(Errc::crc_error), 1U);
  EXPECT_EQ(errors(Errc::timeout), bus->record_count() - 1);
  EXPECT_EQ(bus->statistics().startup_failures, 1U);
}

TEST_F(BusAccounts, ACauseThatOnlyTheSequenceSeesIsCountedOnce) {
  encoder.enid = 0x17;
  make();
  start();
  ASSERT_TRUE(run_until_failure());
  EXPECT_EQ(bus->startup_error()->cause, Errc::enid_unexpected);
  EXPECT_EQ(errors(Errc::enid_unexpected), 1U);
  EXPECT_EQ(bus->last_record().result, Errc::ok) << "the exchange itself was good";
}

TEST_F(BusAccounts, AnInvalidSampleHasNoPosition) {
  make();
  EXPECT_FALSE(bus->latest().has_position());
  start();
  ASSERT_TRUE(run_until_running());
  run_cycles(2);
  EXPECT_TRUE(bus->latest().has_position());
  bus->on_restart(driver.now);
  EXPECT_EQ(bus->latest().quality(), Quality::invalid);
  EXPECT_FALSE(bus->latest().has_position());
  ASSERT_TRUE(run_until_running());
  run_cycles(2);
  dead_from = driver.now;
  run_cycles(1);
  EXPECT_EQ(bus->latest().quality(), Quality::held);
  EXPECT_TRUE(bus->latest().has_position());
  run(ms(10));
  EXPECT_EQ(bus->latest().quality(), Quality::invalid);
  EXPECT_FALSE(bus->latest().has_position());
  bus->stop();
  EXPECT_FALSE(bus->latest().has_position());
}

TEST_F(BusAccounts, HistogramsAreFineWhereTheyTellMost) {
  config.cycle = Cycle{DataId::everything, us(100)};
  make();
  start();
  const auto width = [](const TimeStatistic& s) { return s.histogram().edge(1) - s.histogram().edge(0); };
  EXPECT_EQ(width(bus->statistics().t1), ns(256));
  EXPECT_EQ(bus->statistics().t1.histogram().edge(8), us(100)) << "around the period";
  EXPECT_EQ(width(bus->statistics().reply_delay), ns(256));
  EXPECT_EQ(bus->statistics().reply_delay.histogram().edge(0), profile->profile().t2_min);
  port.be_slow(ms(1));
  make();
  start();
  EXPECT_EQ(bus->statistics().reply_delay.histogram().edge(0), Time{0});
  EXPECT_EQ(width(bus->statistics().reply_delay), ns(65'536)) << "sixteen of them hold the latency";
}

TEST_F(BusAccounts, AStartUpIsNoCycle) {
  begin_running();
  run_cycles(10);
  const Time longest = bus->statistics().t1.maximum();
  bus->on_restart(driver.now);
  ASSERT_TRUE(run_until_running());
  run_cycles(10);
  EXPECT_EQ(bus->statistics().t1.maximum(), longest);
}

// Whoever offers again as soon as an offer has failed is not answered in a tight loop.
TEST_F(BusAccounts, APortThatSendsNothingIsAskedAfterAT1) {
  config.cycle.reset();
  begin_running();
  port.refuses = true;
  int failed = 0;
  int polls = 0;
  for (const Time end = driver.now + ms(10); driver.now < end && polls < 10'000; ++polls) {
    (void)bus->offer(*Request::make(DataId::encoder_id));
    const Time due = bus->poll(driver.now);
    if (const auto completion = bus->take_completion()) {
      EXPECT_EQ(test::error_of(completion->result), Errc::send_failed);
      ++failed;
    } else {
      driver.now = std::max(driver.now, std::min(due, end));
    }
  }
  EXPECT_GE(failed, 200);
  EXPECT_LE(failed, 251) << "40 us apart";
}

TEST_F(BusAccounts, TheSequenceCountsPublications) {
  make();
  start();
  const std::uint32_t before = bus->latest().sequence();
  ASSERT_TRUE(run_until_running());
  EXPECT_EQ(bus->latest().sequence(), before) << "start-up published nothing";
  run_cycles(1);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  std::uint32_t last = bus->latest().sequence();
  EXPECT_EQ(last, before + 1);
  for (int i = 0; i < 50; ++i) {
    hook = [i](const Bytes&, Time, ScriptedPort::Answer& answer) {
      if (i % 3 == 0) answer.bytes.clear();
      if (i % 7 == 0) answer.bytes = test::id3_reply(1'000, 500);  // no shaft can be there
    };
    run_cycles(1);
    EXPECT_EQ(bus->latest().sequence(), ++last) << "one more: fresh or held";
  }
  hook = nullptr;
  bus->on_restart(driver.now);
  EXPECT_EQ(bus->latest().sequence(), ++last) << "the invalid one";
  ASSERT_TRUE(run_until_running());
  run_cycles(1);
  EXPECT_EQ(bus->latest().sequence(), ++last);
}

TEST_F(BusAccounts, AnEchoExpectedOfAPortWithoutOneIsNamed) {
  for (const bool wire_timestamps : {false, true}) {
    if (!wire_timestamps) port.be_slow(us(100));
    port.capability_.wire_timestamps = wire_timestamps;
    driver = Driver{};
    Profile p = test::preset("tm485_17");
    p.echo = true;
    make(p);
    start();
    ASSERT_TRUE(run_until_failure());
    EXPECT_EQ(bus->startup_error()->cause, Errc::echo_mismatch) << wire_timestamps;
    EXPECT_EQ(errors(Errc::echo_mismatch), bus->record_count()) << "each time, at the deadline";
  }
}

TEST_F(BusAccounts, EveryStageOfStartUpForgivesThreeFailures) {
  for (const int silent : {3, 4}) {
    int id2 = 0;
    int id3 = 0;
    hook = [&](const Bytes& request, Time, ScriptedPort::Answer& answer) {
      // ID2: number 0 is for answer, then identify; ID3: three and one for cross_check, then consistent.
      const int number = request[0] == 0x92 ? id2++ : id3++;
      const bool lost = request[0] == 0x92 ? number >= 1 && number <= 3 : number <= 2;
      const bool lost_again = request[0] == 0x1A && number >= 4 && number < 4 + silent;
      if (lost || lost_again) answer.bytes.clear();
    };
    driver = Driver{};
    make();
    start();
    driver.run(*bus, port, ms(50), [&] { return bus->state() == BusState::running || bus->startup_error(); });
    if (silent == 3) {
      EXPECT_FALSE(bus->startup_error());
      EXPECT_EQ(bus->state(), BusState::running);
      EXPECT_EQ(id2, 1 + 3 + 1);
      EXPECT_EQ(id3, 3 + 1 + 3 + 3);
    } else {
      ASSERT_TRUE(bus->startup_error());
      EXPECT_EQ(bus->startup_error()->stage, StartupStage::consistent);
      EXPECT_EQ(bus->startup_error()->cause, Errc::timeout);
    }
  }
}

}  // namespace
}  // namespace tm485
