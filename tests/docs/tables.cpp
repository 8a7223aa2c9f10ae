// Prints the tables of the documents from the tables of the code: tm485_doc_tables NAME.
#include <algorithm>
#include <array>
#include <cstdio>
#include <iomanip>
#include <iostream>
#include <iterator>
#include <span>
#include <sstream>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "doctor/finding_table.hpp"
#include "tm485/errc.hpp"
#include "tm485/linux/serial_chips.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/sim/fault_plan.hpp"

namespace {

using namespace tm485;

void row(const std::vector<std::string>& cells) {
  for (const std::string& cell : cells) std::cout << "| " << cell << ' ';
  std::cout << "|\n";
}

void head(const std::vector<std::string>& cells) {
  row(cells);
  for (std::size_t i = 0; i < cells.size(); ++i) std::cout << "|---";
  std::cout << "|\n";
}

std::string text(std::string_view view) { return std::string(view); }
std::string code(std::string_view view) { return '`' + std::string(view) + '`'; }

std::string hex(unsigned value, int digits) {
  std::array<char, 16> buffer{};
  std::snprintf(buffer.data(), buffer.size(), "%0*X", digits, value);
  return buffer.data();
}

/// 62500 ns as "62.5 µs", in the largest unit that leaves no leading zero.
std::string span(Time time) {
  const std::int64_t ns = time.count();
  std::ostringstream out;
  if (ns >= 1'000'000'000) {
    out << static_cast<double>(ns) * 1e-9 << " s";
  } else if (ns >= 1'000'000) {
    out << static_cast<double>(ns) * 1e-6 << " ms";
  } else if (ns >= 1'000) {
    out << static_cast<double>(ns) * 1e-3 << " µs";
  } else {
    out << ns << " ns";
  }
  return out.str();
}

std::string name_of(ErrorClass error_class) {
  switch (error_class) {
    case ErrorClass::transport:
      return "transport";
    case ErrorClass::protocol:
      return "protocol";
    case ErrorClass::device:
      return "device";
    case ErrorClass::usage:
      return "usage";
    case ErrorClass::none:
      break;
  }
  return "none";
}

std::string id_text(DataId id) { return "ID" + hex(number(id), 1); }

void errors() {
  head({"name", "class", "cause", "remedy"});
  for (std::size_t i = 0; i < kErrcCount; ++i) {
    const ErrorInfo& info = describe(static_cast<Errc>(i));
    row({code(info.name), name_of(info.error_class), text(info.cause), text(info.remedy)});
  }
}

void findings() {
  head({"name", "severity", "cause", "remedy"});
  for (const cli::doctor::FindingInfo& info : cli::doctor::kFindings)
    row({code(info.name), text(cli::doctor::name(info.severity)), text(info.cause), text(info.remedy)});
}

void status() {
  head({"bit", "name", "cause", "remedy"});
  for (const StatusInfo& info : status_table())
    row({text(info.field), code(info.name), text(info.cause), text(info.remedy)});
}

/// The reply's bytes in their order, from the offsets of the layout.
std::string reply_fields(const Layout& layout) {
  std::vector<std::pair<unsigned, std::string>> fields{{0, "CF"}, {layout.reply_length - 1U, "CRC"}};
  const auto add = [&](unsigned at, std::string_view what) {
    if (at != 0) fields.emplace_back(at, what);
  };
  add(layout.sf_at, "SF");
  add(layout.abs_at, "ABS×3");
  add(layout.enid_at, "ENID");
  add(layout.abm_at, "ABM×3");
  add(layout.almc_at, "ALMC");
  add(layout.adf_at, "ADF");
  add(layout.edf_at, "EDF");
  std::sort(fields.begin(), fields.end());
  std::string line;
  for (const auto& field : fields) line += (line.empty() ? "" : " ") + field.second;
  return line;
}

std::string request_fields(const Layout& layout) {
  constexpr std::array<std::string_view, 5> kByLength{"", "CF", "", "CF ADF CRC", "CF ADF EDF CRC"};
  return text(kByLength.at(layout.request_length));
}

void exchanges() {
  constexpr std::array<std::string_view, kDataIdCount> kMeaning{
      "single-turn position", "multi-turn position", "encoder ID",       "everything", "EEPROM write",
      "reset errors",         "reset single-turn",   "reset multi-turn", "EEPROM read"};
  head({"ID", "CF", "meaning", "`DataId`", "request", "reply", "bytes out + back"});
  constexpr std::array<std::string_view, kDataIdCount> kNames{
      "single_turn",  "multi_turn",        "encoder_id",       "everything", "eeprom_write",
      "reset_errors", "reset_single_turn", "reset_multi_turn", "eeprom_read"};
  for (const Layout& layout : kLayouts) {
    const std::size_t i = index_of(layout.id);
    row({id_text(layout.id), hex(control_field(layout.id), 2), text(kMeaning.at(i)), code(kNames.at(i)),
         request_fields(layout), reply_fields(layout),
         std::to_string(layout.request_length) + " + " + std::to_string(layout.reply_length)});
  }
}

void timing() {
  Profile typical;
  typical.t2_min = typical.t2_max = Time{3'000};
  const auto at_3_us = CompiledProfile::compile(typical);
  const auto profile = CompiledProfile::compile(Profile{});
  if (!at_3_us || !profile) return;
  head(
      {"exchange", "wire time at T2 = 3 µs", "at the default T2 window", "default T1", "slack at T2 = 3 µs"});
  for (const Layout& layout : kLayouts) {
    const Time wire = at_3_us->exchange_min(layout.id);
    const Time t1 = profile->t1(layout.id);
    row({id_text(layout.id), span(wire),
         span(profile->exchange_min(layout.id)) + " to " + span(profile->exchange_max(layout.id)), span(t1),
         span(t1 - wire)});
  }
}

std::string enids(const EnidSet& set) {
  if (set.count == 0) return "any";
  std::string line;
  for (std::size_t i = 0; i < set.count; ++i) line += (i == 0 ? "" : ", ") + hex(set.values.at(i), 2);
  return line;
}

template <class F>
void preset_row(std::string_view title, F field) {
  std::vector<std::string> cells{text(title)};
  for (const Profile& preset : profile_presets()) cells.push_back(field(preset));
  row(cells);
}

void preset_head(std::string_view title) {
  std::vector<std::string> cells{text(title)};
  for (const Profile& preset : profile_presets()) cells.push_back(code(preset.name));
  head(cells);
}

void presets() {
  const auto yes_no = [](bool yes) { return std::string(yes ? "yes" : "no"); };
  preset_head("setting");
  preset_row("`single_turn_bits`", [](const Profile& p) { return std::to_string(p.single_turn_bits); });
  preset_row("`multi_turn_bits`", [](const Profile& p) { return std::to_string(p.multi_turn_bits); });
  preset_row("`enids`", [](const Profile& p) { return enids(p.enids); });
  preset_row("`abm_reserved`", [](const Profile& p) { return hex(p.abm_reserved, 6); });
  preset_row("`multi_turn_start`", [](const Profile& p) { return std::to_string(p.multi_turn_start); });
  preset_row("`battery`", [&](const Profile& p) { return yes_no(p.battery); });
  preset_row("`reserved_status` SF, ALMC", [](const Profile& p) {
    return hex(p.reserved_status.sf(), 2) + ", " + hex(p.reserved_status.almc(), 2);
  });
  preset_row("`bit_rate` bit/s", [](const Profile& p) { return std::to_string(p.bit_rate); });
  preset_row("`echo`", [&](const Profile& p) { return yes_no(p.echo); });
  for (const DataId id : kDataIds)
    preset_row("`t1` " + id_text(id), [id](const Profile& p) { return span(p.t1.at(index_of(id))); });
  preset_row("`t2_min`", [](const Profile& p) { return span(p.t2_min); });
  preset_row("`t2_max`", [](const Profile& p) { return span(p.t2_max); });
  preset_row("`latch_offset`", [](const Profile& p) { return span(p.latch_offset); });
  preset_row("`latch_uncertainty`", [](const Profile& p) { return "±" + span(p.latch_uncertainty); });
  preset_row("`power_up_time`", [](const Profile& p) { return span(p.power_up_time); });
  preset_row("`boot_time_min`", [](const Profile& p) { return span(p.boot_time_min); });
  preset_row("`reset_count`", [](const Profile& p) { return std::to_string(p.reset_count); });
  preset_row("`reset_spacing`", [](const Profile& p) { return span(p.reset_spacing); });
  preset_row("`reset_zero_settle`", [](const Profile& p) { return span(p.reset_zero_settle); });
  preset_row("`eeprom_pages`", [](const Profile& p) { return std::to_string(p.eeprom_pages); });
  preset_row("`eeprom_page_bytes`", [](const Profile& p) { return std::to_string(p.eeprom_page_bytes); });
  preset_row("`eeprom_write_time`", [](const Profile& p) { return span(p.eeprom_write_time); });
  preset_row("`eeprom_page_time`", [](const Profile& p) { return span(p.eeprom_page_time); });
  preset_row("`eeprom_holds_bus`", [&](const Profile& p) { return yes_no(p.eeprom_holds_bus); });
}

void alarms() {
  preset_head("bit");
  for (const StatusInfo& info : status_table()) {
    preset_row(text(info.field) + " " + code(info.name), [&](const Profile& p) {
      const AlarmLevel level = p.alarms.level(info.bit);
      return std::string(level == AlarmLevel::fault     ? "**fault**"
                         : level == AlarmLevel::warning ? "warn"
                                                        : "·");
    });
  }
}

std::string megabits(std::uint32_t rate) {
  if (rate == 0) return "not known";
  std::ostringstream out;
  out << std::fixed << std::setprecision(3) << rate / 1e6;
  return out.str();
}

/// Of a rate against 2.5 Mbit/s.
std::string error_of(std::uint32_t rate) {
  if (rate == 0) return "";
  std::ostringstream out;
  out << std::showpos << std::fixed << std::setprecision(2)
      << (static_cast<double>(rate) / linux_hal::kTm485Rate - 1.0) * 100.0 << " %";
  return out.str();
}

void usb_chips() {
  head({"chip", "ids", "Mbit/s", "error", "2.5 Mbit/s", "remark", "source"});
  for (const linux_hal::UsbChip& chip : linux_hal::usb_chips())
    row({text(chip.name), code(hex(chip.vendor, 4) + ':' + hex(chip.product, 4)), megabits(chip.nearest_rate),
         error_of(chip.nearest_rate), text(linux_hal::verdict_name(chip.verdict)), text(chip.remark),
         text(chip.source)});
}

void uart_drivers() {
  constexpr std::array<std::uint32_t, 4> kClocks{24'000'000, 48'000'000, 64'000'000, 100'000'000};
  std::vector<std::string> titles{"driver", "UART"};
  for (const std::uint32_t clock : kClocks)
    titles.push_back(std::to_string(clock / 1'000'000) + " MHz clock");
  for (const char* title : {"receive time-out", "remark", "source"}) titles.emplace_back(title);
  head(titles);
  for (const linux_hal::UartDriver& driver : linux_hal::uart_drivers()) {
    std::vector<std::string> cells{code(driver.driver), text(driver.name)};
    for (const std::uint32_t clock : kClocks) {
      const auto rate = linux_hal::nearest_rate(driver.divider, clock, linux_hal::kTm485Rate);
      if (!rate) {
        cells.emplace_back("not known");
      } else {
        cells.push_back((linux_hal::rate_acceptable(linux_hal::kTm485Rate, *rate) ? "" : "no: ") +
                        megabits(*rate) + ", " + error_of(*rate));
      }
    }
    cells.push_back(driver.timeout_bits == 0 ? "not known" : std::to_string(driver.timeout_bits) + " bits");
    cells.push_back(text(driver.remark));
    cells.push_back(text(driver.source));
    row(cells);
  }
}

/// What a parameter is that is not given; empty: 0, which does nothing.
std::string otherwise(const sim::FaultParameter& row) {
  constexpr std::array<std::string_view, 3> kDirections{"requests", "replies", "both"};
  constexpr std::array<std::string_view, 2> kPairs{"pair", "receive"};
  const auto index = static_cast<std::size_t>(row.otherwise);
  if (row.unit == sim::FaultUnit::direction) return std::string(kDirections.at(index));
  if (row.unit == sim::FaultUnit::pair) return std::string(kPairs.at(index));
  if (row.otherwise == 0.0) return {};
  std::ostringstream value;
  if (row.unit == sim::FaultUnit::time)
    value << row.otherwise * 1e-6 << " ms";
  else if (row.unit == sim::FaultUnit::ratio)
    value << row.otherwise * 1e2 << " %";
  else
    value << row.otherwise;
  return value.str();
}

/// A fault's parameters as they are typed, with what they are without being given.
std::string parameters_of(const sim::FaultInfo& info) {
  std::string all;
  for (const sim::FaultParameter& row : info.parameters) {
    if (row.name.empty()) continue;
    if (!all.empty()) all += ", ";
    const std::string value = row.required ? "needed" : otherwise(row);
    all += code(row.name) + (value.empty() ? "" : " (" + value + ")");
  }
  return all;
}

void faults() {
  head({"fault", "parameters", "p", "server", "what happens"});
  for (const sim::FaultInfo& info : sim::fault_kinds()) {
    row({code(info.name), parameters_of(info), info.by_chance ? "p, every" : "", info.served ? "yes" : "",
         text(info.meaning)});
  }
}

}  // namespace

int main(int argc, char** argv) {
  constexpr std::array<std::pair<std::string_view, void (*)()>, 10> kTables{{{"errors", errors},
                                                                             {"status", status},
                                                                             {"exchanges", exchanges},
                                                                             {"timing", timing},
                                                                             {"presets", presets},
                                                                             {"alarms", alarms},
                                                                             {"findings", findings},
                                                                             {"usb_chips", usb_chips},
                                                                             {"uart_drivers", uart_drivers},
                                                                             {"faults", faults}}};
  for (const auto& [name, print] : kTables) {
    if (argc == 2 && name == argv[1]) {
      print();
      return 0;
    }
  }
  std::cerr << "usage: tm485_doc_tables";
  for (const auto& table : kTables) std::cerr << (table.first == kTables[0].first ? " " : "|") << table.first;
  std::cerr << '\n';
  return 2;
}
