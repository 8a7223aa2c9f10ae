#include "tm485/protocol/profile.hpp"

namespace tm485 {
namespace {

// What T-format encoders share, where it differs from TM485: SF.6 and SF.7 and all of ALMC have a
// meaning, the turn count restarts at 0, position reads go on during EEPROM writes.
constexpr Profile tformat(std::string_view name, std::uint8_t bits, EnidSet enids, bool battery) {
  Profile p;
  p.name = name;
  p.single_turn_bits = bits;
  p.enids = enids;
  p.multi_turn_start = 0;
  p.battery = battery;
  p.reserved_status = StatusSet(0xCF, 0x00);
  p.alarms = battery ? kAlarmsWithBattery : kAlarmsWithoutBattery;
  p.eeprom_pages = 6;
  p.eeprom_holds_bus = false;
  p.t1 = Profile::default_t1(Time{40'000});
  return p;
}

constexpr Profile tm485(std::string_view name, std::uint8_t bits, std::uint8_t enid,
                        std::uint8_t multi_turn_bits, bool battery = false) {
  Profile p;
  p.name = name;
  p.single_turn_bits = bits;
  p.multi_turn_bits = multi_turn_bits;
  p.abm_reserved =
      multi_turn_bits == 0 ? 0U : p.abm_reserved;  // what such an encoder sends there is not documented
  p.enids = EnidSet{{enid}, 1};
  p.battery = battery;
  if (battery) p.alarms = kAlarmsWithBattery;
  return p;
}

constexpr Profile any() {
  Profile p;
  p.name = "any";
  p.single_turn_bits = 24;
  p.enids = EnidSet{};
  p.abm_reserved = 0;
  p.reserved_status = StatusSet(0xCF, 0x00);
  p.alarms = AlarmPolicy{};
  p.multi_turn_start = 0;
  return p;
}

constexpr Profile kPresets[]{
    tm485("tm485_17", 17, 0x11, 16),
    tm485("tm485_17_battery", 17, 0x11, 16, true),
    tm485("tm485_17_st", 17, 0x00, 0),
    tm485("tm485_23", 23, 0x17, 16),
    tm485("tm485_23_battery", 23, 0x17, 16, true),
    // 17-bit encoders that report 0x17 exist, so ENID does not tell the resolution.
    tformat("tformat_17", 17, EnidSet{{0x11, 0x17}, 2}, false),
    tformat("tformat_17_battery", 17, EnidSet{{0x11, 0x17}, 2}, true),
    tformat("tformat_23", 23, EnidSet{{0x17}, 1}, false),
    tformat("tformat_23_battery", 23, EnidSet{{0x17}, 1}, true),
    any(),
};

consteval bool all_compile() {
  for (const Profile& preset : kPresets)
    if (!CompiledProfile::compile(preset)) return false;
  return true;
}
static_assert(all_compile());

}  // namespace

std::span<const Profile> profile_presets() noexcept { return kPresets; }

std::expected<Profile, Errc> find_profile(std::string_view name) noexcept {
  for (const Profile& preset : kPresets)
    if (preset.name == name) return preset;
  return std::unexpected(Errc::bad_argument);
}

}  // namespace tm485
