// Every way in which the stack can fail: one name, one cause, one remedy each.
//
// "Nothing yet" is a state and has no code here. The texts live in a table (errc.cpp) that the
// code, the tools and the documentation share.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string_view>

namespace tm485 {

/// The error codes. `ok` is zero and means "no error" where a code is stored as a value.
enum class Errc : std::uint8_t {
  ok = 0,

  // Transport: the line and the port.
  timeout,           ///< no byte of a reply before the deadline
  incomplete_reply,  ///< a reply began and did not finish before the deadline
  overlong_reply,    ///< more bytes than the reply has
  line_not_quiet,    ///< bytes arrived while the encoder had nothing to say
  echo_mismatch,     ///< the echo of the own request differs from the request
  t2_out_of_window,  ///< the reply began outside the profile's T2 window
  overrun,           ///< the receiver lost bytes
  framing_error,     ///< a character without a stop bit
  send_failed,       ///< the port did not take, or did not finish, a request
  port_gone,         ///< the device vanished

  // Protocol: what the bytes say.
  length_error,             ///< no frame of this family has this length
  cf_sync_error,            ///< CF bits 0..2 are not 0,1,0
  cf_parity_error,          ///< CF bit 7 is not the even parity of the data ID
  unknown_id,               ///< a well-formed CF of a data ID that is not defined
  cf_mismatch,              ///< a good CF, but not that of the request
  crc_error,                ///< the CRC X^8+1 does not hold
  abs_out_of_range,         ///< ABS has a bit at or above the single-turn width
  abm_reserved_bits,        ///< ABM has a bit that the profile fixes at 0
  enid_unexpected,          ///< ENID is not among those of the profile
  eeprom_address_mismatch,  ///< an EEPROM reply names another address than the request
  enid_inconsistent,        ///< ID2 and ID3 report different encoder IDs
  frames_inconsistent,      ///< successive positions that no shaft can do
  status_inconsistent,      ///< SF and ALMC contradict each other
  position_implausible,     ///< the shaft cannot be there: wrong bits that pass the CRC, or a step
  position_lost,      ///< too long without a frame: turns are uncertain, or the encoder may have restarted
  encoder_restarted,  ///< the shaft is elsewhere, and the turn count is back at its start value

  // Device: what the encoder reports.
  alarm_fault,           ///< an SF or ALMC bit whose policy is "fault" is set
  eeprom_busy,           ///< ADF bit 7: the EEPROM is busy, the data are void
  eeprom_mismatch,       ///< a byte of the EEPROM is not what was wanted
  shaft_moves,           ///< a zero reset wants a shaft that stands still
  reset_without_effect,  ///< ten good replies, and nothing has changed
  eeprom_page_refused,   ///< the page register does not take the page

  // Usage: what the caller asked for.
  bad_argument,       ///< an argument outside its range
  bad_state,          ///< not possible in the present state
  no_gap,             ///< the cyclic pattern leaves no room for this exchange
  busy,               ///< another background exchange is pending
  period_below_t1,    ///< a period below the minimum T1 of the ID
  period_below_port,  ///< a period below what the port holds
  servo_mismatch,     ///< pattern and servo period are no whole multiples of one another
  lead_too_short,     ///< the sample would not be there when the servo tick comes
  abandoned,          ///< given up before its reply: it may have taken effect
  bad_profile,        ///< a profile that contradicts itself
};

inline constexpr std::size_t kErrcCount = static_cast<std::size_t>(Errc::bad_profile) + 1;

enum class ErrorClass : std::uint8_t { none, transport, protocol, device, usage };

/// What a person needs to know about an error. All texts are in static storage.
struct ErrorInfo {
  std::string_view name;  ///< stable identifier, as printed in JSON
  ErrorClass error_class;
  std::string_view cause;   ///< what happened, one clause
  std::string_view remedy;  ///< what to do about it, one clause
};

/// The table entry of a code. Any thread or interrupt; constant time.
[[nodiscard]] const ErrorInfo& describe(Errc code) noexcept;

/// The stable identifier of a code, for example "crc_error". Any thread or interrupt.
[[nodiscard]] inline std::string_view name(Errc code) noexcept { return describe(code).name; }

}  // namespace tm485
