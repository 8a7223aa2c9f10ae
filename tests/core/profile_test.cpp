// Profiles: the presets, every contradiction that is refused, and the times that follow.
#include "tm485/protocol/profile.hpp"

#include <gtest/gtest.h>

#include <functional>
#include <set>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"

namespace tm485 {
namespace {

using test::compiled;
using test::ms;
using test::ns;
using test::preset;
using test::us;
using namespace std::chrono_literals;

TEST(Profile, PresetsCompileAndAreFoundByTheirNames) {
  const std::set<std::string_view> expected{
      "tm485_17",   "tm485_17_battery",   "tm485_17_st", "tm485_23",           "tm485_23_battery",
      "tformat_17", "tformat_17_battery", "tformat_23",  "tformat_23_battery", "any"};
  std::set<std::string_view> names;
  for (const Profile& profile : profile_presets()) {
    names.insert(profile.name);
    EXPECT_TRUE(CompiledProfile::compile(profile)) << profile.name;
    const auto found = find_profile(profile.name);
    ASSERT_TRUE(found);
    EXPECT_EQ(found->name, profile.name);
  }
  EXPECT_EQ(names, expected);
  EXPECT_EQ(test::error_of(find_profile("tm485_18")), Errc::bad_argument);
  EXPECT_EQ(test::error_of(find_profile("")), Errc::bad_argument);
}

TEST(Profile, PresetsSayWhatTheSpecificationSays) {
  EXPECT_EQ(preset("tm485_17").single_turn_bits, 17);
  EXPECT_EQ(preset("tm485_17").multi_turn_bits, 16);
  EXPECT_EQ(preset("tm485_17").multi_turn_start, 1);
  EXPECT_EQ(preset("tm485_17_st").multi_turn_bits, 0);
  EXPECT_EQ(preset("tm485_23").single_turn_bits, 23);
  EXPECT_EQ(preset("tformat_23").multi_turn_start, 0);
  EXPECT_FALSE(preset("tformat_23").battery);
  EXPECT_TRUE(preset("tformat_23_battery").battery);
  EXPECT_TRUE(preset("tm485_17").eeprom_holds_bus);
  EXPECT_FALSE(preset("tformat_17").eeprom_holds_bus);
  EXPECT_EQ(preset("tm485_17").reset_count, 10);
  EXPECT_EQ(preset("tm485_17").reset_spacing, ns(62'500));
  EXPECT_EQ(preset("tm485_17").reset_zero_settle, ms(100));
  EXPECT_EQ(preset("tm485_17").eeprom_pages, 7);
  EXPECT_EQ(preset("tm485_17").eeprom_page_bytes, 127);
}

TEST(Profile, T1OfEveryId) {
  const CompiledProfile profile = compiled("tm485_17");
  EXPECT_EQ(profile.t1(DataId::single_turn), us(40));
  EXPECT_EQ(profile.t1(DataId::multi_turn), us(40));
  EXPECT_EQ(profile.t1(DataId::encoder_id), us(40));
  EXPECT_EQ(profile.t1(DataId::everything), ns(62'500));
  EXPECT_EQ(profile.t1(DataId::eeprom_write), ms(10));
  EXPECT_EQ(profile.t1(DataId::reset_errors), ns(62'500));
  EXPECT_EQ(profile.t1(DataId::reset_single_turn), ns(62'500));
  EXPECT_EQ(profile.t1(DataId::reset_multi_turn), ns(62'500));
  EXPECT_EQ(profile.t1(DataId::eeprom_read), us(40));
}

TEST(Profile, APageChangeThatHoldsTheBusTakes18Ms) {
  const CompiledProfile holds = compiled("tm485_17");
  EXPECT_EQ(holds.t1(*Request::eeprom_write(kPageRegister, 3)), ms(18));
  EXPECT_EQ(holds.t1(*Request::eeprom_write(126, 3)), ms(10));
  EXPECT_EQ(holds.t1(*Request::eeprom_read(kPageRegister)), us(40))
      << "reading the page register changes nothing";
  EXPECT_EQ(holds.t1(*Request::make(DataId::everything)), ns(62'500));
  const CompiledProfile shares = compiled("tformat_17");
  EXPECT_EQ(shares.t1(*Request::eeprom_write(kPageRegister, 3)), us(40));
  EXPECT_EQ(shares.t1(*Request::eeprom_write(0, 3)), us(40));
}

TEST(Profile, AWriteThatHoldsTheBusTakesTheLongerOfItsTimeAndT1) {
  Profile p = preset("tm485_17");
  p.eeprom_write_time = ms(12);
  p.eeprom_page_time = ms(5);
  const CompiledProfile longer = compiled(p);
  EXPECT_EQ(longer.t1(*Request::eeprom_write(0, 3)), ms(12)) << "the write is longer than T1";
  EXPECT_EQ(longer.t1(*Request::eeprom_write(kPageRegister, 3)), ms(10))
      << "T1 is longer than the page change";
  EXPECT_EQ(longer.t1(DataId::eeprom_write), ms(10));
  p.eeprom_write_time = ms(0);
  EXPECT_EQ(compiled(p).t1(*Request::eeprom_write(0, 3)), ms(10));
  p.eeprom_write_time = ms(12);
  p.eeprom_holds_bus = false;
  const CompiledProfile shared = compiled(p);
  EXPECT_EQ(shared.t1(*Request::eeprom_write(0, 3)), ms(10)) << "T1 alone";
  EXPECT_EQ(shared.t1(*Request::eeprom_write(kPageRegister, 3)), ms(10));
}

TEST(Profile, WireTimes) {
  const CompiledProfile profile = compiled("tm485_17");
  EXPECT_EQ(profile.character_time(), us(4));
  const Profile& p = profile.profile();
  for (const auto& kind : test::kKinds) {
    const auto id = static_cast<DataId>(kind.id);
    EXPECT_EQ(profile.request_time(id), us(4) * static_cast<int>(kind.out));
    EXPECT_EQ(profile.reply_time(id), us(4) * static_cast<int>(kind.back));
    EXPECT_EQ(profile.exchange_min(id), us(4) * static_cast<int>(kind.out + kind.back) + p.t2_min);
    EXPECT_EQ(profile.exchange_max(id), us(4) * static_cast<int>(kind.out + kind.back) + p.t2_max);
    EXPECT_LE(profile.exchange_max(id), profile.t1(id))
        << "at its slowest an exchange still ends before the next request";
  }
  Profile slow;
  slow.bit_rate = 1'000'000;
  slow.t1.fill(ms(20));
  EXPECT_EQ(compiled(slow).character_time(), us(10));
}

struct Contradiction {
  const char* name;
  const char* field;
  std::function<void(Profile&)> edit;
};
class ProfileContradiction : public testing::TestWithParam<Contradiction> {};

TEST_P(ProfileContradiction, IsRefusedAndNamed) {
  Profile profile;
  ASSERT_TRUE(CompiledProfile::compile(profile));
  GetParam().edit(profile);
  const auto result = CompiledProfile::compile(profile);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, Errc::bad_profile);
  EXPECT_EQ(result.error().field, GetParam().field);
  EXPECT_FALSE(result.error().why.empty());
}

const Contradiction kContradictions[] = {
    {"SingleTurnTooNarrow", "single_turn_bits", [](Profile& p) { p.single_turn_bits = 7; }},
    {"SingleTurnTooWide", "single_turn_bits", [](Profile& p) { p.single_turn_bits = 25; }},
    {"SingleTurnZero", "single_turn_bits", [](Profile& p) { p.single_turn_bits = 0; }},
    {"MultiTurnTooNarrow", "multi_turn_bits", [](Profile& p) { p.multi_turn_bits = 7; }},
    {"MultiTurnTooWide", "multi_turn_bits",
     [](Profile& p) {
       p.multi_turn_bits = 25;
       p.abm_reserved = 0;
     }},
    {"TooManyEnids", "enids", [](Profile& p) { p.enids.count = 5; }},
    {"AbmReservedBeyondAbm", "abm_reserved", [](Profile& p) { p.abm_reserved = 0x1000000; }},
    {"AbmReservedOverlapsTheCount", "abm_reserved", [](Profile& p) { p.abm_reserved = 0x8000; }},
    {"BitRateTooLow", "bit_rate", [](Profile& p) { p.bit_rate = 9'599; }},
    {"BitRateTooHigh", "bit_rate", [](Profile& p) { p.bit_rate = 10'000'001; }},
    {"BitRateZero", "bit_rate", [](Profile& p) { p.bit_rate = 0; }},
    {"T2Empty", "t2", [](Profile& p) { p.t2_min = p.t2_max + ns(1); }},
    {"T2Negative", "t2", [](Profile& p) { p.t2_min = ns(-1); }},
    {"T2TooLong", "t2", [](Profile& p) { p.t2_max = 60s + ns(1); }},
    {"LatchUncertaintyNegative", "latch_uncertainty", [](Profile& p) { p.latch_uncertainty = ns(-1); }},
    {"LatchUncertaintyTooLong", "latch_uncertainty", [](Profile& p) { p.latch_uncertainty = 61s; }},
    {"LatchOffsetTooEarly", "latch_offset", [](Profile& p) { p.latch_offset = -61s; }},
    {"LatchOffsetTooLate", "latch_offset", [](Profile& p) { p.latch_offset = 61s; }},
    {"PowerUpNegative", "power_up_time", [](Profile& p) { p.power_up_time = ns(-1); }},
    {"PowerUpTooLong", "power_up_time", [](Profile& p) { p.power_up_time = 61s; }},
    {"BootNegative", "power_up_time", [](Profile& p) { p.boot_time_min = ns(-1); }},
    {"BootLongerThanPowerUp", "power_up_time", [](Profile& p) { p.boot_time_min = p.power_up_time + ns(1); }},
    {"NoResets", "reset", [](Profile& p) { p.reset_count = 0; }},
    {"ResetSpacingNegative", "reset", [](Profile& p) { p.reset_spacing = ns(-1); }},
    {"ResetSettleTooLong", "reset", [](Profile& p) { p.reset_zero_settle = 61s; }},
    {"NoPages", "eeprom_pages", [](Profile& p) { p.eeprom_pages = 0; }},
    {"TooManyPages", "eeprom_pages", [](Profile& p) { p.eeprom_pages = 33; }},
    {"EmptyPages", "eeprom_page_bytes", [](Profile& p) { p.eeprom_page_bytes = 0; }},
    {"PagesThatHoldThePageRegister", "eeprom_page_bytes", [](Profile& p) { p.eeprom_page_bytes = 128; }},
    {"WriteTimeNegative", "eeprom_times", [](Profile& p) { p.eeprom_write_time = ns(-1); }},
    {"PageTimeTooLong", "eeprom_times", [](Profile& p) { p.eeprom_page_time = 61s; }},
    {"T1Negative", "t1", [](Profile& p) { p.t1[0] = ns(-1); }},
    {"T1TooLong", "t1", [](Profile& p) { p.t1[8] = 61s; }},
    {"T1BelowTheExchangeOfId3", "t1", [](Profile& p) { p.t1[3] = ns(4'000 * 12 + 2'000 - 1); }},
    {"T1BelowTheExchangeOfId6", "t1", [](Profile& p) { p.t1[4] = us(30); }},
    {"T1OfASlowLine", "t1", [](Profile& p) { p.bit_rate = 1'000'000; }},
};
INSTANTIATE_TEST_SUITE_P(Each, ProfileContradiction, testing::ValuesIn(kContradictions),
                         [](const auto& row) { return std::string(row.param.name); });

TEST(Profile, LimitsThemselvesAreGood) {
  const std::function<void(Profile&)> edits[] = {
      [](Profile& p) { p.single_turn_bits = 8; },
      [](Profile& p) { p.single_turn_bits = 24; },
      [](Profile& p) { p.multi_turn_bits = 8; },
      [](Profile& p) {
        p.multi_turn_bits = 24;
        p.abm_reserved = 0;
      },
      [](Profile& p) {
        p.multi_turn_bits = 0;
        p.abm_reserved = 0xFFFFFF;
      },
      [](Profile& p) { p.abm_reserved = 0xFF0000; },
      [](Profile& p) { p.enids.count = 0; },
      [](Profile& p) { p.enids.count = 4; },
      [](Profile& p) { p.bit_rate = 10'000'000; },
      [](Profile& p) { p.t2_min = p.t2_max; },
      [](Profile& p) { p.t2_min = ns(0); },
      [](Profile& p) { p.latch_offset = ns(-500); },
      [](Profile& p) { p.power_up_time = p.boot_time_min; },
      [](Profile& p) { p.eeprom_pages = 32; },
      [](Profile& p) { p.t1[3] = ns(4'000 * 12 + 2'000); },
  };
  for (const auto& edit : edits) {
    Profile profile;
    edit(profile);
    const auto result = CompiledProfile::compile(profile);
    EXPECT_TRUE(result) << &edit - edits << ": " << (result ? "" : result.error().field);
  }
}

}  // namespace
}  // namespace tm485
