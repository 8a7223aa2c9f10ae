// Profiles and axis configuration.
#include "tm485/c/profile.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <new>
#include <optional>
#include <span>
#include <string_view>
#include <type_traits>

#include "convert.hpp"
#include "handles.hpp"
#include "tm485/protocol/profile.hpp"

namespace tm485::c {
namespace {

static_assert(kFits<tm485_profile, CompiledProfile>);
static_assert(std::has_unique_object_representations_v<tm485_axis_config>);
static_assert(sizeof(void*) != 8 || std::has_unique_object_representations_v<tm485_profile_settings>);
static_assert(sizeof(tm485_profile_settings::enids) == EnidSet::kCapacity);
static_assert(value(Units::counts) == TM485_UNITS_COUNTS && value(Units::rev) == TM485_UNITS_REV &&
              value(Units::deg) == TM485_UNITS_DEG && value(Units::rad) == TM485_UNITS_RAD);
static_assert(value(Continuity::until_resumed) == TM485_CONTINUITY_UNTIL_RESUMED &&
              value(Continuity::until_homed) == TM485_CONTINUITY_UNTIL_HOMED &&
              value(Continuity::re_reference) == TM485_CONTINUITY_RE_REFERENCE);

/// A text that ends with NUL; what is beyond the length of any name is not looked at. Bounded, and so no strlen(), which
/// would be one more function of a C library.
std::string_view text(const char* begin) noexcept {
  constexpr std::size_t kLongest = 64;
  std::size_t length = 0;
  while (length < kLongest && begin[length] != '\0') ++length;
  return {begin, length};
}

/// The preset of that name, or null.
const Profile* find(const char* name) noexcept {
  if (name == nullptr) return nullptr;
  const std::string_view wanted = text(name);
  for (const Profile& preset : profile_presets())
    if (preset.name == wanted) return &preset;
  return nullptr;
}

void to_c(const Profile& profile, tm485_profile_settings& to) noexcept {
  to = {};
  for (std::size_t i = 0; i < kDataIdCount; ++i) to.t1[i] = profile.t1[i].count();
  to.t2_min = profile.t2_min.count();
  to.t2_max = profile.t2_max.count();
  to.latch_offset = profile.latch_offset.count();
  to.latch_uncertainty = profile.latch_uncertainty.count();
  to.power_up_time = profile.power_up_time.count();
  to.boot_time_min = profile.boot_time_min.count();
  to.reset_spacing = profile.reset_spacing.count();
  to.reset_zero_settle = profile.reset_zero_settle.count();
  to.eeprom_write_time = profile.eeprom_write_time.count();
  to.eeprom_page_time = profile.eeprom_page_time.count();
  to.name = profile.name.data();
  to.bit_rate = profile.bit_rate;
  to.abm_reserved = profile.abm_reserved;
  to.multi_turn_start = profile.multi_turn_start;
  to.reserved_status = profile.reserved_status.bits();
  to.alarm_warn = profile.alarms.warn.bits();
  to.alarm_fault = profile.alarms.fault.bits();
  to.single_turn_bits = profile.single_turn_bits;
  to.multi_turn_bits = profile.multi_turn_bits;
  std::ranges::copy(profile.enids.values, to.enids);
  to.enid_count = profile.enids.count;
  to.battery = flag(profile.battery);
  to.echo = flag(profile.echo);
  to.reset_count = profile.reset_count;
  to.eeprom_pages = profile.eeprom_pages;
  to.eeprom_page_bytes = profile.eeprom_page_bytes;
  to.eeprom_holds_bus = flag(profile.eeprom_holds_bus);
}

Profile from_c(const tm485_profile_settings& settings) noexcept {
  Profile profile;
  if (settings.name != nullptr) profile.name = text(settings.name);
  for (std::size_t i = 0; i < kDataIdCount; ++i) profile.t1[i] = Time{settings.t1[i]};
  profile.t2_min = Time{settings.t2_min};
  profile.t2_max = Time{settings.t2_max};
  profile.latch_offset = Time{settings.latch_offset};
  profile.latch_uncertainty = Time{settings.latch_uncertainty};
  profile.power_up_time = Time{settings.power_up_time};
  profile.boot_time_min = Time{settings.boot_time_min};
  profile.reset_spacing = Time{settings.reset_spacing};
  profile.reset_zero_settle = Time{settings.reset_zero_settle};
  profile.eeprom_write_time = Time{settings.eeprom_write_time};
  profile.eeprom_page_time = Time{settings.eeprom_page_time};
  profile.bit_rate = settings.bit_rate;
  profile.abm_reserved = settings.abm_reserved;
  profile.multi_turn_start = settings.multi_turn_start;
  profile.reserved_status = StatusSet(settings.reserved_status);
  profile.alarms = {.warn = StatusSet(settings.alarm_warn), .fault = StatusSet(settings.alarm_fault)};
  profile.single_turn_bits = settings.single_turn_bits;
  profile.multi_turn_bits = settings.multi_turn_bits;
  std::ranges::copy(settings.enids, profile.enids.values.begin());
  profile.enids.count = settings.enid_count;
  profile.battery = settings.battery != 0;
  profile.echo = settings.echo != 0;
  profile.reset_count = settings.reset_count;
  profile.eeprom_pages = settings.eeprom_pages;
  profile.eeprom_page_bytes = settings.eeprom_page_bytes;
  profile.eeprom_holds_bus = settings.eeprom_holds_bus != 0;
  return profile;
}

/// The core's texts are literals, so a NUL stands behind each (a test looks).
const char* c_text(std::string_view literal) noexcept { return literal.data(); }

tm485_errc compile(tm485_profile* to, const Profile& profile, tm485_profile_error* why) noexcept {
  const auto compiled = CompiledProfile::compile(profile);
  if (!compiled) {
    if (why != nullptr) *why = {c_text(compiled.error().field), c_text(compiled.error().why)};
    return code(compiled.error().code);
  }
  ::new (static_cast<void*>(to->storage)) CompiledProfile(*compiled);
  return TM485_OK;
}

}  // namespace

std::optional<AxisConfig> from_c(const tm485_axis_config& config) noexcept {
  if (config.units > TM485_UNITS_RAD || config.after_restart > TM485_CONTINUITY_RE_REFERENCE)
    return std::nullopt;
  AxisConfig axis;
  axis.reversed = config.reversed != 0;
  axis.zero_offset = config.zero_offset;
  if (config.has_reference_turn != 0) axis.reference_turn = config.reference_turn;
  axis.gear_numerator = config.gear_numerator;
  axis.gear_denominator = config.gear_denominator;
  axis.pole_pairs = config.pole_pairs;
  axis.electrical_offset = config.electrical_offset;
  axis.max_speed_rpm = config.max_speed_rpm;
  axis.max_acceleration_rpm_s = config.max_acceleration_rpm_s;
  axis.units = static_cast<Units>(config.units);
  axis.after_restart = static_cast<Continuity>(config.after_restart);
  return axis;
}

}  // namespace tm485::c

