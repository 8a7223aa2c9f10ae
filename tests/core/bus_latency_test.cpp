// What a port's latency allowance does to slots, gaps and samples, and what it does not.
#include <gtest/gtest.h>

#include <optional>

#include "support/bus_fixture.hpp"

namespace tm485 {
namespace {

using test::BusTest;
using test::Bytes;
using test::ms;
using test::ScriptedPort;
using test::us;

using BusLatency = BusTest;

// Found by the campaign (seed 2062, run 3184): by the pattern there is a gap, but the replies are seen so late that nothing fits
// into it. The request was not one that may take slots, waited for 64 of them, ended with no_gap, and so did the next.
TEST_F(BusLatency, ARequestWhoseGapIsNeverLongEnoughTakesASlot) {
  port.be_slow(us(20));
  port.delivery = us(15);
  config.cycle = Cycle{DataId::everything, us(105)};
  config.steal_every = 2;
  begin_running();
  run_cycles(20);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(bus->scheduler()->has_gap_for(us(40)));
    ASSERT_TRUE(bus->offer(*Request::make(DataId::encoder_id)));
    std::optional<Completion> completion;
    driver.run(*bus, port, driver.now + ms(10), [&] {
      completion = bus->take_completion();
      return completion.has_value();
    });
    ASSERT_TRUE(completion && completion->result) << i;
  }
  EXPECT_GE(bus->statistics().stolen, 2U) << "behind a stolen slot one may fit";
  EXPECT_LE(bus->statistics().longest_wait, 33U);
  EXPECT_EQ(bus->statistics().failed, 0U);
  expect_t1_kept();
}

// But not one over which its position would be lost, or the sample become invalid: that was promised when it was offered.
TEST_F(BusLatency, NoSlotIsTakenThatTheSampleCannotSpare) {
  struct Case {
    Cycle cycle;
    Time max_hold;
    Time late;  // by which the owner polls behind the slot
  };
  for (const Case& c : {Case{{DataId::single_turn, ms(3)}, ms(10), us(2'980)},
                        Case{{DataId::everything, us(200)}, us(150), us(175)}}) {
    driver = test::Driver{};
    port.sent.clear();
    config.cycle = c.cycle;
    config.max_hold = c.max_hold;
    config.steal_every = 4;
    make();
    start();
    ASSERT_TRUE(run_until_running());
    run_cycles(10);
    ASSERT_TRUE(bus->offer(*Request::eeprom_read(1)));
    std::optional<Completion> completion;
    for (int i = 0; i < 200 && !completion; ++i) {  // at the slot, and too late for what fits into its gap
      const Time slot = bus->scheduler()->slot();
      driver.now = slot;
      (void)bus->poll(driver.now);
      driver.now = slot + c.late;
      for (int polls = 0; polls < 3; ++polls) (void)bus->poll(driver.now);
      completion = bus->take_completion();
    }
    ASSERT_TRUE(completion);
    EXPECT_EQ(test::error_of(completion->result), Errc::no_gap);
    EXPECT_EQ(bus->state(), BusState::running);
    EXPECT_EQ(bus->statistics().invalidated, 0U);
  }
}

// An allowance of 20 ms does not mean that a sample is fresh for so long: its successor is due a period after it was seen.
TEST_F(BusLatency, AReplyThatWasSeenEarlyIsFreshForAPeriodAndNoLonger) {
  port.be_slow(ms(20));
  port.capability_.jitter_margin = us(3);
  config.cycle = Cycle{DataId::everything, us(500)};
  begin_running();
  run_cycles(3);
  const Profile& p = profile->profile();
  EXPECT_EQ(bus->fresh_until(), bus->last_record().seen + us(500) + us(3) + p.t2_max - p.t2_min);
}

TEST_F(BusLatency, BehindAReplyThatBreaksTheProfileTheRestOfItHasTimeToCome) {
  port.be_slow(us(200));
  config.cycle = Cycle{DataId::everything, us(100)};
  begin_running();
  run_cycles(3);
  hook = [this](const Bytes&, Time, ScriptedPort::Answer& answer) {
    answer.bytes = test::id3_reply(encoder.abs, encoder.abm, 0x55);
  };
  run_cycles(1);
  ASSERT_EQ(bus->last_record().result, Errc::enid_unexpected);
  hook = nullptr;
  const Time seen = bus->last_record().seen;
  run_cycles(1);
  EXPECT_GE(port.sent.back().asked, seen + us(200));
}

// Found by the campaign (seed 20261122, run 179578): somebody else had asked the encoder the same just before, and the reply was
// handed out when the bus's own request had hardly begun: a fresh sample, latched in the future.
TEST_F(BusLatency, WhatIsThereBeforeTheRequestCanHaveLeftIsNotItsReply) {
  port.be_slow(us(100));
  config.cycle = Cycle{DataId::everything, us(250)};
  begin_running();
  run_cycles(10);
  const Time slot = bus->scheduler()->slot();
  const Bytes reply = encoder.reply({0x1A});
  Time start = slot - us(60);
  for (const std::uint8_t byte : reply) {
    port.inject(start, {byte}, Errc::ok, slot + us(1) - (start + us(4) + port.delivery));
    start += us(4);
  }
  run_cycles(1);
  EXPECT_EQ(bus->last_record().result, Errc::t2_out_of_window);
  EXPECT_EQ(bus->latest().quality(), Quality::held);
  run_cycles(3);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_LE(bus->latest().latch_time(), driver.now);
}

}  // namespace
}  // namespace tm485
