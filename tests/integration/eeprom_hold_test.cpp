// An EEPROM write that holds the bus while a servo loop runs: announced before it begins, and no reason to let go of the
// motor.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <optional>
#include <vector>

#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/axis.hpp"
#include "tm485/bus/eeprom.hpp"
#include "tm485/sim/encoder_model.hpp"
#include "tm485/sim/faults.hpp"
#include "tm485/sim/line.hpp"
#include "tm485/sim/sim_port.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::us;

/// What the loop has seen, one entry a sample.
struct Seen {
  Quality quality;
  Time announced;
  Time at;
};

class EepromHold : public testing::Test {
 protected:
  void begin() {
    AxisSetup setup;
    setup.bus.cycle = Pattern(Cycle{DataId::everything, us(125)});
    setup.bus.eeprom_may_hold = true;
    setup.on_invalid = {[](void* count, Time) { ++*static_cast<int*>(count); }, &torque_offs};
    axis.emplace(port, profile, setup);
    ASSERT_TRUE(axis->start(now));
    for (int i = 0; i < 100'000 && !axis->client().read(now).usable(); ++i) step();
    ASSERT_TRUE(axis->client().read(now).usable());
    run(ms(2));
    seen.clear();
  }
  void step() {
    const Time due = axis->poll(now);
    const Time asked = drive(manager, axis->bus(), now);
    const LoopState state = axis->client().read(now);
    if (seen.empty() || state.sample->sequence() != last_) {
      seen.push_back({state.sample->quality(), state.sample->announced_hold(), now});
      last_ = state.sample->sequence();
    }
    usable = usable && state.usable();
    const Time event = line.next_event();
    const Time next = std::min({due, asked, event > now ? event : kNever, now + us(20)});
    in_place = next > now ? 0 : in_place + 1;
    ASSERT_LT(in_place, 100);
    now = std::max(now, next);
  }
  void run(Time span) {
    for (const Time end = now + span; now < end && !HasFatalFailure();) step();
  }
  /// Writes one byte and waits for its end.
  void write(std::uint8_t value) {
    byte[0] = value;
    usable = true;
    ASSERT_TRUE(manager.start_write(200, byte));
    while (manager.active() && !HasFatalFailure()) step();
  }

  CompiledProfile profile = test::compiled("tm485_17");
  sim::EncoderModel model{sim::EncoderConfig{}, sim::MotionProfile::constant(1'000.0)};
  sim::Line line{&model, sim::LineConfig{}};
  sim::SimPort port{line, sim::SimPortConfig{}};
  std::optional<Axis<sim::SimPort>> axis;
  EepromManager manager{profile};
  std::array<std::uint8_t, 1> byte{};
  int torque_offs = 0;
  bool usable = true;
  std::vector<Seen> seen;
  std::uint32_t last_ = 0;
  int in_place = 0;
  Time now{0};
};

TEST_F(EepromHold, TheLoopKeepsItsMotor) {
  begin();
  write(0x42);
  EXPECT_EQ(manager.outcome()->code, Errc::ok) << name(manager.outcome()->code);
  EXPECT_TRUE(usable) << "valid throughout: extrapolated, but not too old";
  EXPECT_EQ(torque_offs, 0);
  EXPECT_FALSE(axis->client().view().latched);
}

TEST_F(EepromHold, ASampleSaysSoBeforeItBegins) {
  begin();
  write(0x42);
  unsigned holds = 0;
  for (std::size_t i = 1; i + 1 < seen.size(); ++i) {
    if (seen[i + 1].at - seen[i].at < ms(5)) continue;
    ++holds;
    EXPECT_EQ(seen[i].quality, Quality::held);
    EXPECT_GE(seen[i].announced, seen[i + 1].at - seen[i].at - us(250)) << "for how long";
    EXPECT_EQ(seen[i - 1].quality, Quality::fresh);
    EXPECT_EQ(seen[i - 1].announced, seen[i].announced) << "announced one sample earlier";
  }
  EXPECT_EQ(holds, 2U) << "the page, and the byte";
  run(ms(1));
  EXPECT_EQ(seen.back().announced, Time{0}) << "over";
}

TEST_F(EepromHold, WithoutAHoldNothingIsAnnounced) {
  begin();
  run(ms(5));
  for (const Seen& one : seen) ASSERT_EQ(one.announced, Time{0});
}

TEST_F(EepromHold, AFailedCycleBeforeItDoesNotStretchWhatIsValid) {
  begin();
  sim::LostCharacters dead(1.0, 0.0, 1);
  line.set_fault_hook(&dead);
  byte[0] = 0x42;
  ASSERT_TRUE(manager.start_write(200, byte));
  const Time begun = now;
  while (axis->client().read(now).usable() && now < begun + ms(50) && !HasFatalFailure()) step();
  EXPECT_LT(now - begun, ms(2) + us(500)) << "max_hold counts: no hold has begun";
}

TEST_F(EepromHold, TheAnnouncementEndsWithTheRequest) {
  begin();
  ASSERT_TRUE(axis->bus().offer(*Request::eeprom_write(3, 4), 1));
  axis->stop(now);
  ASSERT_TRUE(axis->start(now));
  while (!axis->client().read(now).usable() && !HasFatalFailure()) {
    step();
    if (axis->client().view().latched && in_place == 0) {
      (void)axis->client().post(Command::of(Command::Kind::resume));
      while (axis->client().poll_completion()) {
      }
    }
  }
  EXPECT_EQ(axis->client().latest().announced_hold(), Time{0});
}

/// Spoils the first reply of the encoder that begins after an instant.
class SpoilAfter : public sim::FaultHook {
 public:
  bool on_burst(sim::Burst& burst) noexcept override {
    if (burst.talker != sim::Talker::encoder || burst.start < after) return false;
    after = kNever;
    burst.bytes[2] ^= 0x10;
    return true;
  }
  Time after = kNever;
};

TEST_F(EepromHold, ABadReplyRightBehindItDoesNotStopTheMotor) {
  begin();
  SpoilAfter noise;
  line.set_fault_hook(&noise);
  byte[0] = 0x42;
  usable = true;
  ASSERT_TRUE(manager.start_write(200, byte));
  bool spoiled = false;
  while (manager.active() && !HasFatalFailure()) {
    step();
    // In the middle of a hold: what comes next is the first reply behind it.
    if (!spoiled && seen.back().quality == Quality::held && now - seen.back().at > ms(5)) {
      noise.after = now;
      spoiled = true;
    }
  }
  EXPECT_TRUE(spoiled);
  EXPECT_EQ(noise.after, kNever) << "hit";
  EXPECT_TRUE(usable);
  EXPECT_EQ(torque_offs, 0);
}

/// A port that takes no EEPROM write.
struct NoWrites : sim::SimPort {
  using sim::SimPort::SimPort;
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time at) noexcept {
    if (request.size() == 4) return std::unexpected(Errc::send_failed);
    return sim::SimPort::try_send(request, at);
  }
};

TEST(EepromHoldPort, AHoldThatIsNotSentStopsNothing) {
  const CompiledProfile profile = test::compiled("tm485_17");
  sim::EncoderModel model{sim::EncoderConfig{}, {}};
  sim::Line line{&model, sim::LineConfig{}};
  NoWrites port{line, sim::SimPortConfig{}};
  BusConfig config;
  config.cycle = Pattern(Cycle{DataId::everything, us(125)});
  config.eeprom_may_hold = true;
  Bus<NoWrites> bus(port, profile, config);
  Time now{0};
  ASSERT_TRUE(bus.start(now));
  const auto run = [&](Time until) {
    for (int in_place = 0; now < until && in_place < 100;) {
      const Time due = bus.poll(now);
      const Time event = line.next_event();
      const Time next = std::min({due, event > now ? event : kNever, until});
      in_place = next > now ? 0 : in_place + 1;
      now = std::max(now, next);
    }
  };
  run(ms(1'500));
  ASSERT_EQ(bus.state(), BusState::running);
  ASSERT_TRUE(bus.offer(*Request::eeprom_write(3, 4)));
  const std::uint32_t good = bus.statistics().good;
  run(now + ms(2));
  EXPECT_GE(bus.statistics().good, good + 14) << "125 us each";
  EXPECT_EQ(bus.statistics().displaced, 0U);
  EXPECT_EQ(bus.latest().announced_hold(), Time{0});
}

}  // namespace
}  // namespace tm485
