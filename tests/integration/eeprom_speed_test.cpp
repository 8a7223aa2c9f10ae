// How long the EEPROM manager takes, in virtual time, against what the encoder itself needs; and that on a profile which
// shares the bus the cyclic reads do not notice it.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <ranges>
#include <span>

#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/eeprom.hpp"
#include "tm485/sim/encoder_model.hpp"
#include "tm485/sim/line.hpp"
#include "tm485/sim/sim_port.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::us;

constexpr std::size_t kBytes = sim::EepromModel::kBytes;
using Image = std::array<std::uint8_t, kBytes>;

class EepromSpeed : public testing::Test {
 protected:
  void begin(const char* name, std::optional<Pattern> cycle) {
    profile.emplace(test::compiled(name));
    sim::EncoderConfig config;
    if (name[1] == 'f') config.flavour = sim::Flavour::t_format;
    config.eeprom.pages = profile->profile().eeprom_pages;
    model.emplace(config, sim::MotionProfile::constant(1'000.0));
    line.emplace(&*model, sim::LineConfig{});
    port.emplace(*line, sim::SimPortConfig{});
    BusConfig bus_config;
    bus_config.cycle = cycle;
    bus.emplace(*port, *profile, bus_config);
    manager.emplace(*profile);
    ASSERT_TRUE(bus->start(now));
    while (bus->state() != BusState::running) step();
    size = manager->size();
  }
  void step() {
    const Time due = bus->poll(now);
    const Time asked = drive(*manager, *bus, now);
    const Time event = line->next_event();
    const Time next = std::min({due, asked, event > now ? event : kNever});
    in_place = next > now ? 0 : in_place + 1;
    ASSERT_LT(in_place, 100);
    now = std::max(now, std::min(next, now + ms(1)));
  }
  Time finish() {
    const Time begun = now;
    while (manager->active() && !HasFatalFailure()) step();
    EXPECT_EQ(manager->outcome()->code, Errc::ok) << name(manager->outcome()->code);
    return now - begun;
  }

  Time now{0};
  std::size_t size = 0;
  int in_place = 0;
  std::optional<CompiledProfile> profile;
  std::optional<sim::EncoderModel> model;
  std::optional<sim::Line> line;
  std::optional<sim::SimPort> port;
  std::optional<Bus<sim::SimPort>> bus;
  std::optional<EepromManager> manager;
};

double seconds(Time t) { return static_cast<double>(t.count()) * 1e-9; }

TEST_F(EepromSpeed, ADumpAndARestoreTakeLittleMoreThanTheEncoderNeeds) {
  begin("tm485_17", std::nullopt);
  const Time dump_limit = us(40) * 889 + ms(18) * 7;
  const Time write_limit = ms(10) * 889 + ms(18) * 7;
  Image found{};
  ASSERT_TRUE(manager->start_read(0, found));
  const Time dump = finish();
  Image wanted{};
  for (std::size_t i = 0; i < kBytes; ++i) wanted[i] = static_cast<std::uint8_t>(i * 7 + 1);
  ASSERT_TRUE(manager->start_write(0, wanted));
  const Time write = finish();
  EXPECT_LE(manager->progress().page_selects, 7U);
  ASSERT_TRUE(manager->start_verify(0, wanted));
  const Time verify = finish();
  const std::uint64_t writes = model->eeprom().writes();
  ASSERT_TRUE(manager->start_write(0, wanted));
  const Time again = finish();
  EXPECT_EQ(model->eeprom().writes(), writes) << "what is there already is not written";
  EXPECT_LE(dump, dump_limit * 105 / 100);
  EXPECT_LE(write, write_limit * 102 / 100);
  EXPECT_LE(dump + write + verify, write_limit * 105 / 100);
  EXPECT_LE(again, 2 * dump);
  EXPECT_EQ(model->t1().violations(), 0U);
  EXPECT_EQ(model->eeprom().interval_violations(), 0U);
  std::printf(
      "dump %.4f s (limit %.4f), write %.3f s (%.3f), with dump and verify %.3f s, identical %.4f s\n",
      seconds(dump), seconds(dump_limit), seconds(write), seconds(write_limit),
      seconds(dump + write + verify), seconds(again));
}

TEST_F(EepromSpeed, OnASharedBusNoCyclicSampleIsLateOrLost) {
  begin("tformat_17", Pattern(Cycle{DataId::everything, us(125)}));
  Image wanted{};
  for (std::size_t i = 0; i < size; ++i) wanted[i] = static_cast<std::uint8_t>(i * 5 + 3);
  ASSERT_TRUE(manager->start_write(0, std::span(wanted).first(size)));
  (void)finish();
  EXPECT_TRUE(std::ranges::equal(model->eeprom().settled_image(now + ms(20)) | std::views::take(size),
                                 std::span(wanted).first(size)));
  const Statistics& s = bus->statistics();
  EXPECT_EQ(s.failed, 0U);
  EXPECT_EQ(s.skipped, 0U);
  EXPECT_EQ(s.invalidated, 0U);
  EXPECT_EQ(s.t1.maximum(), us(125)) << "each exactly in its slot";
  EXPECT_EQ(s.t1.minimum(), us(125));
  EXPECT_EQ(model->t1().violations(), 0U);
}

TEST_F(EepromSpeed, OnABusThatIsHeldAWriteIsRefusedWhileALoopRuns) {
  begin("tm485_17", Pattern(Cycle{DataId::everything, us(125)}));
  const std::array<std::uint8_t, 1> byte{0x42};
  ASSERT_TRUE(manager->start_write(3, byte));
  while (manager->active()) step();
  EXPECT_EQ(manager->outcome()->code, Errc::no_gap);
  EXPECT_EQ(model->eeprom().writes(), 0U);
  EXPECT_EQ(bus->statistics().failed, 0U);
}

TEST_F(EepromSpeed, WithPermissionItIsHeldForSoLongAndStaysValid) {
  profile.emplace(test::compiled("tm485_17"));
  model.emplace(sim::EncoderConfig{}, sim::MotionProfile::constant(1'000.0));
  line.emplace(&*model, sim::LineConfig{});
  port.emplace(*line, sim::SimPortConfig{});
  BusConfig config;
  config.cycle = Pattern(Cycle{DataId::everything, us(125)});
  config.eeprom_may_hold = true;
  bus.emplace(*port, *profile, config);
  manager.emplace(*profile);
  ASSERT_TRUE(bus->start(now));
  while (bus->state() != BusState::running) step();
  for (int i = 0; i < 100; ++i) step();
  const std::array<std::uint8_t, 3> bytes{0x42, 0x43, 0x44};
  ASSERT_TRUE(manager->start_write(200, bytes));
  bool held = false;
  while (manager->active()) {
    step();
    held |= bus->latest().quality() == Quality::held;
    ASSERT_NE(bus->latest().quality(), Quality::invalid);
  }
  EXPECT_EQ(manager->outcome()->code, Errc::ok);
  EXPECT_TRUE(held);
  EXPECT_EQ(bus->statistics().failed, 0U);
  EXPECT_EQ(bus->statistics().invalidated, 0U);
  EXPECT_GT(bus->statistics().displaced, 3U * 80U) << "10 ms each";
  EXPECT_EQ(bus->statistics().lost, 0U);
}

}  // namespace
}  // namespace tm485
