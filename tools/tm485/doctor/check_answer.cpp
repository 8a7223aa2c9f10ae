// Does anything answer, and if not, what does the line sound like?

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <filesystem>

#include "doctor/checks.hpp"
#include "quantity.hpp"
#include "stop_signal.hpp"
#include "tm485/linux/port_identity.hpp"

namespace tm485::cli::doctor {
namespace {

constexpr std::array<DataId, 3> kAsked{DataId::encoder_id, DataId::everything, DataId::single_turn};
constexpr unsigned kRounds = 6;
constexpr unsigned kTriesAtAnotherRate = 3;
constexpr Time kPauseWhileSilent = std::chrono::milliseconds(20);

/// What encoders and adapters of this family are set to, the likely ones first.
constexpr std::array<std::uint32_t, 12> kRates{2'500'000, 5'000'000, 4'000'000, 2'000'000,
                                               3'000'000, 1'000'000, 1'250'000, 1'500'000,
                                               921'600,   500'000,   460'800,   115'200};

struct Tally {
  unsigned long_replies = 0, long_spoilt = 0;  // to ID3, whose end is good for longest
  unsigned asked = 0, silent = 0, replies = 0, echoed_replies = 0, echoes = 0, inverted = 0, garbage = 0;
  std::string example;  ///< of bytes that are no reply

