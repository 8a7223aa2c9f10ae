#include "tm485/sim/sim_options.hpp"

#include <gtest/gtest.h>

#include "ask.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::sim {
namespace {

SimOptions good(std::string_view text) {
  const auto options = parse_sim_options(text);
  EXPECT_TRUE(options.has_value()) << (options ? "" : options.error());
  return options.value_or(SimOptions{});
}

std::string error_of(std::string_view text) {
  const auto options = parse_sim_options(text);
  EXPECT_FALSE(options.has_value()) << text;
  return options ? "" : options.error();
}

TEST(SimOptions, NothingMeansTheDefaultEncoder) {
  const SimOptions options = good("");
  EXPECT_EQ(options.encoder.single_turn_bits, 17u);
  EXPECT_EQ(options.encoder.enid, 0x11);
  EXPECT_EQ(options.encoder.start_turn, 1);
  EXPECT_FALSE(options.line.echo);
}

TEST(SimOptions, TFormatWithoutABatteryReportsItForEver) {
  const SimOptions options = good("rpm=3000,profile=tformat_17");
  EXPECT_EQ(options.encoder.sf, 0x20);
  EXPECT_EQ(options.encoder.almc, 0xC1);
  EXPECT_EQ(options.encoder.start_turn, 0);
  EXPECT_FALSE(options.encoder.battery);
  EXPECT_EQ(options.motion.counts(ms(20), 17), 131072);
}

TEST(SimOptions, TFormatWithABatteryIsHealthy) {
  const SimOptions options = good("profile=tformat_23_battery");
  EXPECT_EQ(options.encoder.sf, 0x00);
  EXPECT_EQ(options.encoder.almc, 0x00);
  EXPECT_TRUE(options.encoder.battery);
  EXPECT_EQ(options.encoder.single_turn_bits, 23u);
  EXPECT_EQ(options.encoder.enid, 0x17);
}

TEST(SimOptions, SingleTurnProfileHasNoTurns) {
  const SimOptions options = good("profile=tm485_17_st");
  EXPECT_EQ(options.encoder.enid, 0x00);
  EXPECT_FALSE(options.encoder.multi_turn);
}

TEST(SimOptions, EveryKeyIsTaken) {
  const SimOptions options = good(
      "profile=tm485_23,start=0.5,turn=-3,seed=7,enid=0x11,almc=C4,sf=10,t2=2.8us..3200ns,latch_offset=500ns,"
      "boot=300ms,echo,jitter=2us,margin=3us,release=0.5us,baud=1000000,ber=0.1:0.2,lost=0.3");
  EXPECT_EQ(options.motion.counts(Time{0}, 23), 4194304);
  EXPECT_EQ(options.encoder.start_turn, -3);
  EXPECT_EQ(options.seed, 7u);
  EXPECT_EQ(options.encoder.seed, 7u);
  EXPECT_EQ(options.encoder.enid, 0x11);
  EXPECT_EQ(options.encoder.almc, 0xC4);
  EXPECT_EQ(options.encoder.sf, 0x10);
  EXPECT_EQ(options.encoder.t2_min, Time{2'800});
  EXPECT_EQ(options.encoder.t2_max, Time{3'200});
  EXPECT_EQ(options.encoder.latch_offset, Time{500});
  EXPECT_EQ(options.encoder.boot_time, ms(300));
  EXPECT_TRUE(options.line.echo);
  EXPECT_EQ(options.port.start_jitter, us(2));
  EXPECT_EQ(options.port.jitter_margin, us(3));
  EXPECT_EQ(options.port.release, Time{500});
  EXPECT_EQ(options.line.bits_per_second, 1'000'000);
  EXPECT_DOUBLE_EQ(options.request_bit_errors, 0.1);
  EXPECT_DOUBLE_EQ(options.reply_bit_errors, 0.2);
  EXPECT_DOUBLE_EQ(options.lost_replies, 0.3);
}

TEST(SimOptions, FaultsOfTheWiringAreTaken) {
  EXPECT_EQ(good("swap=pair").swap, Swap::pair);
  EXPECT_EQ(good("swap=receive").swap, Swap::receive);
  EXPECT_DOUBLE_EQ(good("glitch=0.25").glitches, 0.25);
  EXPECT_FALSE(good("power=off").power);
  EXPECT_TRUE(good("power=on").power);
  EXPECT_EQ(good("eeprom_busy=2s").encoder.eeprom.busy_at_start, ms(2000));
  const SimOptions healthy = good("");
  EXPECT_EQ(healthy.swap, Swap::none);
  EXPECT_DOUBLE_EQ(healthy.glitches, 0.0);
  EXPECT_TRUE(healthy.power);
}

TEST(SimOptions, EveryKeyOfTheEepromIsTaken) {
  const SimOptions options = good(
      "standstill=2.5,eeprom_pages=6,eeprom_write=5ms..12ms,eeprom_page=20ms,eeprom_ack=busy,eeprom_deaf,"
      "eeprom_volatile=off,eeprom_start=3,eeprom_fail=0.25,eeprom_seed=9,seed=7");
  EXPECT_DOUBLE_EQ(options.encoder.standstill_rpm, 2.5);
  const EepromConfig& eeprom = options.encoder.eeprom;
  EXPECT_EQ(eeprom.pages, 6u);
  EXPECT_EQ(eeprom.write_time_min, ms(5));
  EXPECT_EQ(eeprom.write_time_max, ms(12));
  EXPECT_EQ(eeprom.page_time, ms(20));
  EXPECT_EQ(eeprom.write_reply_busy, true);
  EXPECT_TRUE(eeprom.deaf_while_busy);
  EXPECT_FALSE(eeprom.page_volatile);
  EXPECT_EQ(eeprom.power_up_page, 3);
  EXPECT_DOUBLE_EQ(eeprom.failed_writes, 0.25);
  EXPECT_EQ(eeprom.seed, 9u);
  EXPECT_EQ(options.encoder.seed, 7u);
}

TEST(SimOptions, TheEepromIsThatOfTheProfileUnlessSaidOtherwise) {
  const EncoderModel tm485{good("").encoder};
  EXPECT_EQ(tm485.config().eeprom.write_reply_busy, false);
  EXPECT_FALSE(tm485.config().eeprom.page_time.has_value());
  const EncoderModel tformat{good("profile=tformat_17").encoder};
  EXPECT_EQ(tformat.config().eeprom.write_reply_busy, true);
  EXPECT_EQ(tformat.config().eeprom.page_time, Time{0});
  const EncoderModel told{good("profile=tformat_17,eeprom_ack=plain,eeprom_page=1ms").encoder};
  EXPECT_EQ(told.config().eeprom.write_reply_busy, false);
  EXPECT_EQ(told.config().eeprom.page_time, ms(1));
  EXPECT_NE(good("seed=7").encoder.eeprom.seed, good("seed=8").encoder.eeprom.seed);
}

TEST(SimOptions, TheStatusFollowsFromTheAlarmCode) {
  EXPECT_EQ(good("almc=C1").encoder.sf, 0x20);
  EXPECT_EQ(good("almc=c1,sf=0").encoder.sf, 0x00);
}

TEST(SimOptions, MotionForms) {
  EXPECT_EQ(good("motion=constant:60").motion.counts(std::chrono::seconds{1}, 17), 131072);
  EXPECT_NEAR(good("motion=sine:0.25:2").motion.revolutions(ms(125)), 0.25, 1e-9);
  EXPECT_NEAR(good("motion=trapezoid:600:600:2").motion.revolutions(std::chrono::seconds{4}), 30.0, 1e-9);
  EXPECT_NEAR(good("rpm=600,accel=600,cruise=2s").motion.revolutions(std::chrono::seconds{4}), 30.0, 1e-9);
}

TEST(SimOptions, AnUnknownKeyIsNamedAndTheKnownOnesListed) {
  const std::string error = error_of("rpm=1,speed=3");
  EXPECT_NE(error.find("'speed'"), std::string::npos);
  EXPECT_NE(error.find(" rpm"), std::string::npos);
  EXPECT_NE(error.find(" lost"), std::string::npos);
}

TEST(SimOptions, AnUnknownProfileIsNamedAndTheKnownOnesListed) {
  const std::string error = error_of("profile=endat");
  EXPECT_NE(error.find("'endat'"), std::string::npos);
  EXPECT_NE(error.find("tformat_23_battery"), std::string::npos);
}

TEST(SimOptions, BadValuesNameTheirKey) {
  for (const std::string_view text : {"rpm=fast",
                                      "rpm=nan",
                                      "rpm=1e9",
                                      "rpm=",
                                      "accel=0",
                                      "start=1x",
                                      "turn=1.5",
                                      "seed=-1",
                                      "enid=100",
                                      "sf=G",
                                      "almc=1FF",
                                      "t2=3",
                                      "t2=3us..2us",
                                      "t2=1s",
                                      "latch_offset=-1us",
                                      "boot=2h",
                                      "echo=maybe",
                                      "jitter=x",
                                      "margin=",
                                      "release=9s",
                                      "baud=0",
                                      "ber=2",
                                      "ber=0:0:0",
                                      "lost=-1",
                                      "glitch=1.5",
                                      "swap=",
                                      "swap=none",
                                      "power=low",
                                      "eeprom_busy=1",
                                      "motion=spin:1",
                                      "motion=sine:1",
                                      "profile=",
                                      "standstill=-1",
                                      "eeprom_pages=0",
                                      "eeprom_pages=8",
                                      "eeprom_write=10",
                                      "eeprom_write=9ms..8ms",
                                      "eeprom_page=4s",
                                      "eeprom_ack=maybe",
                                      "eeprom_deaf=1",
                                      "eeprom_volatile=no",
                                      "eeprom_start=256",
                                      "eeprom_fail=2",
                                      "eeprom_seed=x"}) {
    const std::string error = error_of(text);
    EXPECT_NE(error.find(text.substr(0, text.find('='))), std::string::npos) << error;
  }
}

TEST(SimOptions, StrayTextIsRefused) {
  error_of(",");
  error_of("rpm");
  error_of("rpm=1,");
  error_of("accel=100");
  error_of("rpm=1,motion=constant:1");
}

TEST(SimulatedEncoder, FaultsOfTheOptionsAreOnTheLine) {
  SimulatedEncoder simulated{good("lost=1")};
  const Bytes request{0x1A};
  ASSERT_TRUE(simulated.port().try_send(request, us(0)).has_value());
  EXPECT_EQ(simulated.line().next_event(), kNever);
  EXPECT_EQ(simulated.model().statistics().replies, 1u);
}

}  // namespace
}  // namespace tm485::sim
