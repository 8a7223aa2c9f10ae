// The table of errors: complete, unique, and with a cause and a remedy for each.
#include "tm485/errc.hpp"

#include <gtest/gtest.h>

#include <set>
#include <string>

namespace tm485 {
namespace {

TEST(Errc, EveryCodeHasAUniqueNameACauseAndARemedy) {
  std::set<std::string_view> names;
  for (std::size_t i = 0; i < kErrcCount; ++i) {
    const ErrorInfo& info = describe(static_cast<Errc>(i));
    EXPECT_TRUE(names.insert(info.name).second) << info.name << " twice";
    EXPECT_FALSE(info.cause.empty()) << info.name;
    EXPECT_FALSE(info.remedy.empty()) << info.name;
    EXPECT_EQ(info.error_class == ErrorClass::none, i == 0) << info.name;
    for (const char c : info.name)
      EXPECT_TRUE((c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_') << info.name;
  }
}

TEST(Errc, NamesAreThoseOfTheEnumerators) {
  EXPECT_EQ(name(Errc::ok), "ok");
  EXPECT_EQ(name(Errc::timeout), "timeout");
  EXPECT_EQ(name(Errc::incomplete_reply), "incomplete_reply");
  EXPECT_EQ(name(Errc::overlong_reply), "overlong_reply");
  EXPECT_EQ(name(Errc::line_not_quiet), "line_not_quiet");
  EXPECT_EQ(name(Errc::echo_mismatch), "echo_mismatch");
  EXPECT_EQ(name(Errc::t2_out_of_window), "t2_out_of_window");
  EXPECT_EQ(name(Errc::overrun), "overrun");
  EXPECT_EQ(name(Errc::framing_error), "framing_error");
  EXPECT_EQ(name(Errc::send_failed), "send_failed");
  EXPECT_EQ(name(Errc::port_gone), "port_gone");
  EXPECT_EQ(name(Errc::length_error), "length_error");
  EXPECT_EQ(name(Errc::cf_sync_error), "cf_sync_error");
  EXPECT_EQ(name(Errc::cf_parity_error), "cf_parity_error");
  EXPECT_EQ(name(Errc::unknown_id), "unknown_id");
  EXPECT_EQ(name(Errc::cf_mismatch), "cf_mismatch");
  EXPECT_EQ(name(Errc::crc_error), "crc_error");
  EXPECT_EQ(name(Errc::abs_out_of_range), "abs_out_of_range");
  EXPECT_EQ(name(Errc::abm_reserved_bits), "abm_reserved_bits");
  EXPECT_EQ(name(Errc::enid_unexpected), "enid_unexpected");
  EXPECT_EQ(name(Errc::enid_inconsistent), "enid_inconsistent");
  EXPECT_EQ(name(Errc::frames_inconsistent), "frames_inconsistent");
  EXPECT_EQ(name(Errc::position_lost), "position_lost");
  EXPECT_EQ(name(Errc::alarm_fault), "alarm_fault");
  EXPECT_EQ(name(Errc::eeprom_busy), "eeprom_busy");
  EXPECT_EQ(name(Errc::bad_argument), "bad_argument");
  EXPECT_EQ(name(Errc::bad_profile), "bad_profile");
}

TEST(Errc, ClassesFollowTheGroups) {
  EXPECT_EQ(describe(Errc::port_gone).error_class, ErrorClass::transport);
  EXPECT_EQ(describe(Errc::crc_error).error_class, ErrorClass::protocol);
  EXPECT_EQ(describe(Errc::eeprom_busy).error_class, ErrorClass::device);
  EXPECT_EQ(describe(Errc::no_gap).error_class, ErrorClass::usage);
}

TEST(Errc, ACodeOutsideTheTableIsDescribedAndNotReadBeyondIt) {
  EXPECT_EQ(describe(static_cast<Errc>(255)).name, "bad_argument");
}

}  // namespace
}  // namespace tm485
