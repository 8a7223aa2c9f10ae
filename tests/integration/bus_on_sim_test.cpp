// Bus on the simulated line with the simulated encoder, which judges: T1 on the start bits, positions by its own latch.
#include <gtest/gtest.h>

#include <algorithm>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/sim/encoder_model.hpp"
#include "tm485/sim/line.hpp"
#include "tm485/sim/motion_profile.hpp"
#include "tm485/sim/sim_port.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::ns;
using test::us;

/// Encoder, line, port and bus; time moves to whatever is next, plus what `late` adds.
struct World {
  World(const char* name, const Cycle& cycle, sim::EncoderConfig encoder_config,
        const sim::MotionProfile& motion, const sim::SimPortConfig& port_config = {},
        const sim::LineConfig& line_config = {})
      : profile(make(name, line_config.echo)),
        encoder(encoder_config, motion),
        line(&encoder, line_config),
        port(line, port_config),
        bus(port, profile, config_for(cycle)) {}

  static CompiledProfile make(const char* name, bool echo) {
    Profile p = test::preset(name);
    p.echo = echo;
    return test::compiled(p);
  }
  static BusConfig config_for(const Cycle& cycle) {
    BusConfig config;
    config.cycle = cycle;
    return config;
  }

  /// Polls until `done`; false after `limit`.
  template <class Late, class Done>
  bool run(Time limit, Late late, Done done) {
    const Time end = now + limit;
    while (!done()) {
      if (now > end) return false;
      const Time due = bus.poll(now);
      const Time event = line.next_event();
      const Time next = event > now ? std::min(due, event) : due;
      now = std::max(next, now) + late();
    }
    return true;
  }
  template <class Done>
  bool run(Time limit, Done done) {
    return run(limit, [] { return Time{0}; }, done);
  }
  bool run_until_running(Time limit = ms(3'000)) {
    return run(limit, [this] { return bus.state() == BusState::running; });
  }

  CompiledProfile profile;
  sim::EncoderModel encoder;
  sim::Line line;
  sim::SimPort port;
  Bus<sim::SimPort> bus;
  Time now{0};
};

struct JitterCase {
  const char* name;
  DataId id;
  Time period;
  Time jitter;
};
class T1UnderJitter : public testing::TestWithParam<JitterCase> {};

// Ten million in all; a tenth of that in a build that takes ten times the time.
#if defined(TM485_TEST_SLOW)
// The build says so.
#elif defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
#define TM485_TEST_SLOW 1
#elif defined(__has_feature)
#if __has_feature(address_sanitizer) || __has_feature(thread_sanitizer)
#define TM485_TEST_SLOW 1
#endif
#endif
#ifdef TM485_TEST_SLOW
constexpr std::uint32_t kCycles = 200'000;
#else
constexpr std::uint32_t kCycles = 2'000'000;
#endif

// The host comes late by a random time, and now and then by several cycles; the port starts late by a random time.
TEST_P(T1UnderJitter, IsNeverViolatedByTheModelsCount) {
  const auto& [label, id, period, jitter] = GetParam();
  World world("tm485_17", {id, period}, {}, sim::MotionProfile::constant(3'000),
              {.start_jitter = jitter, .jitter_margin = jitter, .seed = 5});
  ASSERT_TRUE(world.bus.start(world.now));
  ASSERT_TRUE(world.run_until_running());
  test::Rng rng(80);
  const auto late = [&] {
    const std::uint64_t r = rng();
    return Time{static_cast<std::int64_t>(r % 1024 == 0 ? (r >> 32) % 300'000 : (r >> 32) % 2'000)};
  };
  ASSERT_TRUE(
      world.run(std::chrono::hours(1), late, [&] { return world.bus.statistics().cycles >= kCycles; }));
  const Statistics& s = world.bus.statistics();
  EXPECT_EQ(world.encoder.t1().violations(), 0U)
      << "first at " << world.encoder.t1().first_violation().count();
  EXPECT_GE(world.encoder.t1().smallest_margin(), ns(0));
  EXPECT_GE(world.encoder.statistics().replies, std::uint64_t{kCycles});
  EXPECT_EQ(s.good, s.cycles) << "a late host misses a deadline only if the reply is not there";
  EXPECT_EQ(s.good + s.failed, s.cycles);
}
INSTANTIATE_TEST_SUITE_P(Each, T1UnderJitter,
                         testing::Values(JitterCase{"Id0Free", DataId::single_turn, us(40), us(1)},
                                         JitterCase{"Id1Free", DataId::multi_turn, us(40), us(3)},
                                         JitterCase{"Id2Phase", DataId::encoder_id, us(50), us(2)},
                                         JitterCase{"Id3Free", DataId::everything, ns(62'500), us(1)},
                                         JitterCase{"Id3Phase", DataId::everything, us(125), us(5)}),
                         [](const auto& row) { return std::string(row.param.name); });

TEST(BusOnSim, TheModelsCountDoesCount) {
  World world("tm485_17", {DataId::everything, ns(0)}, {}, {});
  (void)world.port.try_send(std::array<std::uint8_t, 1>{0x1A}, us(10));
  world.line.advance_to(us(70));
  (void)world.port.try_send(std::array<std::uint8_t, 1>{0x1A}, us(70));
  world.line.advance_to(us(200));
  EXPECT_EQ(world.encoder.t1().violations(), 1U) << "60 us after an ID3";
}

TEST(BusOnSim, ThePositionIsTheModelsLatchForEveryFreshSample) {
  const struct {
    const char* profile;
    unsigned bits;
    std::uint8_t enid;
    DataId id;
    sim::MotionProfile motion;
  } kCases[] = {
      {"tm485_17", 17, 0x11, DataId::everything, sim::MotionProfile::constant(6'000)},
      {"tm485_17", 17, 0x11, DataId::everything, sim::MotionProfile::constant(-6'000)},
      {"tm485_17", 17, 0x11, DataId::single_turn, sim::MotionProfile::constant(-5'999, 3.5)},
      {"tm485_23", 23, 0x17, DataId::everything, sim::MotionProfile::sine(2.5, 6)},
      {"tm485_23", 23, 0x17, DataId::single_turn, sim::MotionProfile::trapezoid(3'000, 50'000, 0.05)},
  };
  for (const auto& c : kCases) {
    sim::EncoderConfig encoder;
    encoder.single_turn_bits = c.bits;
    encoder.enid = c.enid;
    World world(c.profile, {c.id, ns(0)}, encoder, c.motion);
    ASSERT_TRUE(world.bus.start(world.now));
    ASSERT_TRUE(world.run_until_running());
    std::uint32_t seen = world.bus.record_count();
    std::uint32_t fresh = 0;
    ASSERT_TRUE(world.run(std::chrono::hours(1), [&] {
      if (world.bus.record_count() != seen) {
        seen = world.bus.record_count();
        const Sample& sample = world.bus.latest();
        if (sample.quality() == Quality::fresh) {
          ++fresh;
          const sim::Latch& latch = world.encoder.last_latch();
          EXPECT_EQ(sample.latch_time(), latch.time);
          EXPECT_EQ(sample.position(), latch.counts);
          EXPECT_EQ(sample.single_turn(), latch.abs);
        }
      }
      return fresh >= 20'000 || testing::Test::HasFailure();
    }));
    EXPECT_EQ(fresh, 20'000U) << c.profile;
    EXPECT_EQ(world.bus.statistics().failed, 0U);
    EXPECT_EQ(world.encoder.t1().violations(), 0U);
  }
}

TEST(BusOnSim, HostFirstTheEncoderBoots) {
  sim::EncoderConfig encoder;
  encoder.boot_time = ms(400);
  World world("tm485_17", {}, encoder, sim::MotionProfile::constant(100));
  ASSERT_TRUE(world.bus.start(world.now));
  ASSERT_TRUE(world.run_until_running());
  EXPECT_GE(world.now, ms(400));
  EXPECT_LT(world.now, ms(405));
  EXPECT_EQ(world.bus.statistics().startup_failures, 0U);
  EXPECT_EQ(world.encoder.t1().violations(), 0U);
}

TEST(BusOnSim, EncoderFirst) {
  World world("tm485_17", {}, {}, {});
  world.now = ms(700);
  ASSERT_TRUE(world.bus.start(world.now));
  ASSERT_TRUE(world.run_until_running());
  EXPECT_LT(world.now, ms(702));
}

TEST(BusOnSim, APowerCycleIsALossAndAFreshStartWithTheTurnCountOfOne) {
  sim::EncoderConfig encoder;
  encoder.boot_time = ms(100);
  World world("tm485_17", {}, encoder, sim::MotionProfile::constant(6'000));
  ASSERT_TRUE(world.bus.start(world.now));
  ASSERT_TRUE(world.run_until_running());
  ASSERT_TRUE(world.run(ms(500), [&] { return world.now > ms(400); }));
  EXPECT_GT(world.bus.latest().turns(), 35);
  ASSERT_TRUE(world.encoder.power_off(ms(500)));
  ASSERT_TRUE(world.encoder.power_on(ms(510)));
  ASSERT_TRUE(world.run(ms(1'000), [&] { return world.bus.state() == BusState::startup; }));
  EXPECT_EQ(world.bus.latest().quality(), Quality::invalid);
  ASSERT_TRUE(world.run(ms(1'000), [&] {
    EXPECT_NE(world.bus.latest().quality(), Quality::fresh);
    return world.bus.state() == BusState::running || testing::Test::HasFailure();
  }));
  ASSERT_TRUE(world.run(ms(10), [&] { return world.bus.latest().quality() == Quality::fresh; }));
  EXPECT_LE(world.bus.latest().turns(), 13) << "1, and the ten turns of its boot time";
  EXPECT_EQ(world.bus.latest().position(), world.encoder.last_latch().counts);
  EXPECT_EQ(world.bus.statistics().lost, 1U);
  EXPECT_EQ(world.encoder.t1().violations(), 0U);
}

TEST(BusOnSim, TheEchoOfTheAdapterIsDropped) {
  World world("tm485_17", {}, {}, sim::MotionProfile::constant(1'000), {}, {.echo = true});
  ASSERT_TRUE(world.bus.start(world.now));
  ASSERT_TRUE(world.run_until_running());
  ASSERT_TRUE(world.run(ms(2'000), [&] { return world.bus.statistics().cycles >= 10'000; }));
  EXPECT_EQ(world.bus.statistics().good, world.bus.statistics().cycles);
}

/// Spoils bursts on the wire at random: bits, framing, characters lost or added.
class Spoiler final : public sim::FaultHook {
 public:
  bool on_burst(sim::Burst& burst) noexcept override {
    if (rng_() % 4 != 0 || burst.count == 0) return false;
    const std::size_t at = rng_() % burst.count;
    switch (rng_() % 4) {
      case 0:
        burst.bytes[at] = static_cast<std::uint8_t>(burst.bytes[at] ^ (1U << (rng_() % 8)));
        break;
      case 1:
        burst.framing_errors |= 1U << at;
        break;
      case 2:
        --burst.count;
        break;
      default:
        burst.bytes[burst.count] = 0x00;
        ++burst.count;
        break;
    }
    return true;
  }

 private:
  test::Rng rng_{90};
};

// Every fresh sample is still one that the encoder latched: with single faults none can pass the checks.
TEST(BusOnSim, FaultsOnTheLineAreCountedAndNeverBecomeASample) {
  World world("tm485_17", {}, {}, sim::MotionProfile::constant(3'000));
  ASSERT_TRUE(world.bus.start(world.now));
  ASSERT_TRUE(world.run_until_running());
  Spoiler spoiler;
  world.line.set_fault_hook(&spoiler);
  std::uint32_t seen = world.bus.record_count();
  std::uint32_t fresh = 0;
  ASSERT_TRUE(world.run(std::chrono::hours(1), [&] {
    if (world.bus.record_count() != seen) {
      seen = world.bus.record_count();
      if (world.bus.latest().quality() == Quality::fresh) {
        ++fresh;
        EXPECT_EQ(world.bus.latest().position(), world.encoder.last_latch().counts);
      }
    }
    return world.bus.statistics().cycles >= 50'000 || testing::Test::HasFailure();
  }));
  const Statistics& s = world.bus.statistics();
  EXPECT_GT(fresh, 10'000U);
  EXPECT_EQ(s.good + s.failed, s.cycles);
  for (const Errc code : {Errc::timeout, Errc::incomplete_reply, Errc::framing_error, Errc::crc_error})
    EXPECT_GT(s.errors[static_cast<std::size_t>(code)], 100U) << name(code);
  EXPECT_EQ(world.encoder.t1().violations(), 0U);
}

}  // namespace
}  // namespace tm485
