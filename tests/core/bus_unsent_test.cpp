// A request that a bus on a port without wire timestamps could not send.
#include <gtest/gtest.h>

#include <utility>

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

// Found by the campaign (seed 485, run 44, with a talker): a request left later than the bus could know, somebody else's bytes
// came before its reply, as many as a reply has, and were taken for proof that it had left long before: T1 was undercut.
TEST_F(BusUnsent, BytesOfSomebodyElseProveNothingOfWhenARequestLeft) {
  port.be_slow(us(100));
  config.cycle = Cycle{DataId::everything, us(170)};
  Time once{0};
  port.lateness = [&] { return std::exchange(once, Time{0}); };
  begin_running();
  for (int delay = 0; delay <= 60; delay += 5) {
    run_cycles(3);
    once = us(delay);
    const std::size_t sent = port.sent.size();
    driver.run(*bus, port, driver.now + ms(2), [&] { return port.sent.size() > sent; });
    port.inject(driver.now + us(6), test::Bytes(11, 0x55));  // as early as a reply could be
    run_cycles(3);
    expect_t1_kept();
    ASSERT_FALSE(HasFailure()) << delay;
  }
}

// Found by the campaign (seed 9, run 1913): the request left late, and the encoder answered within less than its T2. By the
// shortest exchange that the profile allows the request had left earlier than it had.
TEST_F(BusUnsent, AnEncoderThatAnswersTooSoonDoesNotBringTheNextRequestForward) {
  port.be_slow(us(100));
  config.cycle = Cycle{DataId::everything, us(250)};
  Time once{0};
  port.lateness = [&] { return std::exchange(once, Time{0}); };
  begin_running();
  hook = [](const test::Bytes&, Time, test::ScriptedPort::Answer& answer) { answer.t2 = Time{0}; };
  for (int delay = 0; delay <= 60; delay += 5) {
    run_cycles(3);
    once = us(delay);
    const std::size_t sent = port.sent.size();
    driver.run(*bus, port, driver.now + ms(2), [&] { return port.sent.size() > sent; });
    ASSERT_TRUE(bus->offer(*Request::eeprom_read(1))) << delay;
    run_cycles(3);
    ASSERT_TRUE(bus->take_completion().has_value());
    expect_t1_kept();
    ASSERT_FALSE(HasFailure()) << delay;
  }
}

}  // namespace
}  // namespace tm485