using namespace tm485::c;

size_t tm485_profile_size(void) { return sizeof(tm485::CompiledProfile); }

size_t tm485_preset_count(void) { return tm485::profile_presets().size(); }

const char* tm485_preset_name(size_t index) {
  const auto presets = tm485::profile_presets();
  return index < presets.size() ? presets[index].name.data() : nullptr;
}

tm485_errc tm485_profile_settings_get(tm485_profile_settings* settings, const char* preset) {
  const tm485::Profile* const found = find(preset);
  if (settings == nullptr || found == nullptr) return TM485_ERR_BAD_ARGUMENT;
  to_c(*found, *settings);
  return TM485_OK;
}

tm485_errc tm485_profile_compile(tm485_profile* profile, const tm485_profile_settings* settings,
                                 tm485_profile_error* why) {
  if (why != nullptr) *why = {"", ""};
  if (profile == nullptr || settings == nullptr || !aligned(profile)) return TM485_ERR_BAD_ARGUMENT;
  return compile(profile, from_c(*settings), why);
}

tm485_errc tm485_profile_init(tm485_profile* profile, const char* preset) {
  const tm485::Profile* const found = find(preset);
  if (profile == nullptr || found == nullptr || !aligned(profile)) return TM485_ERR_BAD_ARGUMENT;
  return compile(profile, *found, nullptr);
}

void tm485_profile_settings_of(tm485_profile_settings* settings, const tm485_profile* profile) {
  to_c(profile_in(profile).profile(), *settings);
}

tm485_time tm485_profile_t1(const tm485_profile* profile, tm485_data_id id) {
  if (!tm485::is_data_id(id)) return 0;
  return profile_in(profile).t1(static_cast<tm485::DataId>(id)).count();
}

tm485_time tm485_profile_exchange_max(const tm485_profile* profile, tm485_data_id id) {
  if (!tm485::is_data_id(id)) return 0;
  return profile_in(profile).exchange_max(static_cast<tm485::DataId>(id)).count();
}

void tm485_axis_config_default(tm485_axis_config* config) {
  const tm485::AxisConfig axis;
  *config = {};
  config->zero_offset = axis.zero_offset;
  config->gear_numerator = axis.gear_numerator;
  config->gear_denominator = axis.gear_denominator;
  config->electrical_offset = axis.electrical_offset;
  config->max_speed_rpm = axis.max_speed_rpm;
  config->max_acceleration_rpm_s = axis.max_acceleration_rpm_s;
  config->pole_pairs = axis.pole_pairs;
  config->reversed = flag(axis.reversed);
  config->units = value(axis.units);
  config->after_restart = value(axis.after_restart);
}

double tm485_to_units(int64_t position, const tm485_axis_config* config, unsigned single_turn_bits) {
  const auto axis = from_c(*config);
  return axis ? tm485::to_units(position, *axis, single_turn_bits) : static_cast<double>(position);
}
