#include "tm485/sim/sim_port.hpp"

#include <gtest/gtest.h>

#include <array>

#include "ask.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::sim {
namespace {

using State = Transmission::State;

TEST(SimPort, StatesItsCapability) {
  Line line{nullptr};
  const SimPort port{line, {.release = Time{300}, .jitter_margin = us(2)}};
  EXPECT_EQ(port.capability().shortest_exchange, Time{0});
  EXPECT_EQ(port.capability().latency_allowance, Time{0});
  EXPECT_EQ(port.capability().jitter_margin, us(2));
  EXPECT_EQ(port.capability().release_bound, Time{300});
  EXPECT_TRUE(port.capability().wire_timestamps);
  EXPECT_EQ(port.capability().timing, TimingClass::hard);
}

TEST(SimPort, IsIdleBeforeTheFirstRequest) {
  Line line{nullptr};
  EXPECT_EQ(SimPort{line}.transmission(us(1)).state, State::idle);
}

TEST(SimPort, ASendIsCompleteWhenTheDriverIsReleased) {
  Line line{nullptr};
  SimPort port{line, {.release = Time{300}}};
  const Bytes request{0xEA, 0x05, 0xEF};
  EXPECT_EQ(port.try_send(request, us(10)).value(), us(10));
  EXPECT_EQ(port.transmission(us(22) + Time{299}).state, State::sending);
  EXPECT_EQ(port.transmission(us(22) + Time{300}).state, State::sent);
}

TEST(SimPort, RefusesEmptyLongAndOverlappingRequests) {
  Line line{nullptr};
  SimPort port{line};
  const Bytes request{0x1A};
  EXPECT_EQ(port.try_send({}, us(0)).error(), Errc::send_failed);
  EXPECT_EQ(port.try_send(Bytes(5, 0x1A), us(0)).error(), Errc::send_failed);
  EXPECT_TRUE(port.try_send(request, us(0)).has_value());
  EXPECT_EQ(port.try_send(request, us(4)).error(), Errc::send_failed);
}

TEST(SimPort, IsGoneFromTheInstantItIsUnplugged) {
  SimulatedEncoder simulated{};
  SimPort& port = simulated.port();
  const Bytes request{0x1A};
  std::array<std::uint8_t, 32> buffer{};
  port.unplug(us(100));
  ASSERT_TRUE(port.try_send(request, us(0)).has_value());
  EXPECT_EQ(port.try_receive(buffer, us(99)).fault, Errc::ok);
  EXPECT_EQ(port.transmission(us(99)).state, State::sent);
  EXPECT_EQ(port.try_receive(buffer, us(100)).fault, Errc::port_gone);
  EXPECT_EQ(port.transmission(us(100)).fault, Errc::port_gone);
  EXPECT_EQ(port.try_send(request, us(101)).error(), Errc::port_gone);
}

TEST(SimPort, ReceivesWithExactWireTimes) {
  SimOptions options;
  options.encoder.t2_min = options.encoder.t2_max = Time{2'950};
  SimulatedEncoder simulated{options};
  const Bytes request{0x1A};
  ASSERT_TRUE(simulated.port().try_send(request, us(0)).has_value());
  const Time end = simulated.line().next_event();
  EXPECT_EQ(end, Time{4'000 + 2'950 + 44'000});
  std::array<std::uint8_t, 32> buffer{};
  EXPECT_EQ(simulated.port().try_receive(buffer, us(5)).count, 0u);
  const Reception reception = simulated.port().try_receive(buffer, end);
  EXPECT_EQ(reception.count, 11u);
  EXPECT_EQ(reception.first_start, Time{6'950});
  EXPECT_EQ(reception.fault, Errc::ok);
}

TEST(SimPort, JitterDelaysByUpToItsBoundAndIsReported) {
  SimOptions options;
  options.port.start_jitter = us(2);
  SimulatedEncoder simulated{options};
  const Bytes request{0x02};
  Time longest{0};
  for (int cycle = 0; cycle < 1000; ++cycle) {
    const Time asked = us(100) * cycle;
    const Time late = simulated.port().try_send(request, asked).value() - asked;
    ASSERT_GE(late, Time{0});
    ASSERT_LE(late, us(2));
    longest = std::max(longest, late);
  }
  EXPECT_GT(longest, Time{1'900});
}

TEST(SimPort, ALateReleaseBecomesAFramingError) {
  SimOptions options;
  options.port.release = us(5);
  SimulatedEncoder simulated{options};
  const Bytes request{0x02};
  ASSERT_TRUE(simulated.port().try_send(request, us(0)).has_value());
  std::array<std::uint8_t, 32> buffer{};
  EXPECT_EQ(simulated.port().try_receive(buffer, us(100)).fault, Errc::framing_error);
}

TEST(SimPort, UnfetchedBytesBecomeAnOverrun) {
  SimulatedEncoder simulated;
  const Bytes request{0x02};
  for (std::uint32_t cycle = 0; cycle < 2 * Line::kBursts; ++cycle) {
    ASSERT_TRUE(simulated.port().try_send(request, us(100) * cycle).has_value());
  }
  std::array<std::uint8_t, 32> buffer{};
  EXPECT_EQ(simulated.port().try_receive(buffer, ms(100)).fault, Errc::overrun);
}

}  // namespace
}  // namespace tm485::sim
