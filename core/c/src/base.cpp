// Error codes, status bits, version.
#include "tm485/c/base.h"

#include <cstdint>

#include "tm485/errc.hpp"
#include "tm485/protocol/control_field.hpp"
#include "tm485/protocol/status.hpp"
#include "tm485/time.hpp"
#include "tm485/version.hpp"

namespace {

using tm485::DataId;
using tm485::Errc;

template <class Enum>
consteval bool same(Enum enumerator, int value) {
  return static_cast<int>(enumerator) == value;
}

static_assert(tm485::kErrcCount == TM485_ERRC_COUNT);
static_assert(same(Errc::ok, TM485_OK));
static_assert(same(Errc::timeout, TM485_ERR_TIMEOUT));
static_assert(same(Errc::incomplete_reply, TM485_ERR_INCOMPLETE_REPLY));
static_assert(same(Errc::overlong_reply, TM485_ERR_OVERLONG_REPLY));
static_assert(same(Errc::line_not_quiet, TM485_ERR_LINE_NOT_QUIET));
static_assert(same(Errc::echo_mismatch, TM485_ERR_ECHO_MISMATCH));
static_assert(same(Errc::t2_out_of_window, TM485_ERR_T2_OUT_OF_WINDOW));
static_assert(same(Errc::overrun, TM485_ERR_OVERRUN));
static_assert(same(Errc::framing_error, TM485_ERR_FRAMING_ERROR));
static_assert(same(Errc::send_failed, TM485_ERR_SEND_FAILED));
static_assert(same(Errc::port_gone, TM485_ERR_PORT_GONE));
static_assert(same(Errc::length_error, TM485_ERR_LENGTH_ERROR));
static_assert(same(Errc::cf_sync_error, TM485_ERR_CF_SYNC_ERROR));
static_assert(same(Errc::cf_parity_error, TM485_ERR_CF_PARITY_ERROR));
static_assert(same(Errc::unknown_id, TM485_ERR_UNKNOWN_ID));
static_assert(same(Errc::cf_mismatch, TM485_ERR_CF_MISMATCH));
static_assert(same(Errc::crc_error, TM485_ERR_CRC_ERROR));
static_assert(same(Errc::abs_out_of_range, TM485_ERR_ABS_OUT_OF_RANGE));
static_assert(same(Errc::abm_reserved_bits, TM485_ERR_ABM_RESERVED_BITS));
static_assert(same(Errc::enid_unexpected, TM485_ERR_ENID_UNEXPECTED));
static_assert(same(Errc::eeprom_address_mismatch, TM485_ERR_EEPROM_ADDRESS_MISMATCH));
static_assert(same(Errc::enid_inconsistent, TM485_ERR_ENID_INCONSISTENT));
static_assert(same(Errc::frames_inconsistent, TM485_ERR_FRAMES_INCONSISTENT));
static_assert(same(Errc::status_inconsistent, TM485_ERR_STATUS_INCONSISTENT));
static_assert(same(Errc::position_implausible, TM485_ERR_POSITION_IMPLAUSIBLE));
static_assert(same(Errc::position_lost, TM485_ERR_POSITION_LOST));
static_assert(same(Errc::encoder_restarted, TM485_ERR_ENCODER_RESTARTED));
static_assert(same(Errc::alarm_fault, TM485_ERR_ALARM_FAULT));
static_assert(same(Errc::eeprom_busy, TM485_ERR_EEPROM_BUSY));
static_assert(same(Errc::eeprom_mismatch, TM485_ERR_EEPROM_MISMATCH));
static_assert(same(Errc::shaft_moves, TM485_ERR_SHAFT_MOVES));
static_assert(same(Errc::reset_without_effect, TM485_ERR_RESET_WITHOUT_EFFECT));
static_assert(same(Errc::eeprom_page_refused, TM485_ERR_EEPROM_PAGE_REFUSED));
static_assert(same(Errc::bad_argument, TM485_ERR_BAD_ARGUMENT));
static_assert(same(Errc::bad_state, TM485_ERR_BAD_STATE));
static_assert(same(Errc::no_gap, TM485_ERR_NO_GAP));
static_assert(same(Errc::busy, TM485_ERR_BUSY));
static_assert(same(Errc::period_below_t1, TM485_ERR_PERIOD_BELOW_T1));
static_assert(same(Errc::period_below_port, TM485_ERR_PERIOD_BELOW_PORT));
static_assert(same(Errc::servo_mismatch, TM485_ERR_SERVO_MISMATCH));
static_assert(same(Errc::lead_too_short, TM485_ERR_LEAD_TOO_SHORT));
static_assert(same(Errc::abandoned, TM485_ERR_ABANDONED));
static_assert(same(Errc::bad_profile, TM485_ERR_BAD_PROFILE));

static_assert(tm485::kDataIdCount == TM485_DATA_ID_COUNT);
static_assert(same(DataId::single_turn, TM485_ID_SINGLE_TURN));
static_assert(same(DataId::multi_turn, TM485_ID_MULTI_TURN));
static_assert(same(DataId::encoder_id, TM485_ID_ENCODER_ID));
static_assert(same(DataId::everything, TM485_ID_EVERYTHING));
static_assert(same(DataId::eeprom_write, TM485_ID_EEPROM_WRITE));
static_assert(same(DataId::reset_errors, TM485_ID_RESET_ERRORS));
static_assert(same(DataId::reset_single_turn, TM485_ID_RESET_SINGLE_TURN));
static_assert(same(DataId::reset_multi_turn, TM485_ID_RESET_MULTI_TURN));
static_assert(same(DataId::eeprom_read, TM485_ID_EEPROM_READ));

static_assert(tm485::kNever.count() == TM485_NEVER);

/// An unknown code has the texts of bad_argument.
const tm485::ErrorInfo& info(tm485_errc code) noexcept {
  return tm485::describe(code < TM485_ERRC_COUNT ? static_cast<Errc>(code) : Errc::bad_argument);
}
const tm485::StatusInfo& status(unsigned bit) noexcept {
  return tm485::status_table()[bit % tm485::kStatusBitCount];
}

}  // namespace

// The texts are literals, so a NUL stands behind each (a test looks).
const char* tm485_errc_name(tm485_errc code) { return info(code).name.data(); }
const char* tm485_errc_cause(tm485_errc code) { return info(code).cause.data(); }
const char* tm485_errc_remedy(tm485_errc code) { return info(code).remedy.data(); }

const char* tm485_status_name(unsigned bit) { return status(bit).name.data(); }
const char* tm485_status_field(unsigned bit) { return status(bit).field.data(); }
const char* tm485_status_cause(unsigned bit) { return status(bit).cause.data(); }
const char* tm485_status_remedy(unsigned bit) { return status(bit).remedy.data(); }

const char* tm485_version(int* major_number, int* minor_number, int* patch_number) {
  const tm485::Version version = tm485::version();
  if (major_number != nullptr) *major_number = version.major_number;
  if (minor_number != nullptr) *minor_number = version.minor_number;
  if (patch_number != nullptr) *patch_number = version.patch_number;
  return version.text.data();
}

unsigned tm485_abi(void) { return TM485_ABI; }
