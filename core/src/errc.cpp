#include "tm485/errc.hpp"

#include <array>

namespace tm485 {
namespace {

struct Row {
  Errc code;
  ErrorInfo info;
};

using enum ErrorClass;

constexpr std::array<Row, kErrcCount> kErrors{{
    {Errc::ok, {"ok", none, "no error", "nothing to do"}},

    {Errc::timeout,
     {"timeout", transport, "no reply before the deadline",
      "check power, wiring and the profile's bit rate"}},
    {Errc::incomplete_reply,
     {"incomplete_reply", transport, "a reply began but did not finish before the deadline",
      "look for noise, a wrong bit rate or a receiver that loses bytes"}},
    {Errc::overlong_reply,
     {"overlong_reply", transport, "more bytes arrived than the reply has",
      "look for an echo of the own request or a second talker"}},
    {Errc::line_not_quiet,
     {"line_not_quiet", transport, "bytes arrived while the encoder had nothing to say",
      "look for a second talker, missing bias resistors or a floating line"}},
    {Errc::echo_mismatch,
     {"echo_mismatch", transport, "the echo of the own request differs from the request",
      "look for a second talker, A and B swapped, or a port that does not echo (profile.echo)"}},
    {Errc::t2_out_of_window,
     {"t2_out_of_window", transport, "the reply began outside the profile's T2 window",
      "widen t2_min or t2_max in the profile if this encoder is known to do so"}},
    {Errc::overrun,
     {"overrun", transport, "the receiver lost bytes",
      "read sooner: raise the priority or use a deeper buffer"}},
    {Errc::framing_error,
     {"framing_error", transport, "a character had no stop bit",
      "check the bit rate, termination and the driver's release time"}},
    {Errc::send_failed,
     {"send_failed", transport, "the port did not send the request", "check the device and its driver"}},
    {Errc::port_gone,
     {"port_gone", transport, "the device vanished", "look at plug, power and cable, then plug it in again"}},

    {Errc::length_error,
     {"length_error", protocol, "no frame of this kind has this length", "check for lost or extra bytes"}},
    {Errc::cf_sync_error,
     {"cf_sync_error", protocol, "bits 0 to 2 of CF are not 0,1,0",
      "look for noise, or another protocol on the line"}},
    {Errc::cf_parity_error,
     {"cf_parity_error", protocol, "bit 7 of CF is not the parity of its data ID",
      "look for noise, or another protocol on the line"}},
    {Errc::unknown_id,
     {"unknown_id", protocol, "CF is well formed but its data ID is not defined",
      "check that this encoder is of the T-format family"}},
    {Errc::cf_mismatch,
     {"cf_mismatch", protocol, "the reply answers another data ID than the one asked for",
      "look for late replies or a second talker"}},
    {Errc::crc_error,
     {"crc_error", protocol, "the CRC does not hold",
      "look for noise: shielding, termination, common ground"}},
    {Errc::abs_out_of_range,
     {"abs_out_of_range", protocol, "ABS has bits above the single-turn width",
      "check the profile's resolution against the encoder"}},
    {Errc::abm_reserved_bits,
     {"abm_reserved_bits", protocol, "ABM has bits that the profile fixes at 0",
      "check the profile's multi-turn width against the encoder"}},
    {Errc::enid_unexpected,
     {"enid_unexpected", protocol, "ENID is not among those that the profile expects",
      "choose the profile of this encoder, or list its ENID"}},
    {Errc::eeprom_address_mismatch,
     {"eeprom_address_mismatch", protocol, "the EEPROM reply names another address than the request",
      "repeat the request; look for noise"}},
    {Errc::enid_inconsistent,
     {"enid_inconsistent", protocol, "ID2 and ID3 report different encoder IDs",
      "look for noise, or more than one encoder on the line"}},
    {Errc::frames_inconsistent,
     {"frames_inconsistent", protocol, "successive positions that no shaft can do",
      "check the profile's resolution and the configured maximum speed"}},
    {Errc::status_inconsistent,
     {"status_inconsistent", protocol, "SF and ALMC contradict each other",
      "look for noise; an encoder that says so always is believed from the second time on"}},
    {Errc::position_implausible,
     {"position_implausible", protocol, "a position, or turns, where the shaft cannot be",
      "look for noise; check the configured maximum speed and acceleration"}},
    {Errc::position_lost,
     {"position_lost", protocol,
      "too long without a good frame, or turns that contradict the position: the turns cannot be counted on, "
      "or the encoder may have restarted",
      "find what failed, or kept the bus from being called; for turns, read ID3 in the cycle"}},
    {Errc::encoder_restarted,
     {"encoder_restarted", protocol, "the turn count is back at its start value: the encoder was restarted",
      "check the encoder's supply and its connector, then reference the axis"}},

    {Errc::alarm_fault,
     {"alarm_fault", device, "the encoder reports a fault", "see the alarm's own cause and remedy"}},
    {Errc::eeprom_busy,
     {"eeprom_busy", device, "the EEPROM is busy and its data are void", "repeat the request later"}},
    {Errc::eeprom_mismatch,
     {"eeprom_mismatch", device, "a byte of the EEPROM is not what was wanted",
      "read it again; a cell that does not take its value is worn out"}},
    {Errc::shaft_moves,
     {"shaft_moves", device, "the shaft moved while a zero reset wanted it to stand still",
      "hold the shaft, or use the axis's zero_offset instead"}},
    {Errc::reset_without_effect,
     {"reset_without_effect", device, "ten reset requests were answered, and nothing has changed",
      "check that this encoder knows the reset; hold the shaft for a zero reset"}},
    {Errc::eeprom_page_refused,
     {"eeprom_page_refused", device, "the EEPROM's page register does not take the page",
      "check eeprom_pages in the profile against the encoder"}},

    {Errc::bad_argument,
     {"bad_argument", usage, "an argument is outside its range", "see the function's documentation"}},
    {Errc::bad_state,
     {"bad_state", usage, "not possible in the present state",
      "wait for start-up to finish, or stop the cycle first"}},
    {Errc::no_gap,
     {"no_gap", usage, "the cyclic pattern leaves no room for this exchange",
      "use a longer period, let it steal slots (steal_every), or stop the cycle first"}},
    {Errc::busy, {"busy", usage, "another background exchange is pending", "take its completion first"}},
    {Errc::period_below_t1,
     {"period_below_t1", usage, "the period is below the minimum T1 of this ID",
      "use a period of at least T1"}},
    {Errc::period_below_port,
     {"period_below_port", usage, "the period is below what the port can hold",
      "use a longer period or a faster port"}},
    {Errc::servo_mismatch,
     {"servo_mismatch", usage, "neither of pattern and servo period is a whole multiple of the other",
      "choose a slot with which the pattern's length divides the servo period, or is a multiple of it"}},
    {Errc::lead_too_short,
     {"lead_too_short", usage, "the sample would arrive after the servo tick",
      "use a lead of at least the longest time from latch to sample"}},
    {Errc::abandoned,
     {"abandoned", usage, "the exchange was given up before its reply",
      "find out by reading whether it took effect"}},
    {Errc::bad_profile,
     {"bad_profile", usage, "the profile contradicts itself", "see the field that is named"}},
}};

consteval bool ordered() {
  for (std::size_t i = 0; i < kErrcCount; ++i)
    if (static_cast<std::size_t>(kErrors[i].code) != i) return false;
  return true;
}
static_assert(ordered(), "describe() indexes the table by the code");

}  // namespace

const ErrorInfo& describe(Errc code) noexcept {
  const auto index = static_cast<std::size_t>(code);
  return kErrors[index < kErrcCount ? index : static_cast<std::size_t>(Errc::bad_argument)].info;
}

}  // namespace tm485
