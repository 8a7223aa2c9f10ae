// A request that a bus on a port without wire timestamps could not send.
#include <gtest/gtest.h>

#include "support/bus_fixture.hpp"

namespace tm485 {
namespace {

using test::BusTest;
using test::error_of;
using test::ms;
using test::us;

class BusUnsent : public BusTest {};

// Found by the campaign (seed 485, run 846): somebody spoke as an EEPROM write was about to be sent. It was not sent, and its
// 10 ms were kept all the same: no cycle, and a sample that was called fresh meanwhile.
TEST_F(BusUnsent, ARequestThatWasNotSentKeepsNoT1) {
  port.be_slow(us(30));
  config.cycle = Cycle{DataId::everything, us(200)};
  config.eeprom_may_hold = true;
  begin_running();
  run_cycles(5);
  ASSERT_TRUE(bus->offer(*Request::eeprom_write(1, 2)));
  run_cycles(1);  // announces it
  port.inject(driver.now + us(1), {0x55, 0x55});
  const std::size_t sent = port.sent.size();
  std::optional<Completion> completion;
  driver.run(*bus, port, driver.now + ms(5),
             [&] { return (completion = bus->take_completion()).has_value(); });
  ASSERT_TRUE(completion);
  ASSERT_EQ(error_of(completion->result), Errc::line_not_quiet);
  ASSERT_EQ(port.sent.size(), sent) << "nothing was sent";
  const Time failed = driver.now;
  driver.run(*bus, port, driver.now + ms(5), [&] { return port.sent.size() > sent; });
  EXPECT_LE(port.sent.back().start - failed, us(200)) << "the cycle goes on";
}

}  // namespace
}  // namespace tm485
