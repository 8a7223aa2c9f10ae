// What the doctor can find: one name, one severity, one cause, one remedy each. One table for the command, its JSON and
// docs/doctor.md. Header only, so that the documents' program needs nothing else of the tools.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace tm485::cli::doctor {

enum class Severity : std::uint8_t {
  note,     ///< good to know
  warning,  ///< it works, but less well or less surely than it could
  fault,    ///< it does not work, or not for long
};

[[nodiscard]] constexpr std::string_view name(Severity severity) noexcept {
  return severity == Severity::fault ? "fault" : severity == Severity::warning ? "warning" : "note";
}

/// In the order in which they are looked for.
enum class FindingId : std::uint8_t {
  cannot_open,
  port_gone,
  latency_timer,
  kernel_not_realtime,
  kernel_improvable,
  release_bound,
  no_reply,
  echo_only,
  own_echo,
  echo_missing,
  swapped_pair,
  wrong_rate,
  garbled,
  late_release,
  reply_start_disturbed,
  noise,
  occasional_errors,
  host_late,
  t2_outside,
  profile_differs,
  resolution_differs,
  battery_missing,
  battery_unused,
  alarm_fault,
  alarm_warning,
  eeprom_busy,
};

struct FindingInfo {
  FindingId id;
  std::string_view name;  ///< stable identifier, as printed in JSON
  Severity severity;
  std::string_view cause;
  std::string_view remedy;
};

