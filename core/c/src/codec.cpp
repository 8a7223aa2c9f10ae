// Requests and replies.
#include "tm485/c/codec.h"

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <type_traits>

#include "convert.hpp"
#include "handles.hpp"
#include "tm485/protocol/control_field.hpp"
#include "tm485/protocol/crc.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/layout.hpp"
#include "tm485/protocol/request.hpp"

namespace tm485::c {

static_assert(kMaxRequest == TM485_MAX_REQUEST && kMaxReply == TM485_MAX_REPLY);
static_assert(kPageRegister == TM485_PAGE_REGISTER);
static_assert(std::has_unique_object_representations_v<tm485_request> &&
              std::has_unique_object_representations_v<tm485_reply>);

tm485_request to_c(const Request& request) noexcept {
  tm485_request to{};
  const auto bytes = request.bytes();
  std::ranges::copy(bytes, to.bytes);
  to.length = static_cast<std::uint8_t>(bytes.size());
  to.id = value(request.id());
  to.address = bytes.size() > 1 ? request.address() : std::uint8_t{0};
  to.data = request.data();
  return to;
}

std::expected<Request, Errc> from_c(const tm485_request& request) noexcept {
  if (request.length > TM485_MAX_REQUEST) return std::unexpected(Errc::bad_argument);
  return Request::parse(std::span(request.bytes).first(request.length));
}

tm485_reply to_c(const Reply& reply, const CompiledProfile& profile) noexcept {
  const Frame& frame = reply.frame();
  const Layout& fields = frame.fields();
  tm485_reply to{};
  to.id = value(frame.id());
  if (fields.sf_at != 0) {
    to.has_sf = 1;
    to.sf = frame.sf();
  }
  if (fields.abs_at != 0) {
    to.has_abs = 1;
    to.abs = frame.abs();
  }
  if (fields.enid_at != 0) {
    to.has_enid = 1;
    to.enid = frame.enid();
  }
  if (fields.abm_at != 0) {
    to.has_abm = 1;
    to.abm = frame.abm();
    to.turns = frame.turns(profile.profile().multi_turn_bits);
  }
  if (fields.almc_at != 0) {
    to.has_almc = 1;
    to.almc = frame.almc();
  }
  if (fields.adf_at != 0) {
    to.has_eeprom = 1;
    to.eeprom_address = frame.address();
    to.eeprom_busy = flag(frame.eeprom_busy());
    to.eeprom_data = frame.edf();
  }
  return to;
}

namespace {

tm485_errc put(const std::expected<Request, Errc>& made, tm485_request* to) noexcept {
  if (!made) return code(made.error());
  *to = to_c(*made);
  return TM485_OK;
}

}  // namespace
}  // namespace tm485::c

using namespace tm485::c;
using tm485::DataId;
using tm485::Request;

tm485_errc tm485_request_make(tm485_request* request, tm485_data_id id) {
  if (!tm485::is_data_id(id)) return TM485_ERR_BAD_ARGUMENT;
  return put(Request::make(static_cast<DataId>(id)), request);
}

tm485_errc tm485_request_eeprom_read(tm485_request* request, unsigned address) {
  return put(Request::eeprom_read(address), request);
}

tm485_errc tm485_request_eeprom_write(tm485_request* request, unsigned address, uint8_t data) {
  return put(Request::eeprom_write(address, data), request);
}

tm485_errc tm485_request_parse(tm485_request* request, const uint8_t* bytes, size_t count) {
  return put(Request::parse({bytes, count}), request);
}

tm485_errc tm485_reply_parse(tm485_reply* reply, const uint8_t* bytes, size_t count, tm485_data_id id,
                             const tm485_profile* profile) {
  if (!tm485::is_data_id(id)) return TM485_ERR_BAD_ARGUMENT;
  const auto parsed = tm485::Reply::parse({bytes, count}, static_cast<DataId>(id), profile_in(profile));
  if (!parsed) return code(parsed.error());
  *reply = to_c(*parsed, profile_in(profile));
  return TM485_OK;
}

size_t tm485_request_length(tm485_data_id id) {
  return tm485::is_data_id(id) ? tm485::layout(static_cast<DataId>(id)).request_length : 0;
}

size_t tm485_reply_length(tm485_data_id id) {
  return tm485::is_data_id(id) ? tm485::layout(static_cast<DataId>(id)).reply_length : 0;
}

uint8_t tm485_control_field(tm485_data_id id) { return tm485::make_cf(id); }

tm485_errc tm485_control_field_parse(tm485_data_id* id, uint8_t cf) {
  const auto parsed = tm485::parse_control_field(cf);
  if (!parsed) return code(parsed.error());
  *id = value(*parsed);
  return TM485_OK;
}

uint8_t tm485_crc(const uint8_t* bytes, size_t count) {
  return tm485::crc(std::span<const std::uint8_t>(bytes, count));
}
