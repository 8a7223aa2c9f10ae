// The codec: bytes to Reply, requests, a profile that was compiled by the compiler.
#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>

#include "rig.hpp"

using namespace tm485;

extern "C" {
Errc part_codec_reply(const std::uint8_t* bytes, std::size_t count, DataId id, const CompiledProfile& profile,
                      std::optional<Reply>& to) {
  const auto reply = Reply::parse({bytes, count}, id, profile);
  if (!reply) return reply.error();
  to = *reply;
  return Errc::ok;
}
bool part_codec_frame(const std::uint8_t* bytes, std::size_t count, std::optional<Frame>& to) {
  const auto frame = Frame::parse({bytes, count});
  if (frame) to = *frame;
  return frame.has_value();
}
bool part_codec_request(DataId id, std::optional<Request>& to) {
  const auto request = Request::make(id);
  if (request) to = *request;
  return request.has_value();
}
bool part_codec_eeprom_read(unsigned address, std::optional<Request>& to) {
  const auto request = Request::eeprom_read(address);
  if (request) to = *request;
  return request.has_value();
}
bool part_codec_eeprom_write(unsigned address, std::uint8_t data, std::optional<Request>& to) {
  const auto request = Request::eeprom_write(address, data);
  if (request) to = *request;
  return request.has_value();
}
std::uint32_t part_codec_fields(const Frame& frame) {
  return frame.abs() ^ static_cast<std::uint32_t>(frame.turns(16)) ^ frame.enid() ^ frame.status().bits();
}
const CompiledProfile* part_codec_profile() { return &cost::kProfile; }
}
