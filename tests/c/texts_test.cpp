// The texts of the C interface end with the view of C++, by a NUL. The values of the enumerations are asserted where the
// library is compiled.
#include <gtest/gtest.h>

#include <cstring>

#include "tm485/c/tm485.h"
#include "tm485/errc.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/protocol/status.hpp"

namespace tm485 {
namespace {

TEST(CTexts, ErrorsEndWhereTheirViewsEnd) {
  for (std::size_t i = 0; i < kErrcCount; ++i) {
    const auto code = static_cast<tm485_errc>(i);
    const ErrorInfo& info = describe(static_cast<Errc>(i));
    EXPECT_STREQ(tm485_errc_name(code), std::string(info.name).c_str());
    EXPECT_STREQ(tm485_errc_cause(code), std::string(info.cause).c_str());
    EXPECT_STREQ(tm485_errc_remedy(code), std::string(info.remedy).c_str());
  }
}

TEST(CTexts, StatusBitsEndWhereTheirViewsEnd) {
  for (const StatusInfo& info : status_table()) {
    const auto bit = static_cast<unsigned>(info.bit);
    EXPECT_STREQ(tm485_status_name(bit), std::string(info.name).c_str());
    EXPECT_STREQ(tm485_status_field(bit), std::string(info.field).c_str());
    EXPECT_STREQ(tm485_status_cause(bit), std::string(info.cause).c_str());
    EXPECT_STREQ(tm485_status_remedy(bit), std::string(info.remedy).c_str());
  }
}

TEST(CTexts, PresetsAreThoseOfCpp) {
  ASSERT_EQ(tm485_preset_count(), profile_presets().size());
  for (std::size_t i = 0; i < profile_presets().size(); ++i)
    EXPECT_STREQ(tm485_preset_name(i), std::string(profile_presets()[i].name).c_str());
}

// Every contradiction that a profile can have, by one setting each.
TEST(CTexts, ProfileErrorsEndWhereTheirViewsEnd) {
  const auto refused = [](auto change) {
    tm485_profile_settings settings;
    EXPECT_EQ(tm485_profile_settings_get(&settings, "tm485_17"), TM485_OK);
    change(settings);
    tm485_profile profile;
    tm485_profile_error why;
    EXPECT_EQ(tm485_profile_compile(&profile, &settings, &why), TM485_ERR_BAD_PROFILE);
    EXPECT_LT(std::strlen(why.field), 24U) << why.field;
    EXPECT_LT(std::strlen(why.why), 64U) << why.why;
    return std::string(why.field);
  };
  EXPECT_EQ(refused([](auto& s) { s.single_turn_bits = 25; }), "single_turn_bits");
  EXPECT_EQ(refused([](auto& s) { s.multi_turn_bits = 3; }), "multi_turn_bits");
  EXPECT_EQ(refused([](auto& s) { s.enid_count = 5; }), "enids");
  EXPECT_EQ(refused([](auto& s) { s.abm_reserved = 0x1000000; }), "abm_reserved");
  EXPECT_EQ(refused([](auto& s) { s.bit_rate = 1; }), "bit_rate");
  EXPECT_EQ(refused([](auto& s) { s.t2_min = s.t2_max + 1; }), "t2");
  EXPECT_EQ(refused([](auto& s) { s.latch_uncertainty = -1; }), "latch_uncertainty");
  EXPECT_EQ(refused([](auto& s) { s.latch_offset = TM485_NEVER; }), "latch_offset");
  EXPECT_EQ(refused([](auto& s) { s.power_up_time = 0; }), "power_up_time");
  EXPECT_EQ(refused([](auto& s) { s.reset_count = 0; }), "reset");
  EXPECT_EQ(refused([](auto& s) { s.eeprom_pages = 0; }), "eeprom_pages");
  EXPECT_EQ(refused([](auto& s) { s.eeprom_page_bytes = 128; }), "eeprom_page_bytes");
  EXPECT_EQ(refused([](auto& s) { s.eeprom_write_time = -1; }), "eeprom_times");
}

}  // namespace
}  // namespace tm485
