#include "profile_toml.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <array>
#include <functional>
#include <limits>
#include <optional>
#include <set>
#include <string>

#include "plain_text.hpp"
#include "quantity.hpp"

namespace tm485::cli {
namespace {

/// Where a value stands and what would be right there.
struct Complaint {
  toml::source_position where;
  std::string what;
};

/// What is said may quote a key or a text of the file.
[[noreturn]] void complain(const toml::node& node, std::string_view what) {
  constexpr std::size_t kLongestComplaint = 1'024;
  throw Complaint{node.source().begin, plain_text(what, kLongestComplaint)};
}

// One reader for each type of a member. Each throws a Complaint that says what is expected.

std::int64_t integer(const toml::node& node, std::int64_t low, std::int64_t high) {
  const auto* value = node.as_integer();
  if (value == nullptr || value->get() < low || value->get() > high)
    complain(node, fmt::format("expected a whole number from {} to {}", low, high));
  return value->get();
}

template <class T>
void read_integer(T& member, const toml::node& node) {
  member = static_cast<T>(integer(node, std::numeric_limits<T>::min(), std::numeric_limits<T>::max()));
}

void read_bool(bool& member, const toml::node& node) {
  const auto* value = node.as_boolean();
  if (value == nullptr) complain(node, "expected true or false");
  member = value->get();
}

std::string_view text_of(const toml::node& node, std::string_view expected) {
  const auto* value = node.as_string();
  if (value == nullptr) complain(node, fmt::format("expected {}", expected));
  return value->get();
}

Time time_of(const toml::node& node) {
  constexpr std::string_view kExpected = "expected a time such as \"62.5us\", or a whole number of ns";
  if (const auto* value = node.as_integer()) {
    constexpr std::int64_t kMost = Time(std::chrono::hours(1)).count();
    if (value->get() > kMost || value->get() < -kMost) complain(node, std::string(kExpected));
    return Time{value->get()};
  }
  const auto* text = node.as_string();
  if (text == nullptr) complain(node, std::string(kExpected));
  std::string_view digits = text->get();
  const bool negative = digits.starts_with('-');
  if (negative) digits.remove_prefix(1);
  const auto time = parse_time(digits, PlainNumber::refused);
  if (!time) complain(node, fmt::format("{}; {}", kExpected, time.error()));
  return negative ? -*time : *time;
}

const toml::table& table_of(const toml::node& node, std::string_view expected) {
  const auto* table = node.as_table();
  if (table == nullptr) complain(node, fmt::format("expected {}", expected));
  return *table;
}

void read_enids(EnidSet& enids, const toml::node& node) {
  const auto* array = node.as_array();
  if (array == nullptr || array->size() > EnidSet::kCapacity)
    complain(node, "expected a list of up to four encoder IDs, for example [0x11, 0x17]; [] accepts any");
  enids = EnidSet{};
  for (const toml::node& item : *array)
    enids.values[enids.count++] = static_cast<std::uint8_t>(integer(item, 0, 0xFF));
}

void read_t1(std::array<Time, kDataIdCount>& t1, const toml::node& node) {
  constexpr std::string_view kExpected =
      "a table with the IDs as keys, for example { id0 = \"40us\", id3 = \"62.5us\" }";
  for (const auto& [key, value] : table_of(node, kExpected)) {
    const auto of_id = [name = key.str()](DataId id) { return name == fmt::format("id{:x}", number(id)); };
    const auto id = std::ranges::find_if(kDataIds, of_id);
    if (id == kDataIds.end())
      complain(value,
               fmt::format("unknown key '{}': the keys are id0 to id3, id6, id7, id8, idc, idd", key.str()));
    t1[index_of(*id)] = time_of(value);
  }
}

void read_reserved_status(StatusSet& status, const toml::node& node) {
  std::uint8_t sf = status.sf();
  std::uint8_t almc = status.almc();
  for (const auto& [key, value] : table_of(node, "a table { sf = 0xCF, almc = 0x3B }")) {
    if (key.str() == "sf")
      sf = static_cast<std::uint8_t>(integer(value, 0, 0xFF));
    else if (key.str() == "almc")
      almc = static_cast<std::uint8_t>(integer(value, 0, 0xFF));
    else
      complain(value, fmt::format("unknown key '{}': the keys are sf and almc", key.str()));
  }
  status = StatusSet(sf, almc);
}

void read_alarms(AlarmPolicy& alarms, const toml::node& node) {
  for (const auto& [key, value] :
       table_of(node, "a table of status bits, for example battery_alarm = \"warn\"")) {
    const auto named = [name = key.str()](const StatusInfo& info) { return info.name == name; };
    const auto info = std::ranges::find_if(status_table(), named);
    if (info == status_table().end()) {
      std::string names;
      for (const StatusInfo& known : status_table()) names += fmt::format(" {}", known.name);
      complain(value, fmt::format("unknown status bit '{}': the bits are{}", key.str(), names));
    }
    constexpr std::string_view kExpected = "\"ignore\", \"warn\" or \"fault\"";
    const std::string_view level = text_of(value, kExpected);
    if (level != "ignore" && level != "warn" && level != "fault")
      complain(value, fmt::format("expected {}", kExpected));
    const StatusSet bit = StatusSet::of(info->bit);
    alarms.warn = level == "warn" ? alarms.warn | bit : alarms.warn & ~bit;
    alarms.fault = level == "fault" ? alarms.fault | bit : alarms.fault & ~bit;
  }
}

/// Profile::name is a view: the names live as long as the process, each once.
void read_name(std::string_view& name, const toml::node& node) {
  constexpr std::size_t kLongest = 64;
  constexpr std::string_view kExpected = "a text of up to 64 bytes, without control characters";
  static std::set<std::string, std::less<>> names;
  const std::string_view text = text_of(node, kExpected);
  if (text.size() > kLongest || plain_text(text) != text)
    complain(node, fmt::format("expected {}", kExpected));
  name = *names.emplace(text).first;
}

struct Key {
  std::string_view name;
  void (*read)(Profile& profile, const toml::node& node);
};

constexpr std::array kKeys{
    Key{"name", [](Profile& p, const toml::node& n) { read_name(p.name, n); }},
    Key{"single_turn_bits", [](Profile& p, const toml::node& n) { read_integer(p.single_turn_bits, n); }},
    Key{"multi_turn_bits", [](Profile& p, const toml::node& n) { read_integer(p.multi_turn_bits, n); }},
    Key{"enids", [](Profile& p, const toml::node& n) { read_enids(p.enids, n); }},
    Key{"abm_reserved", [](Profile& p, const toml::node& n) { read_integer(p.abm_reserved, n); }},
    Key{"multi_turn_start", [](Profile& p, const toml::node& n) { read_integer(p.multi_turn_start, n); }},
    Key{"battery", [](Profile& p, const toml::node& n) { read_bool(p.battery, n); }},
    Key{"reserved_status",
        [](Profile& p, const toml::node& n) { read_reserved_status(p.reserved_status, n); }},
    Key{"alarms", [](Profile& p, const toml::node& n) { read_alarms(p.alarms, n); }},
    Key{"bit_rate", [](Profile& p, const toml::node& n) { read_integer(p.bit_rate, n); }},
    Key{"echo", [](Profile& p, const toml::node& n) { read_bool(p.echo, n); }},
    Key{"t1", [](Profile& p, const toml::node& n) { read_t1(p.t1, n); }},
    Key{"t2_min", [](Profile& p, const toml::node& n) { p.t2_min = time_of(n); }},
    Key{"t2_max", [](Profile& p, const toml::node& n) { p.t2_max = time_of(n); }},
    Key{"latch_offset", [](Profile& p, const toml::node& n) { p.latch_offset = time_of(n); }},
    Key{"latch_uncertainty", [](Profile& p, const toml::node& n) { p.latch_uncertainty = time_of(n); }},
    Key{"power_up_time", [](Profile& p, const toml::node& n) { p.power_up_time = time_of(n); }},
    Key{"boot_time_min", [](Profile& p, const toml::node& n) { p.boot_time_min = time_of(n); }},
    Key{"reset_count", [](Profile& p, const toml::node& n) { read_integer(p.reset_count, n); }},
    Key{"reset_spacing", [](Profile& p, const toml::node& n) { p.reset_spacing = time_of(n); }},
    Key{"reset_zero_settle", [](Profile& p, const toml::node& n) { p.reset_zero_settle = time_of(n); }},
    Key{"eeprom_pages", [](Profile& p, const toml::node& n) { read_integer(p.eeprom_pages, n); }},
    Key{"eeprom_page_bytes", [](Profile& p, const toml::node& n) { read_integer(p.eeprom_page_bytes, n); }},
    Key{"eeprom_write_time", [](Profile& p, const toml::node& n) { p.eeprom_write_time = time_of(n); }},
    Key{"eeprom_page_time", [](Profile& p, const toml::node& n) { p.eeprom_page_time = time_of(n); }},
    Key{"eeprom_holds_bus", [](Profile& p, const toml::node& n) { read_bool(p.eeprom_holds_bus, n); }},
};

Profile read_profile(const toml::table& root) {
  Profile profile;
  if (const toml::node* base = root.get("base")) {
    const auto preset = find_profile(text_of(*base, "the name of a preset"));
    if (!preset) complain(*base, "expected the name of a preset: tm485 profiles lists them");
    profile = *preset;
    profile.name = "custom";
  }
  for (const auto& [key, value] : root) {
    if (key.str() == "base") continue;
    const auto known = std::ranges::find(kKeys, key.str(), &Key::name);
    if (known == kKeys.end()) {
      std::string names = "base";
      for (const Key& k : kKeys) names += fmt::format(", {}", k.name);
      complain(value, fmt::format("unknown key '{}': the keys are {}", key.str(), names));
    }
    known->read(profile, value);
  }
  return profile;
}

/// A contradiction names a field or the beginning of a few: the first line that has one of them.
toml::source_position line_of(const toml::table& root, std::string_view field) {
  toml::source_position first{};
  for (const auto& [key, value] : root) {
    if (key.str() != field && !key.str().starts_with(std::string(field) + "_")) continue;
    if (!first || value.source().begin < first) first = value.source().begin;
  }
  return first ? first : toml::source_position{1, 1};
}

}  // namespace

std::expected<CompiledProfile, Problem> profile_from_toml(std::string_view text, const std::string& path) {
  const auto bad_profile = [&path](const toml::source_position& where, std::string_view what) {
    return std::unexpected(usage_problem("bad_profile", fmt::format("{}:{}: {}", path, where.line, what),
                                         "correct the file; tm485 profiles --json shows values that work"));
  };
  try {
    const toml::table root = toml::parse(text, path);
    const auto compiled = CompiledProfile::compile(read_profile(root));
    if (compiled) return *compiled;
    const ProfileError& error = compiled.error();
    return bad_profile(line_of(root, error.field), fmt::format("{}: {}", error.field, error.why));
  } catch (const Complaint& complaint) {
    return bad_profile(complaint.where, complaint.what);
  } catch (const toml::parse_error& error) {
    return bad_profile(error.source().begin, error.description());
  }
}

}  // namespace tm485::cli
