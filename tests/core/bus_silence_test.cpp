// Restarts of the encoder that nobody could see: no cycle has failed, and yet it was silent for as long as one takes.
#include <gtest/gtest.h>

#include "support/bus_fixture.hpp"

namespace tm485 {
namespace {

using test::BusTest;
using test::ms;
using test::us;

class BusSilence : public BusTest {
 protected:
  void begin_at_turn(std::uint32_t turn) {
    encoder.abm = turn;
    begin_running();
    bus->set_referenced(true);
    run_cycles(10);
    ASSERT_EQ(bus->latest().quality(), Quality::fresh);
  }
};

// Nobody called the bus for as long as a restart takes, and no cycle had failed: the next reply was taken for one that the shaft
// had turned to meanwhile, whole turns off and `referenced`.
TEST_F(BusSilence, AnEncoderCanHaveRestartedWhileNobodyCalled) {
  for (const Time away : {ms(50), ms(60), ms(1'000)}) {
    begin_at_turn(4);
    driver.now += away;
    encoder.abm = 1;
    const std::uint32_t startups = bus->statistics().startups;
    const Time latch = bus->latest().latch_time();
    const auto is_new = [&] {
      return bus->latest().quality() == Quality::fresh && bus->latest().latch_time() != latch;
    };
    ASSERT_TRUE(driver.run(*bus, port, driver.now + ms(100), is_new));
    EXPECT_EQ(bus->statistics().startups, startups + 1) << "before anything is called fresh";
    EXPECT_FALSE(bus->latest().referenced()) << away.count();
    EXPECT_EQ(bus->latest().position(), 1'000);
    bus->stop();
  }
}

TEST_F(BusSilence, OrWhileTheLineWasHeldForNothing) {
  begin_at_turn(4);
  bus->hold_line(driver.now + ms(60), LineHold::no_cycle);
  encoder.abm = 1;
  run(ms(100));
  EXPECT_EQ(bus->statistics().startups, 2U);
  EXPECT_FALSE(bus->latest().referenced());
}

TEST_F(BusSilence, ButNotWhileItAnswered) {
  begin_at_turn(4);
  bus->hold_line(driver.now + ms(100), LineHold::no_cycle);
  for (int i = 0; i < 10; ++i) {
    ASSERT_TRUE(bus->offer(*Request::make(DataId::encoder_id)));
    run(ms(10));
    ASSERT_TRUE(bus->take_completion()->result.has_value());
  }
  run(ms(5));
  EXPECT_EQ(bus->statistics().startups, 1U);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
  EXPECT_TRUE(bus->latest().referenced());
}

TEST_F(BusSilence, NorWhileItHadToWaitForTheNextSlotOfASlowCycle) {
  for (const Time slot : {ms(24), ms(26), ms(49), ms(51), ms(400)}) {
    config.cycle = Cycle{DataId::everything, slot};
    begin_at_turn(4);
    port.lateness = [] { return us(1); };
    run_cycles(20);
    EXPECT_EQ(bus->statistics().startups, 1U) << slot.count();
    port.lateness = [] { return Time{0}; };
    bus->stop();
  }
}

// What is heard behind the silence does not end it: it is the encoder that has restarted meanwhile.
TEST_F(BusSilence, AndABackgroundReplyBehindItDoesNotHideThat) {
  begin_at_turn(4);
  bus->hold_line(driver.now + ms(80), LineHold::no_cycle);
  run(ms(60));
  encoder.abm = 1;
  ASSERT_TRUE(bus->offer(*Request::make(DataId::encoder_id)));
  run(ms(60));
  ASSERT_TRUE(bus->take_completion()->result.has_value());
  EXPECT_EQ(bus->statistics().startups, 2U);
  EXPECT_FALSE(bus->latest().referenced());
}

TEST_F(BusSilence, NorWhereThePatternWaitsForItsPhase) {
  for (Time epoch{0}; epoch < ms(60); epoch += ms(5)) {
    config.phase = Phase::at(epoch);
    config.cycle = Pattern(ms(10), {{DataId::everything, 6}});
    begin_at_turn(4);
    run_cycles(20);
    EXPECT_EQ(bus->statistics().startups, 1U);
    EXPECT_EQ(bus->latest().quality(), Quality::fresh);
    bus->stop();
  }
}

TEST_F(BusSilence, NorWhileAWriteHoldsTheBusForLongerThanABoot) {
  Profile quick = test::preset("tm485_17");
  quick.boot_time_min = ms(10);
  config.eeprom_may_hold = true;
  encoder.abm = 4;
  make(quick);
  start();
  ASSERT_TRUE(run_until_running());
  run_cycles(3);
  ASSERT_TRUE(bus->offer(*Request::eeprom_write(1, 2)));
  run(ms(40));
  ASSERT_TRUE(bus->take_completion()->result.has_value());
  EXPECT_EQ(bus->statistics().startups, 1U);
  EXPECT_EQ(bus->latest().quality(), Quality::fresh);
}

}  // namespace
}  // namespace tm485
