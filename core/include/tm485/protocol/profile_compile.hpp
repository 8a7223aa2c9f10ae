// Bodies of CompiledProfile: what makes a profile impossible, and how the rest becomes words.
// Included by profile.hpp. Specification: section 7.
#pragma once

#include <string_view>

#include "tm485/protocol/profile.hpp"

namespace tm485 {
namespace detail {

/// Puts `bits` of a field that starts at byte `at` of the reply into a rule.
constexpr void fix_bits(ReplyRule& rule, unsigned at, std::uint32_t mask, std::uint32_t expected) noexcept {
  for (unsigned i = 0; i < 4 && at + i < kMaxReply; ++i) {
    const std::uint64_t byte_mask = (mask >> (8 * i)) & 0xFFU;
    const std::uint64_t byte_expected = (expected >> (8 * i)) & 0xFFU;
    const unsigned byte = at + i;
    if (byte < 8) {
      rule.low_mask |= byte_mask << (8 * byte);
      rule.low_expected |= byte_expected << (8 * byte);
    } else {
      rule.high_mask |= static_cast<std::uint32_t>(byte_mask << (8 * (byte - 8)));
      rule.high_expected |= static_cast<std::uint32_t>(byte_expected << (8 * (byte - 8)));
    }
  }
}

[[nodiscard]] constexpr ReplyRule compile_rule(const Profile& profile, const Layout& row) noexcept {
  ReplyRule rule;
  rule.length = row.reply_length;
  fix_bits(rule, 0, 0xFF, control_field(row.id));
  if (row.abs_at != 0) fix_bits(rule, row.abs_at, 0xFFFFFFU & ~((1U << profile.single_turn_bits) - 1U), 0);
  if (row.abm_at != 0) fix_bits(rule, row.abm_at, profile.abm_reserved, 0);
  if (row.enid_at != 0 && profile.enids.count != 0) {
    unsigned differing = 0;
    for (std::size_t i = 1; i < profile.enids.count; ++i)
      differing |= static_cast<unsigned>(profile.enids.values[0] ^ profile.enids.values[i]);
    fix_bits(rule, row.enid_at, 0xFFU & ~differing, profile.enids.values[0] & ~differing);
    rule.enid_listed = profile.enids.count > 1;
  }
  return rule;
}

/// No span in a profile is longer than this, so sums of them cannot overflow.
inline constexpr Time kLongest = std::chrono::seconds(60);

[[nodiscard]] constexpr ProfileError find_contradiction(const Profile& p) noexcept {
  using namespace std::string_view_literals;  // no strlen() at run time
  const auto error = [](std::string_view field, std::string_view why) {
    return ProfileError{Errc::bad_profile, field, why};
  };
  const auto width_ok = [](unsigned bits) { return bits >= 8 && bits <= 24; };
  const auto span_ok = [](Time t) { return t >= Time{0} && t <= kLongest; };
  if (!width_ok(p.single_turn_bits)) return error("single_turn_bits"sv, "must be 8 to 24"sv);
  if (p.multi_turn_bits != 0 && !width_ok(p.multi_turn_bits))
    return error("multi_turn_bits"sv, "must be 0 or 8 to 24"sv);
  if (p.enids.count > EnidSet::kCapacity) return error("enids"sv, "at most four"sv);
  if (p.abm_reserved > 0xFFFFFF) return error("abm_reserved"sv, "ABM has 24 bits"sv);
  if (p.multi_turn_bits != 0 && (p.abm_reserved & ((1U << p.multi_turn_bits) - 1U)) != 0)
    return error("abm_reserved"sv, "overlaps the multi-turn count"sv);
  if (p.bit_rate < 9'600 || p.bit_rate > 10'000'000)
    return error("bit_rate"sv, "must be 9600 to 10000000 bit/s"sv);
  if (!span_ok(p.t2_min) || !span_ok(p.t2_max) || p.t2_min > p.t2_max)
    return error("t2"sv, "the window is empty or longer than 60 s"sv);
  if (!span_ok(p.latch_uncertainty)) return error("latch_uncertainty"sv, "must be 0 to 60 s"sv);
  if (p.latch_offset < -kLongest || p.latch_offset > kLongest)
    return error("latch_offset"sv, "must be within 60 s"sv);
  if (!span_ok(p.power_up_time) || !span_ok(p.boot_time_min) || p.boot_time_min > p.power_up_time)
    return error("power_up_time"sv, "must be 0 to 60 s and not below boot_time_min"sv);
  if (p.reset_count == 0 || !span_ok(p.reset_spacing) || !span_ok(p.reset_zero_settle))
    return error("reset"sv, "count must be 1 or more, times 0 to 60 s"sv);
  if (p.eeprom_pages == 0 || p.eeprom_pages > 32) return error("eeprom_pages"sv, "must be 1 to 32"sv);
  if (p.eeprom_page_bytes == 0 || p.eeprom_page_bytes > 127)
    return error("eeprom_page_bytes"sv, "must be 1 to 127"sv);
  if (!span_ok(p.eeprom_write_time) || !span_ok(p.eeprom_page_time))
    return error("eeprom_times"sv, "must be 0 to 60 s"sv);
  const Time character{10'000'000'000 / p.bit_rate};
  for (const Layout& row : kLayouts) {
    const Time t1 = p.t1[index_of(row.id)];
    if (!span_ok(t1)) return error("t1"sv, "must be 0 to 60 s"sv);
    if (t1 < character * (row.request_length + row.reply_length) + p.t2_min)
      return error("t1"sv, "shorter than the exchange itself"sv);
  }
  return {Errc::ok, {}, {}};
}

}  // namespace detail

constexpr CompiledProfile::CompiledProfile(const Profile& profile) noexcept
    : profile_(profile), character_ns_(static_cast<std::uint32_t>(10'000'000'000 / profile.bit_rate)) {
  for (std::size_t i = 0; i < kDataIdCount; ++i) rules_[i] = detail::compile_rule(profile, kLayouts[i]);
}

constexpr std::expected<CompiledProfile, ProfileError> CompiledProfile::compile(
    const Profile& profile) noexcept {
  if (const ProfileError error = detail::find_contradiction(profile); error.code != Errc::ok)
    return std::unexpected(error);
  return CompiledProfile(profile);
}

}  // namespace tm485
