// The line over some thousand exchanges: errors by cause, T2, the beginnings of the replies.

#include <fmt/format.h>

#include <algorithm>

#include "doctor/binomial.hpp"
#include "doctor/checks.hpp"
#include "quantity.hpp"
#include "stop_signal.hpp"

namespace tm485::cli::doctor {
namespace {

constexpr std::uint32_t kExchanges = 4'000;
constexpr Time kLongest = std::chrono::seconds(4);
/// From this rate on errors are a fault: at 16 kHz, sixteen a second.
constexpr double kManyErrors = 1e-3;
/// Of the failed exchanges, how many must have a spoilt beginning to be called that; noise spoils it in one of eleven.
constexpr double kMostlyStarts = 0.5;
constexpr std::uint32_t kFewest = 5;
constexpr double kMostReplies = 0.5;
constexpr std::uint32_t kShowEvery = 100;
constexpr Time kLateHost = std::chrono::milliseconds(100);

void note_reply(LineRecord& record, const Reading& reading, const Profile& profile) {
  const Time delay = reading.t2.value_or(reading.seen_after);
  record.shortest = std::min(record.shortest, delay);
  record.longest = std::max(record.longest, delay);
  if (reading.t2) {
    ++record.judged_t2;
    if (*reading.t2 < profile.t2_min) ++record.early;
    if (*reading.t2 > profile.t2_max) ++record.late;
  }
  const Frame& frame = *reading.frame;
  if (frame.id() != DataId::everything) return;
  if (record.positions == 0) record.first_abm = frame.abm();
  record.last_abm = frame.abm();
  ++record.positions;
  if ((frame.abs() >> profile.single_turn_bits) != 0) ++record.wide;
  record.largest_abs = std::max(record.largest_abs, frame.abs());
  for (std::size_t bit = 0; bit < kStatusBitCount; ++bit)
    if (frame.status().has(static_cast<StatusBit>(bit))) ++record.status.at(bit);
}

void exchange_many(Patient& patient) {
  const Profile& profile = patient.profile.profile();
  LineRecord& record = patient.record;
  const Time until = patient.line.now() + kLongest;
  while (record.exchanges < kExchanges && patient.line.now() < until && !stop_requested()) {
    if (record.exchanges % kShowEvery == 0)
      patient.progress(fmt::format("exchange {} of {}", record.exchanges, kExchanges));
    const DataId id = record.exchanges % 2 == 0 ? DataId::everything : DataId::single_turn;
    const Request request = *Request::make(id);
    const Reading reading = exchange(patient, request);
    if (patient.line.gone()) break;
    ++record.exchanges;
    if (reading.kind == Kind::reply) {
      note_reply(record, reading, profile);
      continue;
    }
    ++record.failed;
    ++record.errors.at(static_cast<std::size_t>(reading.error));
    if (reading.kind == Kind::spoilt_start) ++record.spoilt_starts;
  }
}

std::string by_cause(const LineRecord& record) {
  std::string text;
  for (std::size_t i = 0; i < record.errors.size(); ++i)
    if (record.errors.at(i) != 0)
      text +=
          fmt::format("{}{} {}", text.empty() ? "" : ", ", name(static_cast<Errc>(i)), record.errors.at(i));
  if (record.stray != 0) text += fmt::format("{}{} stray bytes", text.empty() ? "" : ", ", record.stray);
  return text;
}

void judge_errors(Patient& patient) {
  const LineRecord& record = patient.record;
  const double bound = upper_bound_95(record.failed, record.exchanges);
  const std::string figures =
      fmt::format("{} of {} exchanges failed; with 95 % certainty at most {:.3g} % do", record.failed,
                  record.exchanges, bound * 100.0);
  if (record.failed != 0) {
    const double rate = static_cast<double>(record.failed) / static_cast<double>(record.exchanges);
    const double starts = static_cast<double>(record.spoilt_starts) / static_cast<double>(record.failed);
    const bool at_the_start = starts >= kMostlyStarts && record.failed >= kFewest;
    const std::string seen = fmt::format("{}: {}; {} of them with only the beginning spoilt", figures,
                                         by_cause(record), record.spoilt_starts);
    if (at_the_start && rate >= kMostReplies)
      judge_spoilt_starts(patient, seen);
    else
      patient.report.add(at_the_start          ? FindingId::reply_start_disturbed
                         : rate >= kManyErrors ? FindingId::noise
                                               : FindingId::occasional_errors,
                         seen);
  }
  if (record.handed_over_late != 0)
    patient.report.add(FindingId::host_late,
                       fmt::format("{} of {} replies came later than the port's latency allowance of {}",
                                   record.handed_over_late, record.exchanges,
                                   format_time(patient.line.capability().latency_allowance)));
  patient.report.end_check("noise", figures);
}

void judge_t2(Patient& patient) {
  const LineRecord& record = patient.record;
  const Profile& profile = patient.profile.profile();
  if (record.shortest > record.longest) {
    patient.report.not_judged("T2", "no good reply");
    return;
  }
  const std::string range =
      fmt::format("{} to {}", format_time(record.shortest), format_time(record.longest));
  if (record.judged_t2 == 0) {
    patient.report.not_judged("T2",
                              fmt::format("this port has no wire timestamps; the host had the first byte {} "
                                          "after the request",
                                          range));
    return;
  }
  const std::string window =
      fmt::format("{} to {}", format_time(profile.t2_min), format_time(profile.t2_max));
  if (record.early + record.late != 0)
    patient.report.add(FindingId::t2_outside,
                       fmt::format("{}, of {} replies {} earlier and {} later than the window {}", range,
                                   record.judged_t2, record.early, record.late, window));
  patient.report.end_check("T2", fmt::format("{}; the profile allows {}", range, window));
}

}  // namespace

Reading exchange(Patient& patient, const Request& request) {
  const bool timestamps = patient.line.capability().wire_timestamps;
  const std::size_t echo = patient.echo ? request.bytes().size() : std::size_t{0};
  const std::size_t enough = layout(request.id()).reply_length + echo;
  Heard heard = patient.line.ask(request, patient.profile, enough);
  patient.record.stray += heard.stray;
  const auto judge = [&] {
    return patient.echo ? read_after_echo(heard, request, timestamps) : read(heard, request, timestamps);
  };
  Reading reading = judge();
  // A host that is busy with something else is no fault of the line.
  if (reading.kind == Kind::reply || timestamps || heard.count >= enough || heard.fault != Errc::ok)
    return reading;
  patient.line.listen_more(heard, kLateHost, enough);
  reading = judge();
  if (reading.kind == Kind::reply) ++patient.record.handed_over_late;
  return reading;
}

bool releases_too_late(const Patient& patient) {
  return patient.line.capability().release_bound > patient.profile.profile().t2_max;
}

void judge_spoilt_starts(Patient& patient, std::string seen) {
  const Time bound = patient.line.capability().release_bound;
  const bool off_in_time = bound > Time{0} && bound <= patient.profile.profile().t2_min;
  if (off_in_time)
    seen += fmt::format("; the port states that its driver is off after {}", format_time(bound));
  patient.report.add(off_in_time ? FindingId::reply_start_disturbed : FindingId::late_release,
                     std::move(seen));
}

void judge_release_times(Report& report, const linux_hal::TimeHistogram& times, std::uint32_t late) {
  const std::string figures = fmt::format("{} requests: p50 {}, p99 {}, longest {}", times.count(),
                                          format_time(times.percentile(0.5)),
                                          format_time(times.percentile(0.99)), format_time(times.maximum()));
  if (late != 0)
    report.add(FindingId::release_bound,
               fmt::format("after {} of {} requests the driver left the line when a reply "
                           "could have begun; {}",
                           late, times.count(), figures));
  report.end_check("release", figures);
}

void check_line(Patient& patient) {
  exchange_many(patient);
  if (patient.line.gone()) return;
  if (patient.record.exchanges == 0) {
    patient.report.not_judged("noise", "no exchange");
    return;
  }
  judge_errors(patient);
  judge_t2(patient);
  if (const linux_hal::TimeHistogram* const times = patient.line.port().release_times())
    judge_release_times(patient.report, *times, patient.line.port().late_releases());
}

}  // namespace tm485::cli::doctor
