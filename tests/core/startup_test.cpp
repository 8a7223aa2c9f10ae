// Start-up of a bus: every stage, its error, and nothing fresh before it is through.
#include "tm485/bus/startup.hpp"

#include <gtest/gtest.h>

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

TEST_F(BusTest, NothingIsSentBeforeStart) {
  make();
  EXPECT_EQ(bus->state(), BusState::stopped);
  EXPECT_EQ(bus->poll(us(5)), kNever);
  EXPECT_TRUE(port.sent.empty());
  EXPECT_EQ(bus->latest().quality(), Quality::invalid);
}

TEST_F(BusTest, AnImpossibleCycleIsRefusedAndNothingHasChanged) {
  config.cycle = Cycle{DataId::everything, us(50)};
  make();
  const auto result = bus->start(ns(0));
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::period_below_t1);
  EXPECT_EQ(result.error().nearest, ns(62'500));
  EXPECT_EQ(bus->state(), BusState::stopped);
  EXPECT_EQ(bus->poll(us(5)), kNever);
}

TEST_F(BusTest, EncoderFirst) {
  make();
  start();
  EXPECT_EQ(bus->startup_stage(), StartupStage::quiet);
  const Time quiet = profile->t1(DataId::everything);  // longer than the longest reply
  ASSERT_TRUE(run_until_running());
  ASSERT_GE(port.sent.size(), 2U + 4U);
  EXPECT_EQ(port.sent[0].start, quiet)
      << "the line was silent for a reply time, and for the T1 of a user before us";
  EXPECT_EQ(port.sent[0].bytes, Bytes{0x92});
  EXPECT_EQ(port.sent[1].bytes, Bytes{0x92});
  for (std::size_t i = 2; i < 6; ++i) EXPECT_EQ(port.sent[i].bytes, Bytes{0x1A});
  EXPECT_EQ(port.sent.size(), 6U) << "ID2 twice, then startup_frames times ID3";
  EXPECT_NE(bus->latest().quality(), Quality::fresh);
  run_cycles(1);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_EQ(bus->latest().position(), 1'000);
  EXPECT_EQ(bus->statistics().startups, 1U);
  EXPECT_EQ(bus->statistics().startup_failures, 0U);
  expect_t1_kept();
}

// What a user before us has asked may be answered late as well.
TEST_F(BusTest, ASlowPortIsGivenItsLatencyToFallSilent) {
  port.be_slow(us(300));
  make();
  start();
  ASSERT_TRUE(run_until_running());
  EXPECT_EQ(port.sent[0].start, profile->t1(DataId::everything) + us(300));
}

TEST_F(BusTest, HostFirst) {
  alive_from = ms(300);
  make();
  start();
  ASSERT_TRUE(run_until_running());
  EXPECT_GE(driver.now, ms(300));
  EXPECT_LT(driver.now, ms(303)) << "asked often enough to lose no time";
  EXPECT_EQ(bus->statistics().startup_failures, 0U) << "silence while it boots is no failure";
  EXPECT_GT(errors(Errc::timeout), 250U);
  run_cycles(5);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  expect_t1_kept();
}

TEST_F(BusTest, NoEncoderAtAllIsATimeoutOfStageAnswerAfterThePowerUpTime) {
  alive_from = kNever;
  make();
  start();
  ASSERT_TRUE(run_until_failure());
  EXPECT_EQ(bus->startup_error()->stage, StartupStage::answer);
  EXPECT_EQ(bus->startup_error()->cause, Errc::timeout);
  EXPECT_GE(driver.now, ms(1'000));
  EXPECT_LT(driver.now, ms(1'003));
  EXPECT_EQ(bus->state(), BusState::startup) << "and it begins again";
  alive_from = ns(0);
  EXPECT_TRUE(run_until_running());
  EXPECT_FALSE(bus->startup_error()) << "a good one takes the error away";
}

TEST_F(BusTest, NoiseInTheQuietStageIsWaitedOut) {
  make();
  start();
  for (int i = 0; i < 40; ++i) port.inject(us(30) * i, {0x55});
  ASSERT_TRUE(run_until_running());
  EXPECT_EQ(port.sent[0].start, us(30) * 39 + us(4) + profile->t1(DataId::everything));
  EXPECT_EQ(bus->statistics().stray_bytes, 40U);
}

TEST_F(BusTest, ABabblingLineFailsTheQuietStageInBoundedTime) {
  make();
  start();
  for (int i = 0; i < 60'000; ++i) port.inject(us(40) * i, {0x55});
  ASSERT_TRUE(run_until_failure()) << driver.stuck;
  EXPECT_EQ(bus->startup_error()->stage, StartupStage::quiet);
  EXPECT_EQ(bus->startup_error()->cause, Errc::line_not_quiet);
  EXPECT_LT(driver.now, ms(1'002)) << "power_up_time and a reply time";
  EXPECT_TRUE(port.sent.empty());
}

TEST_F(BusTest, AWrongEncoderIsNamedInStageIdentify) {
  encoder.enid = 0x17;
  make();
  start();
  ASSERT_TRUE(run_until_failure());
  EXPECT_EQ(bus->startup_error()->stage, StartupStage::identify);
  EXPECT_EQ(bus->startup_error()->cause, Errc::enid_unexpected);
  run(ms(100));
  EXPECT_EQ(bus->statistics().cycles, 0U);
}

TEST_F(BusTest, Id2AndId3ThatDisagree) {
  hook = [](const Bytes& request, Time, ScriptedPort::Answer& answer) {
    if (request[0] == 0x1A) answer.bytes = test::id3_reply(5, 1, 0x17);
  };
  make("tformat_17");  // both ENIDs are expected
  encoder.enid = 0x11;
  start();
  ASSERT_TRUE(run_until_failure());
  EXPECT_EQ(bus->startup_error()->stage, StartupStage::cross_check);
  EXPECT_EQ(bus->startup_error()->cause, Errc::enid_inconsistent);
}

TEST_F(BusTest, AWrongResolutionIsSeenByTheRangeOfAbs) {
  encoder.enid = 0x17;
  encoder.abs = 0x20000;
  make("tformat_17");  // 17 bits that report ENID 17 exist
  start();
  ASSERT_TRUE(run_until_failure());
  EXPECT_EQ(bus->startup_error()->stage, StartupStage::cross_check);
  EXPECT_EQ(bus->startup_error()->cause, Errc::abs_out_of_range);
}

TEST_F(BusTest, FramesThatNoShaftCanDo) {
  hook = [this](const Bytes& request, Time, ScriptedPort::Answer&) {
    if (request[0] == 0x1A) encoder.abs = (encoder.abs + 0x8000) & 0x1FFFF;
  };
  make();
  start();
  ASSERT_TRUE(run_until_failure());
  EXPECT_EQ(bus->startup_error()->stage, StartupStage::consistent);
  EXPECT_EQ(bus->startup_error()->cause, Errc::frames_inconsistent);
}

TEST_F(BusTest, ASilenceAfterTheFirstAnswerIsForgivenThreeTimes) {
  for (const int silent : {3, 4}) {
    int id3 = 0;
    hook = [&](const Bytes& request, Time, ScriptedPort::Answer& answer) {
      if (request[0] == 0x1A && id3++ < silent) answer.bytes.clear();
    };
    driver = Driver{};
    port.sent.clear();
    make();
    start();
    driver.run(*bus, port, ms(20), [&] { return bus->state() == BusState::running || bus->startup_error(); });
    EXPECT_EQ(bus->startup_error().has_value(), silent == 4);
    if (silent == 4) {
      EXPECT_EQ(bus->startup_error()->stage, StartupStage::cross_check);
      EXPECT_EQ(bus->startup_error()->cause, Errc::timeout);
    }
    hook = nullptr;
  }
}

TEST_F(BusTest, GarbageInStageAnswerIsATellingCause) {
  hook = [](const Bytes&, Time, ScriptedPort::Answer& answer) { answer.bytes = {0x92, 0x00, 0x11, 0x00}; };
  make();
  start();
  ASSERT_TRUE(run_until_failure());
  EXPECT_EQ(bus->startup_error()->stage, StartupStage::answer);
  EXPECT_EQ(bus->startup_error()->cause, Errc::crc_error);
}

TEST(Startup, StagesHaveNames) {
  EXPECT_EQ(name(StartupStage::quiet), "quiet");
  EXPECT_EQ(name(StartupStage::answer), "answer");
  EXPECT_EQ(name(StartupStage::identify), "identify");
  EXPECT_EQ(name(StartupStage::cross_check), "cross_check");
  EXPECT_EQ(name(StartupStage::consistent), "consistent");
  EXPECT_EQ(name(StartupStage::done), "done");
}

}  // namespace
}  // namespace tm485
