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

}  // namespace
}  // namespace tm485
