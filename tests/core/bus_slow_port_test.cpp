// Bus on a port without wire timestamps: it neither knows when a request really started nor when the reply came.
// The scripted port does know, and judges: T1 on the true start bits, positions at the true latch.
#include <gtest/gtest.h>

#include <string>
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

constexpr std::int64_t kTurn = 1 << 17;

/// A shaft that turns at `rpm` for ever, with a 17-bit encoder on it.
class BusSlowPort : public BusTest {
 protected:
  /// Counts since time 0, rounded down.
  [[nodiscard]] std::int64_t shaft(Time t) const { return t.count() * rpm * kTurn / 60'000'000'000; }

  /// The answers come from the shaft, at the true latch. Call it from a hook of one's own as well.
  void turn(const Bytes& request, Time start, ScriptedPort::Answer& answer) {
    if (answer.bytes.empty()) return;
    const std::int64_t counts = shaft(start + us(4));
    encoder.abs = static_cast<std::uint32_t>(counts & (kTurn - 1));
    encoder.abm = static_cast<std::uint32_t>(1 + (counts >> 17)) & 0xFFFF;
    answer.bytes = encoder.reply(request);
  }
  void use_shaft(std::int64_t speed) {
    rpm = speed;
    hook = [this](const Bytes& request, Time start, ScriptedPort::Answer& answer) {
      turn(request, start, answer);
    };
  }
  /// A fresh sample is the shaft's position at an instant that the sample's own uncertainty allows.
  void expect_honest(const Sample& sample) {
    if (sample.quality() != Quality::fresh) return;
    const Time from = sample.latch_time() - sample.latch_uncertainty();
    const Time until = sample.latch_time() + sample.latch_uncertainty();
    ASSERT_GE(sample.position() + base, shaft(from) - 1) << "at " << sample.latch_time().count();
    ASSERT_LE(sample.position() + base, shaft(until) + 1) << "at " << sample.latch_time().count();
    ++fresh;
  }
  void run_honestly(Time span) {
    driver.run(*bus, port, driver.now + span, [this] {
      if (bus->record_count() == records) return HasFailure();
      records = bus->record_count();
      expect_honest(bus->latest());
      return HasFailure();
    });
    ASSERT_FALSE(driver.stuck);
  }
  /// No request was handed to the port before the one before it had left.
  void expect_one_at_a_time() {
    for (std::size_t i = 1; i < port.sent.size(); ++i) {
      const auto& before = port.sent[i - 1];
      ASSERT_GE(port.sent[i].asked, before.start + us(4) * static_cast<int>(before.bytes.size())) << i;
    }
  }

  std::int64_t rpm = 0;
  std::int64_t base = 0;  ///< what a single-turn encoder does not know
  std::uint32_t records = 0;
  std::uint32_t fresh = 0;
};

TEST_F(BusSlowPort, ALateReplyIsNeverTheAnswerOfTheNextRequest) {
  port.be_slow(us(250));
  config.cycle = Cycle{DataId::everything, us(100)};
  int count = -1;
  rpm = 3'000;
  hook = [&](const Bytes& request, Time start, ScriptedPort::Answer& answer) {
    turn(request, start, answer);
    if (count >= 0 && ++count >= 20) answer.late = count == 20 ? us(400) : us(230);
  };
  begin_running();
  count = 0;
  run_honestly(ms(50));
  EXPECT_GT(fresh, 100U);
  const Statistics& s = bus->statistics();
  EXPECT_EQ(s.failed, 1U);
  EXPECT_EQ(errors(Errc::timeout), 1U);
  EXPECT_EQ(s.stray_bytes, 11U) << "the late reply was counted and dropped";
  EXPECT_EQ(s.lost, 0U);
  expect_t1_kept();
}

TEST_F(BusSlowPort, AfterAFailedExchangeNothingIsSentForOneLatencyAllowance) {
  port.be_slow(us(250));
  config.cycle = Cycle{DataId::everything, us(100)};
  Bytes spoiled;
  bool spoil = false;
  hook = [&](const Bytes&, Time, ScriptedPort::Answer& answer) {
    if (spoil) answer.bytes = spoiled;
  };
  const Bytes kCases[] = {{}, {0x1A, 0x00}, Bytes(11, 0x00), Bytes(12, 0x1A)};
  for (const Bytes& bytes : kCases) {
    driver = Driver{};
    port.sent.clear();
    begin_running();
    run_cycles(5);
    spoiled = bytes;
    spoil = true;
    run_cycles(1);
    spoil = false;
    ASSERT_NE(bus->last_record().result, Errc::ok);
    const Time verdict = bus->last_record().seen;
    const std::size_t sent = port.sent.size();
    ASSERT_TRUE(driver.run(*bus, port, driver.now + ms(2), [&] { return port.sent.size() > sent; }));
    EXPECT_GE(port.sent.back().start - verdict, us(250)) << bytes.size() << " bytes";
    run_cycles(5);
    EXPECT_EQ(bus->statistics().failed, bytes.size() == 12 ? bus->statistics().failed : 1U);
    expect_t1_kept();
  }
}

// The last good reply was latched long before it was seen. An encoder that restarts right behind it is silent for a whole boot
// time, and seen to be silent for less.
TEST_F(BusSlowPort, ARestartBehindALateReplyDoesNotGoUnnoticed) {
  port.be_slow(ms(6));
  config.cycle = Cycle{DataId::everything, ms(1)};
  config.lost_after = ms(500);
  bool armed = false;
  std::optional<Time> last;
  Time silent_until{0};
  hook = [&](const Bytes& request, Time start, ScriptedPort::Answer& answer) {
    turn(request, start, answer);
    if (!armed) return;
    if (!last) {
      last = start;
      silent_until = start + profile->profile().boot_time_min + us(100);
      answer.late = us(5'900);
    } else if (start < silent_until) {
      answer.bytes.clear();
    }
  };
  begin_running();
  run_cycles(3);
  armed = true;
  ASSERT_FALSE(driver.run(*bus, port, driver.now + ms(200), [] { return false; }));
  ASSERT_TRUE(last);
  EXPECT_EQ(bus->state(), BusState::running);
  EXPECT_EQ(bus->statistics().startups, 2U);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
}

// The start is an estimate, the reply comes late: the sample says how much that can matter.
TEST_F(BusSlowPort, TheUncertaintyOfASampleCoversTheTrueLatch) {
  test::Rng rng(81);
  for (const DataId id : {DataId::single_turn, DataId::everything}) {
    port = ScriptedPort{};
    port.answer = [this](const Bytes& request, Time start) { return respond(request, start); };
    port.be_slow(us(900));
    port.lateness = [&] { return us(static_cast<std::int64_t>(test::random_below(rng, 300))); };
    config.cycle = Cycle{id, us(500)};
    encoder.enid = 0x00;
    driver = Driver{};
    rpm = 5'000;
    hook = [&](const Bytes& request, Time start, ScriptedPort::Answer& answer) {
      turn(request, start, answer);
      answer.late = us(static_cast<std::int64_t>(test::random_below(rng, 300)));
    };
    begin_running("tm485_17_st");
    std::uint32_t seen = bus->record_count();
    std::int64_t offset = -1;
    driver.run(*bus, port, driver.now + ms(500), [&] {
      if (bus->record_count() == seen || bus->latest().quality() != Quality::fresh) return false;
      seen = bus->record_count();
      ++fresh;
      const Sample& sample = bus->latest();
      const Time latch = port.sent.back().start + us(4);
      EXPECT_LE(latch, sample.latch_time() + sample.latch_uncertainty());
      EXPECT_GE(latch, sample.latch_time() - sample.latch_uncertainty());
      EXPECT_LE(sample.latch_uncertainty(), us(600) + us(10)) << "and is not more than what came late";
      if (offset < 0) offset = shaft(latch) - sample.position();
      EXPECT_EQ(sample.position(), shaft(latch) - offset) << "every turn was counted";
      EXPECT_EQ(offset % kTurn, 0);
      return HasFailure();
    });
    EXPECT_EQ(bus->statistics().failed, 0U);
    expect_t1_kept();
  }
  EXPECT_GT(fresh, 500U);
}

TEST_F(BusSlowPort, AGapThatMayExceedHalfATurnIsPositionLost) {
  for (const Time late : {us(0), us(300)}) {
    port.be_slow(us(400));
    config.cycle = Cycle{DataId::single_turn, us(2'400)};
    encoder.enid = 0x00;
    driver = Driver{};
    bool silent = false;
    hook = [&](const Bytes&, Time, ScriptedPort::Answer& answer) {
      answer.late = late;
      if (silent) answer.bytes.clear();
    };
    begin_running("tm485_17_st");
    run_cycles(4);
    ASSERT_EQ(bus->latest().quality(), Quality::fresh);
    silent = true;
    run_cycles(1);
    silent = false;
    run_cycles(1);  // 4.8 ms after the last position; at 6000 rpm half a turn takes 5 ms
    if (late == us(0)) {
      EXPECT_EQ(bus->latest().quality(), Quality::fresh);
    } else {
      EXPECT_EQ(bus->last_record().result, Errc::position_lost);
      EXPECT_EQ(bus->state(), BusState::startup);
      EXPECT_EQ(bus->latest().quality(), Quality::invalid);
    }
  }
}

TEST_F(BusSlowPort, StartUpSucceedsOnATurningShaftWhateverTheDelayOfTheSend) {
  for (std::uint64_t seed = 0; seed < 50; ++seed) {
    for (const char* name : {"tm485_17", "tm485_17_st"}) {
      test::Rng rng(1'000 + seed);
      port.be_slow(ms(2));
      port.lateness = [&] { return us(20 + static_cast<std::int64_t>(test::random_below(rng, 681))); };
      use_shaft(3'000);
      encoder.enid = std::string(name) == "tm485_17" ? 0x11 : 0x00;
      driver = Driver{};
      port.sent.clear();
      make(name);
      start();
      ASSERT_TRUE(run_until_running(ms(200))) << seed << " " << name;
      ASSERT_EQ(bus->statistics().startup_failures, 0U) << seed << " " << name;
      run_cycles(3);
      EXPECT_EQ(bus->latest().quality(), Quality::fresh);
      expect_t1_kept();
    }
  }
}

TEST_F(BusSlowPort, NothingMoreIsSentBeforeTheLastRequestHasLeft) {
  port.be_slow(us(250));
  config.cycle = Cycle{DataId::everything, us(500)};
  Time once{0};
  port.lateness = [&] { return std::exchange(once, Time{0}); };
  begin_running();
  run_cycles(5);
  for (const Time delay : {us(400), us(700), ms(3), ms(5)}) {
    once = delay;
    const std::size_t sent = port.sent.size();
    run_cycles(1);
    EXPECT_EQ(bus->last_record().result, Errc::send_failed) << "not a timeout: it never left";
    ASSERT_TRUE(driver.run(*bus, port, driver.now + ms(20), [&] { return port.sent.size() >= sent + 2; }));
    expect_one_at_a_time();
    run_cycles(5);
    EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  }
  EXPECT_EQ(bus->state(), BusState::running);
}

// What left late may be asked again only T1 after it left, to the nanosecond of the attempt.
TEST_F(BusSlowPort, ARequestThatLeftAfterItsExchangeHadFailedIsStillFollowedByT1) {
  port.be_slow(us(20));
  config.cycle = Cycle{DataId::everything, us(100)};
  Time once{0};
  port.lateness = [&] { return std::exchange(once, Time{0}); };
  begin_running();
  for (int delay = 60; delay < 400; ++delay) {
    run_cycles(3);
    once = us(delay);
    run_cycles(5);
    expect_one_at_a_time();
    expect_t1_kept();
    if (HasFailure()) FAIL() << "sent " << delay << " us late";
  }
}

TEST_F(BusSlowPort, ARequestStillInThePortHoldsUpTheStartUpThatAbandonedIt) {
  port.be_slow(us(250));
  Time once{0};
  port.lateness = [&] { return std::exchange(once, Time{0}); };
  for (const bool stop : {false, true}) {
    driver = Driver{};
    port = [&] {
      ScriptedPort fresh_port;
      fresh_port.answer = port.answer;
      fresh_port.lateness = port.lateness;
      fresh_port.be_slow(us(250));
      return fresh_port;
    }();
    begin_running();
    run_cycles(3);
    once = ms(3);
    const std::size_t sent = port.sent.size();
    ASSERT_TRUE(driver.run(*bus, port, driver.now + ms(2), [&] { return port.sent.size() > sent; }));
    if (stop) {
      bus->stop();
      start();
    } else {
      bus->on_restart(driver.now);
    }
    ASSERT_TRUE(run_until_running());
    expect_one_at_a_time();
    expect_t1_kept();
  }
}

TEST_F(BusSlowPort, ASilenceKeepsT1OfTheTrueStartBit) {
  port.be_slow(us(50));
  config.cycle = Cycle{DataId::everything, us(100)};
  begin_running();
  run_cycles(3);
  for (int delay = 0; delay <= 104; delay += 4) {  // the deadline is 58 + 50 us after the estimate
    port.lateness = [&] { return us(delay); };
    dead_from = driver.now;
    run_cycles(1);
    EXPECT_EQ(bus->last_record().result, Errc::timeout) << delay;
    port.lateness = [] { return Time{0}; };
    dead_from = kNever;
    run_cycles(3);
    expect_t1_kept();
    if (HasFailure()) FAIL() << "sent " << delay << " us late";
  }
}

// The host reads its clock, is interrupted, and only then asks the port: `now` is older than the bytes it gets.
TEST_F(BusSlowPort, AClockReadLongBeforeThePortIsAskedCostsNeitherT1NorHonesty) {
  port.be_slow(us(250));
  config.cycle = Cycle{DataId::everything, us(100)};
  use_shaft(3'000);
  begin_running();
  records = bus->record_count();
  test::Rng rng(72);
  for (int i = 0; i < 60'000 && !HasFailure(); ++i) {
    const bool interrupted = test::random_below(rng, 20) == 0;
    port.behind = Time{interrupted ? static_cast<std::int64_t>(test::random_below(rng, 90'000)) : 0};
    const Time asked = bus->poll(driver.now);
    driver.now = std::max(driver.now + port.behind, std::min(asked, port.next_event(driver.now)));
    if (bus->record_count() == records) continue;
    records = bus->record_count();
    expect_honest(bus->latest());
  }
  EXPECT_GT(fresh, 4'000U);
  EXPECT_EQ(bus->statistics().failed, 0U);
  expect_t1_kept();
}

TEST_F(BusSlowPort, ASampleBecomesInvalidWhileAnExchangeWaits) {
  port.be_slow(ms(20));
  config.cycle = Cycle{DataId::everything, ms(1)};
  config.max_hold = ms(2);
  begin_running();
  run_cycles(5);
  const Time latch = bus->latest().latch_time();
  const Time seen = bus->last_record().seen;
  ASSERT_EQ(bus->latest().quality(), Quality::fresh);
  dead_from = driver.now;
  const Time end = driver.now + ms(60);
  int at_once = 0;  // asked to be called again with a clock that was read anew
  while (driver.now < end) {
    const Time asked = bus->poll(driver.now);
    if (driver.now - latch <= ms(3)) {
      EXPECT_NE(bus->latest().quality(), Quality::invalid) << (driver.now - latch).count();
      EXPECT_LE(asked, seen + ms(3)) << "asks to be called before it is too old";
      EXPECT_EQ(bus->statistics().invalidated, 0U);
    }
    if (driver.now >= seen + ms(3)) {
      EXPECT_EQ(bus->latest().quality(), Quality::invalid);
      EXPECT_FALSE(bus->latest().has_position());
      EXPECT_EQ(bus->statistics().invalidated, 1U) << "once";
    }
    ASSERT_GE(asked, driver.now);
    at_once = asked == driver.now ? at_once + 1 : 0;
    ASSERT_LE(at_once, 1);
    driver.now = asked;
  }
  dead_from = kNever;
  ASSERT_TRUE(run_until_running());
  run_cycles(2);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_EQ(bus->statistics().invalidated, 1U);
}

TEST_F(BusSlowPort, AnOfferThatLateRepliesKeepOutEndsInNoGap) {
  port.be_slow(us(400));
  config.cycle = Cycle{DataId::everything, us(250)};
  Time late = us(149);  // T1 after the latest possible start leaves less than the exchange needs
  hook = [&](const Bytes&, Time, ScriptedPort::Answer& answer) { answer.late = late; };
  begin_running();
  run_cycles(3);
  ASSERT_TRUE(bus->offer(*Request::eeprom_read(1)));
  const std::uint32_t before = bus->statistics().cycles;
  std::optional<Completion> completion;
  driver.run(*bus, port, driver.now + ms(200),
             [&] { return (completion = bus->take_completion()).has_value(); });
  ASSERT_TRUE(completion);
  EXPECT_EQ(error_of(completion->result), Errc::no_gap);
  EXPECT_EQ(completion->request.bytes()[0], 0xEA);
  EXPECT_GE(bus->statistics().cycles - before, 62U);
  EXPECT_LE(bus->statistics().cycles - before, 65U);
  for (const auto& sent : port.sent) EXPECT_NE(sent.bytes[0], 0xEA);
  late = us(0);
  run_cycles(3);
  ASSERT_TRUE(bus->offer(*Request::eeprom_read(1)));
  driver.run(*bus, port, driver.now + ms(5),
             [&] { return (completion = bus->take_completion()).has_value(); });
  ASSERT_TRUE(completion);
  EXPECT_TRUE(completion->result);
  expect_t1_kept();
}

}  // namespace
}  // namespace tm485
