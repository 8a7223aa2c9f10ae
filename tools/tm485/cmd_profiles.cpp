// tm485 profiles: the presets.

#include <fmt/format.h>

#include "commands.hpp"
#include "json_output.hpp"
#include "output.hpp"
#include "problem.hpp"
#include "quantity.hpp"
#include "tm485/protocol/profile.hpp"

namespace tm485::cli {
namespace {

std::string enids_text(const EnidSet& enids) {
  std::string text;
  for (std::size_t i = 0; i < enids.count; ++i)
    text += fmt::format("{}{:02X}", i == 0 ? "" : " ", enids.values[i]);
  return text.empty() ? "any" : text;
}

std::string profile_json(const Profile& profile) {
  JsonObject t1;
  for (const DataId id : kDataIds)
    t1.set(fmt::format("id{:x}", number(id)), profile.t1[index_of(id)].count());
  JsonObject alarms;
  for (const StatusInfo& info : status_table()) {
    const AlarmLevel level = profile.alarms.level(info.bit);
    alarms.set(info.name, level == AlarmLevel::fault     ? "fault"
                          : level == AlarmLevel::warning ? "warn"
                                                         : "ignore");
  }
  JsonObject json;
  json.set("name", profile.name)
      .set("single_turn_bits", profile.single_turn_bits)
      .set("multi_turn_bits", profile.multi_turn_bits);
  json.set("enids", std::vector<unsigned>(profile.enids.values.begin(),
                                          profile.enids.values.begin() + profile.enids.count));
  json.set("abm_reserved", profile.abm_reserved)
      .set("multi_turn_start", profile.multi_turn_start)
      .set("battery", profile.battery);
  JsonObject reserved;
  reserved.set("sf", profile.reserved_status.sf()).set("almc", profile.reserved_status.almc());
  json.set("reserved_status", std::move(reserved))
      .set("bit_rate", profile.bit_rate)
      .set("echo", profile.echo)
      .set("t1", std::move(t1));
  json.set("t2_min", profile.t2_min.count()).set("t2_max", profile.t2_max.count());
  json.set("latch_offset", profile.latch_offset.count())
      .set("latch_uncertainty", profile.latch_uncertainty.count());
  json.set("power_up_time", profile.power_up_time.count())
      .set("boot_time_min", profile.boot_time_min.count());
  json.set("reset_count", profile.reset_count).set("reset_spacing", profile.reset_spacing.count());
  json.set("reset_zero_settle", profile.reset_zero_settle.count());
  json.set("eeprom_pages", profile.eeprom_pages).set("eeprom_page_bytes", profile.eeprom_page_bytes);
  json.set("eeprom_write_time", profile.eeprom_write_time.count())
      .set("eeprom_page_time", profile.eeprom_page_time.count());
  json.set("eeprom_holds_bus", profile.eeprom_holds_bus).set("alarms", std::move(alarms));
  return json.text() + '\n';
}

std::string profile_row(const Profile& profile) {
  return fmt::format("{:<20} {:>11} {:>10}  {:<7}  {:<8} {}\n", profile.name, profile.single_turn_bits,
                     profile.multi_turn_bits, enids_text(profile.enids), profile.battery ? "yes" : "no",
                     format_time(profile.t1[index_of(DataId::everything)]));
}

}  // namespace

int run_profiles(bool json) {
  Output output;
  if (!json)
    output.write(fmt::format("{:<20} {:>11} {:>10}  {:<7}  {:<8} {}\n", "name", "single-turn", "multi-turn",
                             "ENID", "battery", "T1 of ID3"));
  for (const Profile& profile : profile_presets())
    output.write(json ? profile_json(profile) : profile_row(profile));
  return finish(output, kExitGood);
}

}  // namespace tm485::cli