  void add(const Reading& reading, const Heard& heard, DataId id) {
    ++asked;
    if (id == DataId::everything && reading.kind != Kind::silence) ++long_replies;
    if (id == DataId::everything && reading.kind == Kind::spoilt_start) ++long_spoilt;
    switch (reading.kind) {
      case Kind::silence:
        ++silent;
        return;
      case Kind::reply:
        ++replies;
        if (reading.echoed) ++echoed_replies;
        return;
      case Kind::echo:
        ++echoes;
        return;
      case Kind::inverted:
        ++inverted;
        break;
      case Kind::spoilt_start:
        break;
      case Kind::garbage:
        ++garbage;
        break;
    }
    if (!example.empty()) return;
    for (const std::uint8_t byte : heard.all())
      example += fmt::format("{}{:02X}", example.empty() ? "" : " ", byte);
  }
};

Reading ask(Patient& patient, DataId id, Tally& tally) {
  const Request request = *Request::make(id);
  const Heard heard = patient.line.ask(request, patient.profile, Heard::kCapacity);
  const Reading reading = read(heard, request, patient.line.capability().wire_timestamps);
  tally.add(reading, heard, id);
  if (reading.kind == Kind::reply && id == DataId::encoder_id) patient.enid = reading.frame->enid();
  return reading;
}

/// An encoder that has just been switched on is silent for a while.
void wait_for_a_byte(Patient& patient, Tally& tally) {
  const Time until = patient.line.now() + patient.profile.profile().power_up_time;
  while (!stop_requested() && !patient.line.gone() && patient.line.now() < until) {
    if (ask(patient, DataId::encoder_id, tally).kind != Kind::silence) return;
    patient.line.pause(kPauseWhileSilent);
  }
}

std::string rate_list(const std::vector<std::uint32_t>& rates) {
  std::string list;
  for (const std::uint32_t rate : rates) list += fmt::format("{}{}", list.empty() ? "" : ", ", rate);
  return list.empty() ? "none" : list;
}

/// The rate at which the encoder answers, of those that the port can make, or 0. The port is open at the profile's again.
std::uint32_t find_rate(Patient& patient, std::vector<std::uint32_t>& tried) {
  const std::uint32_t usual = patient.profile.profile().bit_rate;
  std::uint32_t found = 0;
  for (const std::uint32_t rate : kRates) {
    if (rate == usual || found != 0 || stop_requested()) continue;
    patient.progress(fmt::format("trying {} bit/s", rate));
    if (!patient.line.open(patient.options, rate)) continue;  // a rate that this port cannot make
    tried.push_back(rate);
    Tally tally;
    for (unsigned k = 0; k < kTriesAtAnotherRate && found == 0; ++k)
      if (ask(patient, DataId::encoder_id, tally).kind == Kind::reply) found = rate;
  }
  if (!patient.line.open(patient.options, usual)) return 0;  // gone() says so
  return found;
}

/// Nobody knows the rate of a line that has none: a socket, a pseudo-terminal.
bool has_rate(const Patient& patient) {
  const std::string& port = patient.options.port;
  std::error_code ignored;
  if (port.starts_with("unix:") || std::filesystem::is_socket(port, ignored)) return false;
  return linux_hal::identify_port(port).bus != linux_hal::PortBus::pseudo_terminal;
}

void judge_silence(Patient& patient, const Tally& tally) {
  std::vector<std::uint32_t> tried;
  const bool rates = has_rate(patient);
  const std::uint32_t rate = rates ? find_rate(patient, tried) : 0;
  if (patient.line.gone()) return;
  const std::uint32_t usual = patient.profile.profile().bit_rate;
  const std::string sound = tally.example.empty() ? "" : fmt::format("; heard for example {}", tally.example);
  if (rate != 0) {
    patient.report.add(FindingId::wrong_rate,
                       fmt::format("no reply at {} bit/s, good replies at {} bit/s{}", usual, rate, sound));
    patient.report.end_check("answer", fmt::format("at {} bit/s only", rate));
    return;
  }
  const std::string others = rates ? fmt::format("; no reply at {} bit/s either", rate_list(tried))
                                   : "; this port has no bit rate to try";
  const unsigned heard = tally.asked - tally.silent;
  if (heard == 0)
    patient.report.add(FindingId::no_reply, fmt::format("not one byte after {} requests at {} bit/s{}",
                                                        tally.asked, usual, others));
  else if (tally.echoes == heard)
    patient.report.add(FindingId::echo_only,
                       fmt::format("{} of {} requests came back as they were sent, and nothing after them{}",
                                   tally.echoes, tally.asked, others));
  else
    patient.report.add(FindingId::garbled, fmt::format("bytes after {} of {} requests, none a reply{}{}",
                                                       heard, tally.asked, sound, others));
  patient.report.end_check("answer", heard == 0 ? "silence" : "no reply");
}

void judge_echo(Patient& patient, const Tally& tally) {
  const bool echo = tally.echoed_replies * 2 > tally.replies;
  const bool wanted = patient.profile.profile().echo;
  patient.echo = echo;
  if (echo && !wanted)
    patient.report.add(FindingId::own_echo, fmt::format("{} of {} replies came after the request itself",
                                                        tally.echoed_replies, tally.replies));
  if (!echo && wanted)
    patient.report.add(FindingId::echo_missing,
                       fmt::format("{} of {} replies came without the request",
                                   tally.replies - tally.echoed_replies, tally.replies));
  patient.report.end_check("echo", echo ? "the port hears itself" : "none");
}

}  // namespace

void check_answer(Patient& patient) {
  Tally tally;
  patient.progress("waiting for a reply");
  wait_for_a_byte(patient, tally);
  for (unsigned round = 0; round < kRounds && !stop_requested(); ++round) {
    patient.progress("asking ID2, ID3, ID0");
    for (const DataId id : kAsked) (void)ask(patient, id, tally);
    if (tally.silent == tally.asked) break;  // it was waited for long enough
  }
  if (stop_requested() || patient.line.gone()) return;
  const unsigned heard = tally.asked - tally.silent;
  if (tally.replies != 0) {
    patient.answers = true;
    patient.report.end_check("answer", fmt::format("{} of {} requests answered", tally.replies, tally.asked));
    judge_echo(patient, tally);
  } else if (tally.inverted * 2 > heard || (tally.inverted >= kRounds / 2 && tally.echoes == 0)) {
    patient.report.add(FindingId::swapped_pair, fmt::format("{} of {} answers are inverted, for example {}",
                                                            tally.inverted, heard, tally.example));
    patient.report.end_check("answer", "inverted");
  } else if (tally.long_spoilt * 2 > tally.long_replies) {
    judge_spoilt_starts(
        patient, fmt::format("the first bytes of {} of {} replies to ID3 are wrong and the rest is good; "
                             "heard for example {}",
                             tally.long_spoilt, tally.long_replies, tally.example));
    patient.report.end_check("answer", "beginnings spoilt");
  } else if (tally.garbage != 0 && releases_too_late(patient)) {
    patient.report.add(
        FindingId::late_release,
        fmt::format("no reply is readable, and the port states that its driver leaves the line up to {} "
                    "after a request; heard for example {}",
                    format_time(patient.line.capability().release_bound), tally.example));
    patient.report.end_check("answer", "replies spoilt");
  } else {
    judge_silence(patient, tally);
  }
}

}  // namespace tm485::cli::doctor
