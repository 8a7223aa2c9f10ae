// Scheduler: refusals with the nearest period, free and phase-locked grids, and the property that counts.
#include "tm485/bus/scheduler.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"

namespace tm485 {
namespace {

using test::compiled;
using test::ms;
using test::ns;
using test::us;

const CompiledProfile& profile() {
  static const CompiledProfile kProfile = compiled("tm485_17");
  return kProfile;
}
PortCapability margin(Time jitter) {
  PortCapability port;
  port.jitter_margin = jitter;
  return port;
}
Scheduler made(DataId id, Time period, Time jitter = Time{0}) {
  return *Scheduler::make(Cycle{id, period}, profile(), margin(jitter));
}

void expect_refused(const Cycle& cycle, const PortCapability& port, Errc code, Time nearest) {
  const auto result = Scheduler::make(cycle, profile(), port);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, code);
  EXPECT_EQ(result.error().nearest, nearest);
  if (code == Errc::bad_argument) return;
  EXPECT_TRUE(Scheduler::make(Cycle{cycle.id, nearest}, profile(), port)) << "the nearest is possible";
  EXPECT_FALSE(Scheduler::make(Cycle{cycle.id, nearest - ns(1)}, profile(), port)) << "and nothing shorter";
}

TEST(Scheduler, RefusesWithTheNearestPossible) {
  PortCapability slow;
  slow.shortest_exchange = us(1'000);
  expect_refused({DataId::everything, ns(62'499)}, {}, Errc::period_below_t1, ns(62'500));
  expect_refused({DataId::single_turn, ns(39'999)}, {}, Errc::period_below_t1, us(40));
  expect_refused({DataId::everything, us(100)}, slow, Errc::period_below_port, us(1'000));
  expect_refused({DataId::everything, us(10)}, slow, Errc::period_below_t1, us(1'000));
  expect_refused({DataId::everything, ns(-1)}, {}, Errc::period_below_t1, ns(62'500));
  expect_refused({DataId::everything, std::chrono::hours(2)}, {}, Errc::bad_argument, std::chrono::hours(1));
  for (const DataId id : kDataIds)
    if (number(id) > 3) expect_refused({id, ms(20)}, {}, Errc::bad_argument, ns(0));
  const auto nothing = Scheduler::make(Pattern{us(70), {}}, Phase{}, profile(), {});
  ASSERT_FALSE(nothing);
  EXPECT_EQ(nothing.error().nearest, Time{0}) << "no slot would help";
}

TEST(Scheduler, APatternOfMoreThanAnHourIsRefused) {
  const auto made_of = [](Time slot) {
    return Scheduler::make(Pattern(slot, {{DataId::everything, 2, 3}}), Phase{}, profile(), PortCapability{});
  };
  const auto refused = made_of(std::chrono::minutes(30));
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, Errc::bad_argument);
  EXPECT_EQ(refused.error().nearest, std::chrono::minutes(10));
  EXPECT_TRUE(made_of(std::chrono::minutes(10)));
  EXPECT_FALSE(made_of(std::chrono::minutes(10) + ns(1)));
}

TEST(Scheduler, PeriodZeroIsTheShortestPossible) {
  EXPECT_EQ(made(DataId::everything, ns(0)).period(), ns(62'500));
  EXPECT_EQ(made(DataId::single_turn, ns(0)).period(), us(40));
  PortCapability slow;
  slow.shortest_exchange = us(1'000);
  EXPECT_EQ(Scheduler::make(Cycle{}, profile(), slow)->period(), us(1'000));
}

TEST(Scheduler, RunsFreeBelowT1PlusTheMargin) {
  EXPECT_TRUE(made(DataId::everything, ns(62'500)).free_running()) << "no slack: any lateness moves the grid";
  EXPECT_FALSE(made(DataId::everything, ns(62'501)).free_running());
  EXPECT_TRUE(made(DataId::everything, ns(62'500), us(1)).free_running());
  EXPECT_TRUE(made(DataId::everything, ns(63'499), us(1)).free_running());
  EXPECT_FALSE(made(DataId::everything, ns(63'500), us(1)).free_running());
}

TEST(Scheduler, FreeALateStartMovesTheGrid) {
  Statistics statistics;
  Scheduler scheduler = made(DataId::everything, ns(62'500), us(1));
  scheduler.begin(us(10));
  scheduler.on_start(us(10), statistics);
  EXPECT_EQ(scheduler.slot(), ns(72'500));
  scheduler.on_start(ns(73'500), statistics);
  EXPECT_EQ(statistics.slips, 0U) << "within the margin";
  EXPECT_EQ(scheduler.slot(), ns(136'000));
  scheduler.on_start(ns(137'001), statistics);
  EXPECT_EQ(statistics.slips, 1U) << "one nanosecond beyond it";
  EXPECT_EQ(scheduler.slot(), ns(199'501));
  EXPECT_EQ(statistics.skipped, 0U);
}

TEST(Scheduler, PhaseLockedKeepsItsGrid) {
  Statistics statistics;
  Scheduler scheduler = made(DataId::everything, us(100), us(1));
  scheduler.begin(us(0));
  scheduler.on_start(us(1), statistics);
  EXPECT_EQ(scheduler.slot(), us(100));
  scheduler.on_start(us(130), statistics);  // late, but T1 lets the next one start in its slot
  EXPECT_EQ(scheduler.slot(), us(200));
  EXPECT_EQ(statistics.skipped, 0U);
  scheduler.on_start(ns(238'500), statistics);  // T1 ends at 301: within the margin of the slot at 300
  EXPECT_EQ(scheduler.slot(), us(300));
  EXPECT_EQ(statistics.skipped, 0U);
  scheduler.on_start(ns(338'501), statistics);  // one nanosecond too late for the slot at 400
  EXPECT_EQ(scheduler.slot(), us(500));
  EXPECT_EQ(statistics.skipped, 1U);
}

TEST(Scheduler, PhaseLockedAStallIsSkippedAndNotCaughtUp) {
  Statistics statistics;
  Scheduler scheduler = made(DataId::everything, us(100), us(1));
  scheduler.begin(us(0));
  scheduler.on_start(us(0), statistics);
  scheduler.on_start(us(1'005), statistics);  // slots 100..900 passed, 1000 was used
  EXPECT_EQ(statistics.skipped, 9U);
  EXPECT_EQ(scheduler.slot(), us(1'100));
  scheduler.on_start(us(1'100), statistics);
  EXPECT_EQ(scheduler.slot(), us(1'200)) << "no burst to make up for them";
  EXPECT_EQ(statistics.slips, 0U);
}

TEST(Scheduler, AnUnusedSlotMovesOnOne) {
  Statistics statistics;
  Scheduler scheduler = made(DataId::everything, us(100));
  scheduler.begin(us(0));
  scheduler.on_unused(us(5), statistics);
  EXPECT_EQ(scheduler.slot(), us(100));
  EXPECT_EQ(statistics.skipped, 0U);
  scheduler.on_unused(us(350), statistics);
  EXPECT_EQ(scheduler.slot(), us(400));
  EXPECT_EQ(statistics.skipped, 2U);
}

TEST(Scheduler, AStallOfAnHourSaturates) {
  Statistics statistics;
  statistics.skipped = 0xFFFFFFF0;
  Scheduler scheduler = made(DataId::everything, us(100));
  scheduler.begin(us(0));
  scheduler.on_start(std::chrono::hours(1), statistics);
  EXPECT_EQ(statistics.skipped, 0xFFFFFFFFU);
  EXPECT_EQ(scheduler.slot(), Time(std::chrono::hours(1)) + us(100));
}

TEST(Scheduler, HasAGapOnlyIfBothFit) {
  EXPECT_FALSE(made(DataId::everything, ns(62'500)).has_gap_for(us(40)));
  EXPECT_FALSE(made(DataId::everything, ns(102'499)).has_gap_for(us(40)));
  EXPECT_TRUE(made(DataId::everything, ns(102'500)).has_gap_for(us(40)));
}

struct Grid {
  const char* name;
  DataId id;
  Time period;
  Time jitter;
};
class SchedulerProperty : public testing::TestWithParam<Grid> {};

// A million cycles of a host that is late by nothing, a little, or a stall: no two starts closer than T1, phase-locked
// slots stay on the grid and each is used once or skipped once, free ones follow the start.
TEST_P(SchedulerProperty, KeepsT1AndPhaseWhateverTheHostDoes) {
  const auto& [label, id, period, jitter] = GetParam();
  Statistics statistics;
  Scheduler scheduler = made(id, period, jitter);
  RequestSpacing spacing;
  const Time t1 = profile().t1(id);
  const Time origin = us(7);
  scheduler.begin(origin);
  test::Rng rng(50);
  Time previous = -kNever;
  std::int64_t last_slot = -1;
  std::uint64_t slips = 0;
  const int kCycles = 1'000'000;
  for (int cycle = 0; cycle < kCycles; ++cycle) {
    const Time slot = scheduler.slot();
    Time late{
        static_cast<std::int64_t>(test::random_below(rng, static_cast<std::size_t>(jitter.count() + 1)))};
    if (test::random_below(rng, 50) == 0)
      late = Time{static_cast<std::int64_t>(test::random_below(rng, 400'000))};
    const Time start = std::max(slot, spacing.earliest()) + late;
    ASSERT_GE(start - previous, t1) << cycle;
    previous = start;
    if (scheduler.free_running()) {
      slips += start - slot > jitter ? 1U : 0U;
    } else {
      ASSERT_EQ((slot - origin) % period, Time{0}) << cycle;
      const std::int64_t used = (start - origin) / period;  // the slot that this start belongs to
      ASSERT_GT(used, last_slot) << "two starts in one slot";
      last_slot = used;
    }
    spacing.on_start(start, t1);
    scheduler.on_start(start, statistics);
    ASSERT_GT(scheduler.slot(), slot);
  }
  if (scheduler.free_running()) {
    EXPECT_EQ(statistics.slips, slips);
    EXPECT_GT(slips, 0U);
    EXPECT_EQ(statistics.skipped, 0U);
  } else {
    // Used and skipped slots add up to all that have passed.
    EXPECT_EQ((scheduler.slot() - origin) / period, std::int64_t{kCycles} + statistics.skipped);
    if (period < us(400)) {
      EXPECT_GT(statistics.skipped, 0U);
    }
    EXPECT_EQ(statistics.slips, 0U);
  }
}
INSTANTIATE_TEST_SUITE_P(Grids, SchedulerProperty,
                         testing::Values(Grid{"Id3AtT1", DataId::everything, ns(62'500), ns(0)},
                                         Grid{"Id3FreeAtT1", DataId::everything, ns(62'500), us(2)},
                                         Grid{"Id3FreeAbove", DataId::everything, us(64), us(2)},
                                         Grid{"Id3PhaseAtTheEdge", DataId::everything, ns(64'500), us(2)},
                                         Grid{"Id3Phase100", DataId::everything, us(100), us(5)},
                                         Grid{"Id0Free", DataId::single_turn, us(40), us(1)},
                                         Grid{"Id0Phase125", DataId::single_turn, us(125), us(10)},
                                         Grid{"Id2Phase1000", DataId::encoder_id, us(1'000), us(0)}),
                         [](const auto& row) { return std::string(row.param.name); });

TEST(RequestSpacing, AReplyThatCameLateMovesTheBoundAndAnEarlyOneDoesNot) {
  RequestSpacing spacing;
  spacing.on_start(us(100), us(40));
  EXPECT_EQ(spacing.earliest(), us(140));
  spacing.on_reply_seen(us(130), us(30), us(40));
  EXPECT_EQ(spacing.earliest(), us(140));
  spacing.on_reply_seen(us(150), us(30), us(40));  // it cannot have started before 120
  EXPECT_EQ(spacing.earliest(), us(160));
}

}  // namespace
}  // namespace tm485
