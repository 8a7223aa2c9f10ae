// Spans that nobody means are refused before anything is added to them.
//
// Found by fuzzing the C interface: a port that stated a latency allowance of 2^62 ns and more let the shape of a
// histogram be sought by shifting beyond 64 bits, on some processors for ever. And a port with a jitter margin longer than
// half a revolution at full speed let check() divide by zero, where the pattern needs no unwrapping at all.
#include <gtest/gtest.h>

#include "support/bus_fixture.hpp"

namespace tm485 {
namespace {

using test::BusTest;

constexpr Time kWild[] = {Time{-1}, Time{std::chrono::hours(1)} + Time{1}, Time::max(), Time::min()};

class BusConfigTest : public BusTest {
 protected:
  Errc start_error() {
    make();
    const auto checked = bus->check();
    const auto started = bus->start(Time{0});
    EXPECT_EQ(checked.has_value(), started.has_value());
    return started ? Errc::ok : started.error().code;
  }
};

TEST_F(BusConfigTest, ASpanOfThePortBelowZeroOrAboveAnHourIsRefused) {
  for (Time PortCapability::* const span :
       {&PortCapability::shortest_exchange, &PortCapability::jitter_margin,
        &PortCapability::latency_allowance, &PortCapability::release_bound}) {
    for (const Time wild : kWild) {
      port.capability_ = {.wire_timestamps = false};
      port.capability_.*span = wild;
      EXPECT_EQ(start_error(), Errc::bad_argument) << wild.count();
    }
    port.capability_ = {.wire_timestamps = false};
    port.capability_.*span = Time{0};
    EXPECT_EQ(start_error(), Errc::ok);
  }
  port.capability_.latency_allowance = std::chrono::hours(1);
  EXPECT_EQ(start_error(), Errc::ok);
  EXPECT_LE(bus->statistics().reply_delay.histogram().shift, Histogram::kMostShift) << "a shift of 32 bits";
}

TEST_F(BusConfigTest, ASpanOfTheBusBelowZeroOrAboveAnHourIsRefused) {
  for (Time BusConfig::* const span : {&BusConfig::max_hold, &BusConfig::lost_after}) {
    for (const Time wild : kWild) {
      config = {};
      config.*span = wild;
      EXPECT_EQ(start_error(), Errc::bad_argument) << wild.count();
    }
    config = {};
    config.*span = std::chrono::hours(1);
    EXPECT_EQ(start_error(), Errc::ok);
  }
}

TEST_F(BusConfigTest, AnEpochBeyondNeverIsRefused) {
  config.phase = Phase::at(kNever + Time{1});
  EXPECT_EQ(start_error(), Errc::bad_argument);
  config.phase = Phase::at(-kNever - Time{1});
  EXPECT_EQ(start_error(), Errc::bad_argument);
  config.phase = Phase::at(-kNever);
  EXPECT_EQ(start_error(), Errc::ok);
}

TEST_F(BusConfigTest, AMarginBeyondHalfARevolutionIsNoMatterWhereNothingIsUnwrapped) {
  config.cycle = Pattern(std::chrono::seconds(2), {{DataId::everything, 1, 1}});
  port.capability_.jitter_margin = std::chrono::milliseconds(500);
  EXPECT_EQ(start_error(), Errc::ok);
}

TEST_F(BusConfigTest, ASlotBelowZeroIsBelowT1AndNamesTheShortest) {
  for (const Time slot : {Time{-1}, Time{-1'008'806'316'530'991'104}, Time::min()}) {
    config.cycle = Pattern(slot, {{DataId::everything, 1, 255}});
    EXPECT_EQ(start_error(), Errc::period_below_t1) << slot.count();
    EXPECT_GT(bus->check().error().nearest, Time{0});
  }
}

TEST_F(BusConfigTest, ABusWithoutACycleIsJudgedAlike) {
  config.cycle.reset();
  config.max_hold = Time{-1};
  EXPECT_EQ(start_error(), Errc::bad_argument);
}

}  // namespace
}  // namespace tm485
