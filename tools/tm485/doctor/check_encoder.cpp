// The encoder behind the line: who it is, whether the profile fits, what it complains about. It is only read.

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "doctor/checks.hpp"
#include "quantity.hpp"
#include "stop_signal.hpp"

namespace tm485::cli::doctor {
namespace {

constexpr Time kBusyPause = std::chrono::milliseconds(1);
constexpr Time kLongestBusy = std::chrono::milliseconds(100);  ///< a page change takes 18 ms

/// The presets of which `fits` holds, of the same family if `like` is a preset of one.
template <class Fits>
std::string presets(const Profile& like, Fits fits) {
  const std::string_view family = like.name.substr(0, like.name.find('_'));
  std::string same;
  std::string all;
  for (const Profile& preset : profile_presets()) {
    if (preset.enids.count == 0 || preset.battery != like.battery || !fits(preset)) continue;
    const std::string item = fmt::format("--profile {}", preset.name);
    all += (all.empty() ? "" : " or ") + item;
    if (preset.name.starts_with(family)) same += (same.empty() ? "" : " or ") + item;
  }
  return same.empty() ? all : same;
}

std::string list(const EnidSet& enids) {
  std::string text;
  for (std::size_t i = 0; i < enids.count; ++i)
    text += fmt::format("{}{:02X}", i == 0 ? "" : ", ", enids.values.at(i));
  return text.empty() ? "any" : text;
}

void judge_enid(Patient& patient) {
  const Profile& profile = patient.profile.profile();
  if (!patient.enid) {
    patient.report.not_judged("ENID", "no good reply to ID2");
    return;
  }
  const std::uint8_t enid = *patient.enid;
  if (!profile.enids.accepts(enid)) {
    Finding& finding = patient.report.add(
        FindingId::profile_differs,
        fmt::format("ENID {:02X}; {} accepts {}", enid, profile.name, list(profile.enids)));
    const std::string fitting =
        presets(profile, [enid](const Profile& preset) { return preset.enids.accepts(enid); });
    finding.remedy = fitting.empty() ? fmt::format("write a profile file with enids = [0x{:02X}]", enid)
                                     : fmt::format(
                                           "give {}, if the type plate agrees: 17-bit encoders exist that "
                                           "report 17",
                                           fitting);
  }
  patient.report.end_check("ENID", fmt::format("{:02X}; the profile accepts {}", enid, list(profile.enids)));
}

/// Whole turns between the first and the last position, either way round the 16 bits.
unsigned turns_passed(const LineRecord& record) {
  const auto turned =
      static_cast<std::int16_t>(static_cast<std::uint16_t>(record.last_abm - record.first_abm));
  return static_cast<unsigned>(turned < 0 ? -turned : turned);
}

void judge_resolution(Patient& patient) {
  const LineRecord& record = patient.record;
  const Profile& profile = patient.profile.profile();
  if (record.positions == 0) {
    patient.report.not_judged("resolution", "no position");
    return;
  }
  if (patient.report.has(FindingId::profile_differs)) {
    patient.report.not_judged("resolution", "another profile is needed first");
    return;
  }
  const unsigned bits = profile.single_turn_bits;
  const auto seen = static_cast<unsigned>(std::bit_width(record.largest_abs));
  constexpr unsigned kFewestTurns = 2;
  constexpr std::uint32_t kFewestPositions = 200;
  const unsigned turns = turns_passed(record);
  // The CRC lets one bad frame of 256 through: a few wide positions say nothing.
  const bool too_wide = record.wide * 20 > record.positions;
  const bool too_narrow = turns >= kFewestTurns && record.positions >= kFewestPositions && seen + 1 < bits;
  if (too_wide || too_narrow) {
    Finding& finding = patient.report.add(
        FindingId::resolution_differs,
        too_wide ? fmt::format("{} of {} positions lie beyond {} bit; the largest needs {} bit", record.wide,
                               record.positions, bits, seen)
                 : fmt::format("over {} turns no position needed more than {} of {} bit", turns, seen, bits));
    const std::string fitting = presets(profile, [seen](const Profile& preset) {
      return preset.single_turn_bits >= seen && preset.single_turn_bits < seen + 6;
    });
    if (!fitting.empty()) finding.remedy = fmt::format("give {}, if the type plate agrees", fitting);
  }
  patient.report.end_check("resolution",
                           fmt::format("{} positions up to {} of {}{}", record.positions, record.largest_abs,
                                       std::uint64_t{1} << bits,
                                       turns < kFewestTurns && !too_wide
                                           ? "; the shaft did not turn: turn it to have it judged in full"
                                           : ""));
}

/// A bit that more than half of the replies have.
StatusSet usual_status(const LineRecord& record) {
  StatusSet set;
  for (std::size_t bit = 0; bit < kStatusBitCount; ++bit)
    if (record.status.at(bit) * 2 > record.positions) set = set | StatusSet::of(static_cast<StatusBit>(bit));
  return set;
}

std::string reset_hint(StatusBit bit, const std::string& port) {
  switch (bit) {
    case StatusBit::over_speed:
    case StatusBit::counter_overflow:
    case StatusBit::multi_turn_error:
    case StatusBit::battery_error:
      return fmt::format(" (tm485 reset {} multiturn)", port);
    case StatusBit::single_turn_error:
    case StatusBit::counting_error:
    case StatusBit::battery_alarm:
      return fmt::format(" (tm485 reset {} errors)", port);
    default:
      return {};
  }
}

void judge_status(Patient& patient) {
  const Profile& profile = patient.profile.profile();
  if (patient.record.positions == 0) {
    patient.report.not_judged("alarms", "no reply to ID3");
    return;
  }
  const StatusSet status = usual_status(patient.record);
  const StatusSet no_battery =
      StatusSet::of(StatusBit::battery_error) | StatusSet::of(StatusBit::battery_alarm);
  StatusSet left = status;
  if (profile.battery && (status & no_battery) == no_battery) {
    patient.report.add(
        FindingId::battery_missing,
        fmt::format("SF {:02X}, ALMC {:02X}: battery error and alarm at once", status.sf(), status.almc()));
    // What an encoder without a battery has as well.
    left = left &
           ~(no_battery | StatusSet::of(StatusBit::multi_turn_group) | StatusSet::of(StatusBit::over_speed) |
             StatusSet::of(StatusBit::counter_overflow) | StatusSet::of(StatusBit::multi_turn_error));
  }
  const bool knows_battery = profile.reserved_status.almc() == 0 && profile.enids.count != 0;
  if (!profile.battery && knows_battery && (status & no_battery).empty() && profile.multi_turn_bits != 0)
    patient.report.add(FindingId::battery_unused, fmt::format("SF {:02X}, ALMC {:02X}: no battery bit is set",
                                                              status.sf(), status.almc()));
  // SF.4 and SF.5 only sum up bits of ALMC.
  if (left.has(StatusBit::counting_error)) left = left & ~StatusSet::of(StatusBit::single_turn_error);
  if ((left.almc() & 0xF0U) != 0 || patient.report.has(FindingId::battery_missing))
    left = left & ~StatusSet::of(StatusBit::multi_turn_group);
  for (const StatusInfo& info : status_table()) {
    const AlarmLevel level = profile.alarms.level(info.bit);
    if (!left.has(info.bit) || level == AlarmLevel::none) continue;
    Finding& finding =
        patient.report.add(level == AlarmLevel::fault ? FindingId::alarm_fault : FindingId::alarm_warning,
                           fmt::format("{} {}", info.field, info.name));
    finding.cause = info.cause;
    finding.remedy = std::string(info.remedy) + reset_hint(info.bit, patient.options.port);
  }
  patient.report.end_check("alarms", fmt::format("SF {:02X}, ALMC {:02X}", status.sf(), status.almc()));
}

void judge_eeprom(Patient& patient) {
  patient.progress("asking the EEPROM");
  const Request request = *Request::eeprom_read(0);
  const Time until = patient.line.now() + kLongestBusy;
  unsigned replies = 0;
  do {
    const Reading reading = exchange(patient, request);
    if (reading.kind == Kind::reply) {
      ++replies;
      if (!reading.frame->eeprom_busy()) {
        patient.report.end_check("EEPROM", "ready");
        return;
      }
    }
    patient.line.pause(kBusyPause);
  } while (!stop_requested() && patient.line.now() < until);
  if (replies == 0) {
    patient.report.not_judged("EEPROM", "no good reply to a read");
    return;
  }
  patient.report.add(FindingId::eeprom_busy,
                     fmt::format("ADF.7 in {} replies over {}", replies, format_time(kLongestBusy)));
  patient.report.end_check("EEPROM", "busy");
}

}  // namespace

void check_encoder(Patient& patient) {
  judge_enid(patient);
  judge_resolution(patient);
  judge_status(patient);
  judge_eeprom(patient);
}

}  // namespace tm485::cli::doctor
