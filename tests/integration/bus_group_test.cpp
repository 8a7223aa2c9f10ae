// Groups of buses on simulated lines, in virtual time. The encoder model judges T1 and says when it latched.
#include <gtest/gtest.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <optional>
#include <vector>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/axis.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/bus/bus_group.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::ns;
using test::us;

/// What makes one bus different from the next.
struct Wiring {
  const char* profile = "tm485_17";
  Pattern pattern = Cycle{DataId::everything, ns(62'500)};
  Phase phase;
  Time latch_offset{0};
  Time start_jitter{0};
  Time boot_time{0};
  double lost_replies = 0.0;
  double bit_errors = 0.0;
};

/// A bus whose line tells when something arrives.
struct Member {
  Member(const Wiring& setup, std::uint64_t seed)
      : profile(compiled(setup)),
        encoder(options(setup, *this, seed)),
        master(encoder.port(), profile, config(setup)) {}

  static BusConfig config(const Wiring& setup) {
    BusConfig config;
    config.cycle = setup.pattern;
    config.phase = setup.phase;
    return config;
  }
  static CompiledProfile compiled(const Wiring& setup) {
    Profile p = test::preset(setup.profile);
    p.latch_offset = setup.latch_offset;
    return test::compiled(p);
  }
  static sim::SimOptions options(const Wiring& setup, const Member& member, std::uint64_t seed) {
    sim::SimOptions o;
    o.encoder.single_turn_bits = member.profile.profile().single_turn_bits;
    o.encoder.enid = o.encoder.single_turn_bits == 17 ? 0x11 : 0x17;
    o.encoder.latch_offset = setup.latch_offset;
    o.encoder.boot_time = setup.boot_time;
    o.encoder.seed = seed;
    o.motion = sim::MotionProfile::constant(100.0 * static_cast<double>(seed % 30));
    o.port = {.start_jitter = setup.start_jitter, .jitter_margin = setup.start_jitter, .seed = seed};
    o.lost_replies = setup.lost_replies;
    o.reply_bit_errors = setup.bit_errors;
    o.request_bit_errors = setup.bit_errors;
    o.seed = seed;
    return o;
  }

  Time poll(Time now) noexcept {
    const std::uint32_t before = bus().record_count();
    const Time due = bus().poll(now);
    if (bus().record_count() != before && bus().last_record().kind == CycleRecord::Kind::cyclic) {
      starts.push_back(bus().last_record().start);
      latches.push_back(encoder.model().last_latch().time);
    }
    const Time event = encoder.line().next_event();
    return event > now ? std::min(due, event) : due;
  }
  Bus<sim::SimPort>& bus() noexcept { return master; }
  const Bus<sim::SimPort>& bus() const noexcept { return master; }
  const Statistics& statistics() const { return bus().statistics(); }
  void expect_nothing_missed() {
    EXPECT_EQ(encoder.model().t1().violations(), 0U);
    EXPECT_EQ(statistics().skipped, 0U);
    EXPECT_EQ(statistics().slips, 0U);
    EXPECT_EQ(statistics().good, statistics().cycles);
    EXPECT_GT(statistics().good, 0U);
  }

  CompiledProfile profile;
  sim::SimulatedEncoder encoder;
  Bus<sim::SimPort> master;
  std::vector<Time> starts;
  std::vector<Time> latches;
};

/// The same without anyone who tells: the group looks again and again.
struct SilentMember : Member {
  using Member::Member;
  Time poll(Time now) noexcept { return bus().poll(now); }
  Time reply_expected() const noexcept { return bus().reply_expected(); }
};

template <class M>
struct GroupWorld {
  static constexpr std::size_t kCapacity = 64;
  explicit GroupWorld(const std::vector<Wiring>& setups, const GroupConfig& config = {}) : group(config) {
    for (const Wiring& setup : setups) {
      M& member = members.emplace_back(setup, members.size() + 1);
      EXPECT_TRUE(member.bus().start(now));
      EXPECT_TRUE(group.add(member));
    }
  }
  void run_until(Time end) {
    for (;;) {
      const Time due = group.poll(now);
      if (due > end) break;
      now = std::max(now, due);
    }
    now = end;
  }

  std::deque<M> members;
  BusGroup<M, kCapacity> group;
  Time now{0};
};
using World = GroupWorld<Member>;

const Pattern kMixed(us(40), {{DataId::single_turn, 6}, {DataId::everything, 1, 2}});

std::vector<Wiring> staggered(std::size_t n) {
  std::vector<Wiring> setups(n);
  for (std::size_t i = 0; i < n; ++i) {
    setups[i].profile = i % 2 == 0 ? "tm485_17" : "tm485_23";
    setups[i].phase = Phase::at(stagger(i, n, ns(62'500)));
  }
  return setups;
}

class OfSize : public testing::TestWithParam<std::size_t> {};

TEST_P(OfSize, NoSlotIsMissedAndT1IsKeptOnEveryBus) {
  World world(staggered(GetParam()));
  world.run_until(ms(100));
  for (Member& member : world.members) {
    member.expect_nothing_missed();
    EXPECT_NEAR(member.statistics().cycles, world.members.front().statistics().cycles, 1);
    EXPECT_GT(member.statistics().cycles, 1'000U);
    EXPECT_EQ(member.statistics().t1.maximum(), ns(62'500));
    EXPECT_EQ(member.statistics().t1.minimum(), ns(62'500));
  }
  EXPECT_EQ(world.group.latest_poll(), ns(0));
}
INSTANTIATE_TEST_SUITE_P(Each, OfSize, testing::Values(1, 2, 7, World::kCapacity),
                         [](const auto& row) { return std::to_string(row.param); });

TEST(BusGroupOnSim, EachBusHasItsOwnPatternAndPeriod) {
  std::vector<Wiring> setups(6);
  setups[0].pattern = Cycle{DataId::single_turn, us(40)};
  setups[1].pattern = kMixed;
  setups[2].pattern = Cycle{DataId::everything, ms(1)};
  setups[3].pattern = Cycle{DataId::multi_turn, us(51)};
  setups[4].profile = "tm485_23";
  setups[5].pattern = Cycle{DataId::everything, ns(0)};
  World world(setups);
  world.run_until(ms(200));
  for (Member& member : world.members) member.expect_nothing_missed();
}

TEST(BusGroupOnSim, PortsThatTellNothingAreLookedAtUntilTheReplyIsThere) {
  GroupWorld<SilentMember> world(staggered(16), {.look_again = ns(250)});
  world.run_until(ms(50));
  for (SilentMember& member : world.members) {
    member.expect_nothing_missed();
    const CycleRecord& record = member.bus().last_record();
    const Time arrived = record.start + us(4) + record.reply_delay + us(44);
    EXPECT_GE(record.seen, arrived);
    EXPECT_LE(record.seen - arrived, ns(250));
  }
}

TEST(BusGroupOnSim, StaggeredStartsAreSpreadEvenlyOverThePeriod) {
  constexpr std::size_t kBuses = 25;
  World world(staggered(kBuses));
  world.run_until(ms(20));
  std::vector<Time> phases;
  for (const Member& member : world.members) phases.push_back(member.starts.back() % ns(62'500));
  std::sort(phases.begin(), phases.end());
  for (std::size_t i = 1; i < kBuses; ++i) EXPECT_EQ(phases[i] - phases[i - 1], ns(2'500)) << i;
}

std::vector<Wiring> aligned(std::size_t n) {
  std::vector<Wiring> setups = staggered(n);
  for (std::size_t i = 0; i < n; ++i) {
    setups[i].phase = Phase::at(us(17));
    setups[i].latch_offset = ns(static_cast<std::int64_t>(i) * 100);  // the starts differ, the latches do not
  }
  return setups;
}
constexpr GroupConfig kAligned{.round = Time{62'500}, .epoch = Time{17'000}};

TEST(BusGroupOnSim, AlignedBusesLatchAtOneInstant) {
  World world(aligned(20), kAligned);
  world.run_until(us(50'020));
  ASSERT_TRUE(world.group.skew());
  const LatchSkew& skew = *world.group.skew();
  EXPECT_EQ(skew.skew().maximum(), ns(0));
  EXPECT_GT(skew.skew().count(), 700U);
  EXPECT_LE(skew.incomplete(), 1U) << "the round in which they start";
  for (Member& member : world.members) {
    member.expect_nothing_missed();
    EXPECT_EQ(member.latches.back(), world.members.front().latches.back());
    EXPECT_EQ((member.latches.back() - us(17)) % ns(62'500), ns(0));
  }
  EXPECT_EQ(world.members[0].starts.back() - world.members[19].starts.back(), ns(1'900));
}

TEST(BusGroupOnSim, TheSkewIsWhatTheEncodersSawOfThePortsJitter) {
  std::vector<Wiring> setups = aligned(3);
  for (Wiring& setup : setups) setup.pattern = Cycle{DataId::everything, ns(70'000)};
  setups[1].start_jitter = ns(300);
  setups[2].start_jitter = ns(900);
  World world(setups, {.round = us(70), .epoch = us(17)});
  world.run_until(ms(70));
  const LatchSkew& skew = *world.group.skew();
  Time largest{0};
  Time smallest = kNever;
  std::uint32_t rounds = 0;
  // From the end, where all are in step.
  const std::size_t n = std::min({world.members[0].latches.size(), world.members[1].latches.size(),
                                  world.members[2].latches.size()}) -
                        1;
  for (std::size_t back = 1; back <= n; ++back) {
    Time earliest = kNever;
    Time latest{0};
    for (const Member& member : world.members) {
      const Time latch = member.latches[member.latches.size() - back];
      earliest = std::min(earliest, latch);
      latest = std::max(latest, latch);
    }
    ASSERT_LT(latest - earliest, us(1)) << "not the same round";
    largest = std::max(largest, latest - earliest);
    smallest = std::min(smallest, latest - earliest);
    ++rounds;
  }
  EXPECT_GT(rounds, 900U);
  EXPECT_GT(largest, ns(800));
  EXPECT_LE(largest, ns(900));
  EXPECT_EQ(skew.skew().maximum(), largest);
  EXPECT_LE(skew.skew().minimum(), smallest);
  EXPECT_NEAR(skew.skew().count(), rounds, 2);
}

TEST(BusGroupOnSim, APatternsOtherStepsAreNoPartOfTheSkew) {
  std::vector<Wiring> setups = aligned(4);
  for (Wiring& setup : setups) setup.pattern = kMixed;
  World world(setups, {.round = us(320), .epoch = us(17)});
  world.run_until(ms(64));
  EXPECT_EQ(world.group.skew()->skew().maximum(), ns(0));
  EXPECT_NEAR(world.group.skew()->skew().count(), 200, 10);
  EXPECT_LE(world.group.skew()->incomplete(), 1U);
}

TEST(BusGroupOnSim, ARoundWithoutAReplyIsIncomplete) {
  std::vector<Wiring> setups = aligned(5);
  setups[2].lost_replies = 0.01;
  World world(setups, kAligned);
  world.run_until(us(100'020));
  const std::uint32_t failed = world.members[2].statistics().failed;
  EXPECT_GT(failed, 5U);
  EXPECT_NEAR(world.group.skew()->incomplete(), failed, 1);
  EXPECT_GT(world.group.skew()->skew().count(), 1'400U);
}

// The good ones have the same history to the last cycle, whoever else is in the group.
TEST(BusGroupOnSim, BusesThatFailAreSlowOrNeverAnswerDoNotDisturbTheOthers) {
  std::vector<Wiring> setups = aligned(8);
  World alone(setups, kAligned);
  setups[1].boot_time = std::chrono::hours(1);  // never answers
  setups[3].lost_replies = 0.3;
  setups[4].bit_errors = 1e-2;
  setups[6].boot_time = ms(40);  // comes late
  World disturbed(setups, kAligned);
  alone.run_until(ms(120));
  disturbed.run_until(ms(120));
  for (const std::size_t i : {0U, 2U, 5U, 7U}) {
    disturbed.members[i].expect_nothing_missed();
    EXPECT_EQ(disturbed.members[i].starts, alone.members[i].starts) << i;
  }
  EXPECT_EQ(disturbed.members[1].statistics().good, 0U);
  EXPECT_GT(disturbed.members[1].statistics().startup_failures + disturbed.members[1].statistics().errors[1],
            10U);
  EXPECT_GT(disturbed.members[3].statistics().failed, 100U);
  EXPECT_GT(disturbed.members[4].statistics().failed, 100U);
  EXPECT_GT(disturbed.members[6].statistics().good, 100U);
  for (Member& member : disturbed.members) EXPECT_EQ(member.encoder.model().t1().violations(), 0U);
  const LatchSkew& skew = *disturbed.group.skew();
  EXPECT_EQ(skew.skew().count(), alone.group.skew()->skew().count() - 1)
      << "the last may still become complete";
  EXPECT_EQ(skew.incomplete(), skew.skew().count());
  EXPECT_EQ(skew.skew().maximum(), ns(0));
  EXPECT_EQ(disturbed.group.latest_poll(), ns(0));
}

TEST(BusGroupOnSim, AMemberCanBeStoppedAndStartedAgain) {
  World world(aligned(3), kAligned);
  world.run_until(ms(20));
  const std::uint32_t before = world.group.skew()->incomplete();
  Member& member = world.members[1];
  member.bus().stop();
  world.group.wake(1);
  const std::uint32_t cycles = member.statistics().cycles;
  world.run_until(ms(30));
  EXPECT_EQ(member.statistics().cycles, cycles);
  const std::uint32_t without = world.group.skew()->incomplete() - before;
  EXPECT_NEAR(without, 160, 2);
  ASSERT_TRUE(member.bus().start(world.now));
  world.group.wake(1);
  world.run_until(ms(50));
  EXPECT_GT(member.statistics().cycles, cycles + 250);
  EXPECT_EQ(member.encoder.model().t1().violations(), 0U);
  EXPECT_LT(world.group.skew()->incomplete() - before, without + 40) << "complete again";
  EXPECT_EQ(world.group.skew()->skew().maximum(), ns(0));
  world.members[0].expect_nothing_missed();
  world.members[2].expect_nothing_missed();
}

// Nobody tells the group of commands and servo ticks: an axis sees them when its bus is polled anyway.
TEST(BusGroupOnSim, AnAxisIsAMemberToo) {
  sim::SimulatedEncoder encoders[2];
  const CompiledProfile profile = test::compiled("tm485_17");
  Axis<sim::SimPort> first(encoders[0].port(), profile, {});
  Axis<sim::SimPort> second(encoders[1].port(), profile, {});
  struct AxisMember {
    Axis<sim::SimPort>* axis;
    Time poll(Time now) noexcept { return axis->poll(now); }
    Time reply_expected() const noexcept { return axis->bus().reply_expected(); }
    const Bus<sim::SimPort>& bus() const noexcept { return axis->bus(); }
  };
  static_assert(Pollable<Axis<sim::SimPort>> && Pollable<Bus<sim::SimPort>>);
  AxisMember members[2] = {{&first}, {&second}};
  BusGroup<AxisMember, 2> group;
  Time now{0};
  for (AxisMember& member : members) {
    ASSERT_TRUE(member.axis->start(now));
    ASSERT_TRUE(group.add(member));
  }
  const auto run_until = [&](Time end) {
    while (now < end) now = std::max(now, group.poll(now));
  };
  run_until(ms(20));
  ASSERT_EQ(first.client().latest().quality(), Quality::fresh);
  ASSERT_EQ(second.client().latest().quality(), Quality::fresh);
  ASSERT_TRUE(second.client().post(Command::of(Command::Kind::set_referenced)));
  run_until(ms(21));
  const auto result = second.client().poll_completion();
  ASSERT_TRUE(result);
  EXPECT_EQ(result->error, Errc::ok);
}

}  // namespace
}  // namespace tm485