inline constexpr std::array<FindingInfo, 26> kFindings{{
    {FindingId::cannot_open, "cannot_open", Severity::fault, "the port does not open",
     "see what was seen: it names the failed step and what to change"},
    {FindingId::port_gone, "port_gone", Severity::fault, "the device vanished while it was examined",
     "plug it in again and look at its cable and supply; dmesg says what the system saw"},
    {FindingId::latency_timer, "latency_timer", Severity::warning,
     "the USB adapter keeps received bytes until its latency timer ends",
     "set it to 1 ms: echo 1 > /sys/bus/usb-serial/devices/ttyUSB0/latency_timer (as root, or by a udev "
     "rule)"},
    {FindingId::kernel_not_realtime, "kernel_not_realtime", Severity::warning,
     "a setting of this machine keeps a real-time thread from running as it should",
     "tm485 rt-check says for each setting what to change"},
    {FindingId::kernel_improvable, "kernel_improvable", Severity::note,
     "this machine could be less late than it is", "tm485 rt-check says for each setting what to change"},
    {FindingId::release_bound, "release_bound", Severity::warning,
     "the port may leave the line later than a reply may begin, so it can spoil the first byte of one",
     "let hardware switch the direction: an adapter or transceiver that does it by itself, a UART with DE"},
    {FindingId::no_reply, "no_reply", Severity::fault,
     "nothing comes back: no supply at the encoder, a wire that is open or on the wrong terminal, A and B "
     "swapped, another bit rate, the adapter's driver is never switched on, or no encoder of this family",
     "measure the supply at the encoder; check A, B and ground; swap A and B; see which rates were tried; "
     "look "
     "at the line with an oscilloscope while `tm485 read` runs"},
    {FindingId::echo_only, "echo_only", Severity::fault,
     "the port hears exactly what it sends and nothing else, so its driver and its receiver work and the "
     "encoder "
     "is silent: no supply, an open wire, A and B swapped (the port still hears itself rightly), or another "
     "bit "
     "rate; which of them, this port cannot tell",
     "measure the supply at the encoder; swap A and B and run this again; see which rates were tried; then "
     "--echo, "
     "because this port hears itself"},
    {FindingId::own_echo, "own_echo", Severity::fault,
     "the port receives its own requests before the replies, and the profile does not say so",
     "give --echo, or echo = true in the profile; or disable the receiver while sending (RE on DE)"},
    {FindingId::echo_missing, "echo_missing", Severity::fault,
     "the profile or --echo says that the port receives its own requests, but it does not",
     "leave --echo out, or set echo = false in the profile"},
    {FindingId::swapped_pair, "swapped_pair", Severity::fault,
     "what is received is inverted: A and B of the receiving pair are swapped, or the receiver's output is "
     "inverted",
     "swap A and B where the port receives"},
    {FindingId::wrong_rate, "wrong_rate", Severity::fault,
     "the encoder speaks at another bit rate than the profile",
     "set bit_rate in a profile file to the rate that was found (tm485 profiles lists what a profile has)"},
    {FindingId::garbled, "garbled", Severity::fault,
     "something answers, but not one byte sequence of it is a reply: another protocol, another bit rate, "
     "another "
     "talker on the line, or heavy noise",
     "check that it is a TM485 or T-format encoder and the only one on the line; check termination, shield "
     "and "
     "ground"},
    {FindingId::late_release, "late_release", Severity::fault,
     "the beginning of the replies is spoilt, always, and their rest is good: the port's driver is still on "
     "the "
     "line when the encoder begins",
     "let hardware switch the direction: an adapter or transceiver that does it by itself, a UART with DE; a "
     "line "
     "switched by software cannot be off within 2.8 us"},
    {FindingId::reply_start_disturbed, "reply_start_disturbed", Severity::fault,
     "of some replies the beginning is spoilt and the rest is good: between request and reply the line "
     "floats and "
     "picks up noise, or the port's driver sometimes leaves late",
     "terminate both ends (120 ohm), bias the idle line (A up, B down), connect the grounds; if the "
     "direction is "
     "switched by software, let hardware do it"},
    {FindingId::noise, "noise", Severity::fault,
     "many exchanges fail: noise, a bad connection, missing "
     "termination or ground, or another talker; where only replies are missing, the requests are hit or the "
     "host "
     "was too late",
     "check shield, ground and 120 ohm at both ends, keep the cable away from the motor's; then tm485 bench "
     "counts "
     "what is left"},
    {FindingId::occasional_errors, "occasional_errors", Severity::warning,
     "few exchanges fail: a servo loop bridges them, but a healthy line has none",
     "check shield, ground and termination; count over a longer time: tm485 bench --seconds 60"},
    {FindingId::host_late, "host_late", Severity::warning,
     "replies are good but handed over later than the port promises: this machine is busy with something "
     "else",
     "stop what else runs, or give this port a core of its own: tm485 rt-check says what the machine allows"},
    {FindingId::t2_outside, "t2_outside", Severity::fault,
     "replies begin outside the window that the profile allows, so good replies are refused",
     "set t2_min and t2_max in a profile file around what was seen"},
    {FindingId::profile_differs, "profile_differs", Severity::fault,
     "the encoder reports an encoder ID that the profile does not accept", "use the profile that fits"},
    {FindingId::resolution_differs, "resolution_differs", Severity::fault,
     "the positions do not fit into the profile's single-turn bits: ENID alone does not tell the resolution",
     "use a profile of the right resolution; the encoder's type plate has it"},
    {FindingId::battery_missing, "battery_missing", Severity::fault,
     "the encoder reports that it has no battery, and the profile counts on one: turns do not survive a "
     "power-off",
     "connect the battery, then tm485 reset PORT multiturn and reference the axis; or use the profile "
     "without "
     "_battery"},
    {FindingId::battery_unused, "battery_unused", Severity::note,
     "the encoder reports a good battery, and the profile ignores one",
     "with the profile of the same name and _battery, a lost turn count is a fault"},
    {FindingId::alarm_fault, "alarm_fault", Severity::fault,
     "the encoder reports an alarm that this profile calls a fault", "see the remedy of the bit"},
    {FindingId::alarm_warning, "alarm_warning", Severity::warning,
     "the encoder reports an alarm that this profile calls a warning", "see the remedy of the bit"},
    {FindingId::eeprom_busy, "eeprom_busy", Severity::fault,
     "the EEPROM says busy for longer than any write or page change takes: another master writes, or it is "
     "broken",
     "make sure that nothing else talks to the encoder; switch its supply off and on"},
}};

[[nodiscard]] constexpr const FindingInfo& describe(FindingId id) noexcept {
  return kFindings[static_cast<std::size_t>(id)];
}

static_assert([] {
  for (std::size_t i = 0; i < kFindings.size(); ++i)
    if (static_cast<std::size_t>(kFindings[i].id) != i) return false;
  return kFindings.back().id == FindingId::eeprom_busy;
}());

}  // namespace tm485::cli::doctor
