// A hold of the line ends when it says, but T1 is older.
//
// Found by fuzzing the bus: a background request went out shortly before the hold of a free-running grid ended by itself,
// and the next cyclic one followed at that instant, before T1 of the other was over.
#include <gtest/gtest.h>

#include "support/bus_fixture.hpp"

namespace tm485 {
namespace {

using namespace std::chrono_literals;

class BusLineHoldTest : public test::BusTest, public testing::WithParamInterface<Time> {};

TEST_P(BusLineHoldTest, AHoldThatEndsBeforeT1DoesNotLetTheNextRequestOut) {
  config.cycle = Cycle{DataId::everything, GetParam()};
  for (Time until = 1us; until < 100us; until += 1us) {
    port.sent.clear();
    driver.now += 1s;
    begin_running();
    run(GetParam() * 3);
    const std::size_t before = port.sent.size();
    bus->hold_line(driver.now + 150us + until, LineHold::no_cycle);
    run(150us);
    ASSERT_TRUE(bus->offer(*Request::make(DataId::encoder_id)));
    run(1ms);
    ASSERT_GT(port.sent.size(), before + 2);
    ASSERT_NO_FATAL_FAILURE(expect_t1_kept()) << until.count();
  }
}

INSTANTIATE_TEST_SUITE_P(Periods, BusLineHoldTest, testing::Values(62'500ns, 100us, 130us));

}  // namespace
}  // namespace tm485
