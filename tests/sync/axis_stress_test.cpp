// An axis with its contexts in threads of their own: the bus in virtual time, as fast as it goes; the loop, which reads,
// posts and ticks; and a third thread that reads statistics. What the loop gets is whole, and every command comes back
// exactly once.
#include <gtest/gtest.h>

#include <atomic>
#include <memory>
#include <set>
#include <thread>

#include "sync/checked.hpp"
#include "tm485/bus/axis.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::test {
namespace {

constexpr std::uint32_t kCycles = 60'000;

struct World {
  World()
      : profile(*CompiledProfile::compile(*find_profile("tm485_17"))),
        encoder(*sim::parse_sim_options("profile=tm485_17,rpm=3000,lost=0.001")),
        axis(encoder.port(), profile, setup()) {}

  static AxisSetup setup() {
    AxisSetup s;
    s.bus.cycle = Cycle{DataId::everything, Time{110'000}};
    s.bus.phase = Phase::locked_to({Time{110'000}, Time{60'000}});
    s.bus.max_hold = std::chrono::milliseconds(50);
    s.statistics_every = Time{1'000'000};
    return s;
  }

  /// The bus's context.
  void run_bus() {
    Time at{0};
    while (axis.bus().statistics().cycles < kCycles) {
      const Time due = axis.poll(at);
      const Time event = encoder.line().next_event();
      at = std::max(at, event > at ? std::min(due, event) : due);
      now.store(at.count(), std::memory_order_relaxed);
    }
    axis.stop(at);
    done.store(true);
  }

  CompiledProfile profile;
  sim::SimulatedEncoder encoder;
  Axis<sim::SimPort> axis;
  std::atomic<std::int64_t> now{0};
  std::atomic<bool> done{false};
};

TEST(AxisStress, WhatTheLoopGetsIsWholeAndEveryCommandComesBackOnce) {
  const auto world = std::make_unique<World>();
  const sim::MotionProfile motion = sim::MotionProfile::constant(3'000.0);
  ASSERT_TRUE(world->axis.start(Time{0}));
  AxisClient& client = world->axis.client();
  std::thread bus([&] { world->run_bus(); });
  std::atomic<std::uint32_t> published{0};
  std::thread observer([&] {
    std::uint32_t last = 0;
    Statistics seen;
    while (!world->done.load()) {
      if (!client.statistics(seen)) continue;
      EXPECT_GE(seen.cycles, last);
      EXPECT_EQ(seen.cycles, seen.good + seen.failed) << "a whole copy";
      last = seen.cycles;
      std::this_thread::yield();
    }
    published.store(last);
  });

  Dice dice(7);
  std::set<std::uint32_t> open;
  std::uint32_t posted = 0;
  std::uint32_t fresh = 0;
  std::uint32_t wrong = 0;
  std::uint32_t twice = 0;
  Time last_latch{0};
  const auto take = [&] {
    while (const auto result = client.poll_completion()) twice += open.erase(result->ticket) == 1 ? 0U : 1U;
  };
  while (!world->done.load()) {
    const Time now{world->now.load(std::memory_order_relaxed)};
    const LoopState state = client.read(now);
    if (state.usable()) {
      const Sample& sample = *state.sample;
      // Position, single-turn and latch time belong together only if they came over in one piece.
      wrong += sample.position() != motion.counts(sample.latch_time(), 17) ? 1U : 0U;
      wrong += sample.single_turn() != (static_cast<std::uint32_t>(sample.position()) & 0x1FFFFU) ? 1U : 0U;
      wrong += sample.latch_time() < last_latch ? 1U : 0U;
      last_latch = sample.latch_time();
      fresh += state.validity == SampleValidity::fresh ? 1U : 0U;
    }
    client.servo_tick(now);
    if (dice.roll(4) == 0) {
      const auto ticket =
          client.post(dice.roll(8) == 0 ? Command::of(Command::Kind::set_referenced)
                                        : Command::exchange(*Request::eeprom_read(dice.roll(127))));
      if (ticket && open.insert(*ticket).second) ++posted;
    }
    if (dice.roll(3) == 0) take();
  }
  bus.join();
  observer.join();
  // What was posted after the bus's last look is answered when it looks again.
  world->axis.stop(Time{world->now.load()});
  take();
  EXPECT_EQ(wrong, 0U);
  EXPECT_EQ(twice, 0U);
  EXPECT_TRUE(open.empty()) << open.size() << " commands never completed";
  EXPECT_GT(fresh, 0U);
  EXPECT_GT(posted, 10U);
  EXPECT_GT(published.load(), 0U);
  EXPECT_EQ(world->encoder.model().t1().violations(), 0U);
}

}  // namespace
}  // namespace tm485::test
