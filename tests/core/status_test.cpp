// SF and ALMC: bit positions by the specification, names, and what the policies make of them.
#include "tm485/protocol/status.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

#include "support/profiles.hpp"
#include "tm485/protocol/profile.hpp"

namespace tm485 {
namespace {

// Section 3, by hand: which bit of which byte.
static_assert(StatusSet::of(StatusBit::single_turn_error) == StatusSet(0x10, 0x00));
static_assert(StatusSet::of(StatusBit::multi_turn_group) == StatusSet(0x20, 0x00));
static_assert(StatusSet::of(StatusBit::request_parity_error) == StatusSet(0x40, 0x00));
static_assert(StatusSet::of(StatusBit::request_delimiter_error) == StatusSet(0x80, 0x00));
static_assert(StatusSet::of(StatusBit::over_speed) == StatusSet(0x00, 0x01));
static_assert(StatusSet::of(StatusBit::full_absolute_status) == StatusSet(0x00, 0x02));
static_assert(StatusSet::of(StatusBit::counting_error) == StatusSet(0x00, 0x04));
static_assert(StatusSet::of(StatusBit::counter_overflow) == StatusSet(0x00, 0x08));
static_assert(StatusSet::of(StatusBit::over_heat) == StatusSet(0x00, 0x10));
static_assert(StatusSet::of(StatusBit::multi_turn_error) == StatusSet(0x00, 0x20));
static_assert(StatusSet::of(StatusBit::battery_error) == StatusSet(0x00, 0x40));
static_assert(StatusSet::of(StatusBit::battery_alarm) == StatusSet(0x00, 0x80));

TEST(Status, TableIsCompleteAndItsNamesAreUnique) {
  std::set<std::string_view> names, fields;
  for (std::size_t i = 0; i < kStatusBitCount; ++i) {
    const StatusInfo& info = status_table()[i];
    EXPECT_EQ(static_cast<std::size_t>(info.bit), i);
    EXPECT_EQ(&describe(info.bit), &info);
    EXPECT_TRUE(names.insert(info.name).second) << info.name;
    EXPECT_TRUE(fields.insert(info.field).second) << info.field;
    EXPECT_EQ(info.field, (i < 8 ? "SF." : "ALMC.") + std::to_string(i % 8));
    EXPECT_FALSE(info.cause.empty()) << info.name;
    EXPECT_FALSE(info.remedy.empty()) << info.name;
  }
}

TEST(Status, ASetHoldsExactlyTheBitsThatWereSent) {
  for (unsigned sf = 0; sf < 256; ++sf) {
    for (unsigned almc = 0; almc < 256; almc += 5) {
      const StatusSet set(static_cast<std::uint8_t>(sf), static_cast<std::uint8_t>(almc));
      EXPECT_EQ(set.sf(), sf);
      EXPECT_EQ(set.almc(), almc);
      EXPECT_EQ(set.empty(), sf == 0 && almc == 0);
      for (unsigned bit = 0; bit < 16; ++bit)
        EXPECT_EQ(set.has(static_cast<StatusBit>(bit)), ((bit < 8 ? sf >> bit : almc >> (bit - 8)) & 1) != 0);
    }
  }
}

TEST(Status, ANoBatteryEncoderThatReportsSf20ForEverIsNotAFault) {
  for (const char* name : {"tm485_17", "tm485_17_st", "tm485_23", "tformat_17", "tformat_23"}) {
    const AlarmPolicy policy = test::preset(name).alarms;
    EXPECT_EQ(policy.level(StatusSet(0x20, 0x00)), AlarmLevel::none) << name;
    for (const int almc : {0xC1, 0xC8, 0xC9})
      EXPECT_EQ(policy.level(StatusSet(0x20, static_cast<std::uint8_t>(almc))), AlarmLevel::none)
          << name << " " << almc;
  }
}

TEST(Status, ABadEncoderChipIsAFaultForEveryPresetThatJudges) {
  for (const Profile& profile : profile_presets()) {
    const AlarmLevel expected = profile.name == "any" ? AlarmLevel::none : AlarmLevel::fault;
    EXPECT_EQ(profile.alarms.level(StatusSet(0x10, 0x00)), expected) << profile.name;
    EXPECT_EQ(profile.alarms.level(StatusSet(0x00, 0x04)), expected) << profile.name;
  }
}

TEST(Status, WithABatteryLostTurnsAreAFaultAndAWeakBatteryAWarning) {
  for (const char* name : {"tformat_17_battery", "tformat_23_battery"}) {
    const AlarmPolicy policy = test::preset(name).alarms;
    EXPECT_EQ(policy.level(StatusBit::battery_error), AlarmLevel::fault);
    EXPECT_EQ(policy.level(StatusBit::multi_turn_error), AlarmLevel::fault);
    EXPECT_EQ(policy.level(StatusBit::battery_alarm), AlarmLevel::warning);
    EXPECT_EQ(policy.level(StatusBit::multi_turn_group), AlarmLevel::warning);
    EXPECT_EQ(policy.level(StatusBit::over_heat), AlarmLevel::warning);
    EXPECT_EQ(policy.level(StatusSet(0x20, 0xC0)), AlarmLevel::fault) << "the highest level counts";
  }
}

TEST(Status, RequestErrorsSeenByTheEncoderNeverFault) {
  for (const Profile& profile : profile_presets()) {
    EXPECT_NE(profile.alarms.level(StatusBit::request_parity_error), AlarmLevel::fault) << profile.name;
    EXPECT_NE(profile.alarms.level(StatusBit::request_delimiter_error), AlarmLevel::fault) << profile.name;
  }
}

TEST(Status, ReservedBitsAreThoseOfTheDocument) {
  EXPECT_EQ(test::preset("tm485_17").reserved_status,
            StatusSet(0xCF, 0x3B));  // all but SF.4, SF.5 and ALMC.2, .6, .7
  EXPECT_EQ(test::preset("tformat_17").reserved_status, StatusSet(0xCF, 0x00));
}

TEST(Status, LevelsOfAPolicyOfOnesOwn) {
  const AlarmPolicy policy{.warn = StatusSet(0x00, 0x03), .fault = StatusSet(0x00, 0x02)};
  EXPECT_EQ(policy.level(StatusSet(0xFF, 0xFC)), AlarmLevel::none);
  EXPECT_EQ(policy.level(StatusSet(0x00, 0x01)), AlarmLevel::warning);
  EXPECT_EQ(policy.level(StatusSet(0x00, 0x02)), AlarmLevel::fault) << "in both sets: the higher";
}

TEST(StatusSet, ConsistencyIsThatOfSection3OnEveryValue) {
  for (unsigned sf = 0; sf < 256; ++sf) {
    for (unsigned almc = 0; almc < 256; ++almc) {
      const bool single = (sf & 0x10U) != 0;
      const bool group = (sf & 0x20U) != 0;
      const bool counting = (almc & 0x04U) != 0;
      const bool any = almc >= 0x10;
      ASSERT_EQ(StatusSet(static_cast<std::uint8_t>(sf), static_cast<std::uint8_t>(almc)).consistent(),
                single == counting && group == any)
          << sf << ' ' << almc;
    }
  }
}

}  // namespace
}  // namespace tm485
