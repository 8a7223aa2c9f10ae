#include "frame_view.hpp"

#include <fmt/format.h>

#include <iterator>

#include "json_output.hpp"

namespace tm485::cli {
namespace {

void view_request(std::span<const std::uint8_t> bytes, FrameView& view) noexcept {
  const auto request = Request::parse(bytes);
  if (!request) {
    view.error = request.error();
    return;
  }
  if (bytes.size() == 1) return;
  view.adf = request->address();
  if (request->id() == DataId::eeprom_write) view.edf = request->data();
  view.crc = bytes.back();
}

void view_fields(const Frame& frame, const CompiledProfile& profile, FrameView& view) noexcept {
  const Layout& fields = frame.fields();
  const unsigned multi_turn_bits = profile.profile().multi_turn_bits;
  if (fields.sf_at != 0) view.sf = frame.sf();
  if (fields.abs_at != 0) view.abs = frame.abs();
  if (fields.abm_at != 0) {
    view.abm = frame.abm();
    if (multi_turn_bits != 0) view.turns = frame.turns(multi_turn_bits);
  }
  if (fields.enid_at != 0) view.enid = frame.enid();
  if (fields.almc_at != 0) view.almc = frame.almc();
  if (fields.adf_at != 0) {
    view.adf = frame.adf();
    view.busy = frame.eeprom_busy();
    view.edf = frame.edf();
  }
  view.crc = frame.crc();
}

void view_reply(std::span<const std::uint8_t> bytes, const CompiledProfile& profile,
                FrameView& view) noexcept {
  const auto frame = Frame::parse(bytes);
  if (!frame) {
    view.error = frame.error();
    return;
  }
  view_fields(*frame, profile, view);
  if (const auto reply = Reply::from(*frame, profile); !reply) view.error = reply.error();
}

StatusSet status_of(const FrameView& view) { return {view.sf.value_or(0), view.almc.value_or(0)}; }

std::string_view kind_name(FrameKind kind) { return kind == FrameKind::request ? "request" : "reply"; }

}  // namespace

FrameKind guess_kind(std::span<const std::uint8_t> bytes) noexcept {
  if (bytes.size() < 4) return FrameKind::request;
  const bool write = bytes.size() == 4 && bytes[0] == control_field(DataId::eeprom_write);
  return write && (bytes[1] & 0x80U) == 0 ? FrameKind::request : FrameKind::reply;
}

FrameView view_frame(std::span<const std::uint8_t> bytes, FrameKind kind,
                     const CompiledProfile& profile) noexcept {
  FrameView view;
  view.kind = kind;
  if (!bytes.empty()) {
    if (const auto id = parse_control_field(bytes[0])) view.id = *id;
  }
  if (kind == FrameKind::request)
    view_request(bytes, view);
  else
    view_reply(bytes, profile, view);
  return view;
}

std::string to_json(const FrameView& view) {
  JsonObject json;
  json.set("kind", kind_name(view.kind));
  if (view.id) json.set("id", number(*view.id));
  json.set("ok", view.error == Errc::ok);
  if (view.error != Errc::ok) json.set("error", name(view.error));
  const auto optional = [&json](std::string_view key, const auto& value) {
    if (value) json.set(key, *value);
  };
  optional("abs", view.abs);
  optional("abm", view.abm);
  optional("turns", view.turns);
  optional("enid", view.enid);
  optional("sf", view.sf);
  optional("almc", view.almc);
  optional("adf", view.adf);
  optional("edf", view.edf);
  optional("busy", view.busy);
  optional("crc", view.crc);
  if (view.sf) json.set("alarms", status_names(status_of(view)));
  return json.text();
}

std::string to_text(const FrameView& view, std::span<const std::uint8_t> bytes) {
  std::string text = fmt::format("{:<7} {:<4}", kind_name(view.kind),
                                 view.id ? fmt::format("ID{:X}", number(*view.id)) : std::string("ID?"));
  for (const std::uint8_t byte : bytes) fmt::format_to(std::back_inserter(text), " {:02X}", byte);
  if (view.error == Errc::ok)
    text += "  ok\n";
  else
    fmt::format_to(std::back_inserter(text), "  {}: {}\n", name(view.error), describe(view.error).cause);

  std::string fields;
  const auto field = [&fields](std::string_view label, const auto& value) {
    if (value) fmt::format_to(std::back_inserter(fields), "  {} {}", label, *value);
  };
  const auto byte_field = [&fields](std::string_view label, const std::optional<std::uint8_t>& value) {
    if (value) fmt::format_to(std::back_inserter(fields), "  {} {:02X}", label, *value);
  };
  field("ABS", view.abs);
  field("ABM", view.abm);
  field("turns", view.turns);
  byte_field("ENID", view.enid);
  byte_field("SF", view.sf);
  byte_field("ALMC", view.almc);
  byte_field("ADF", view.adf);
  byte_field("EDF", view.edf);
  if (view.busy) fields += *view.busy ? "  busy" : "  not busy";
  byte_field("CRC", view.crc);
  if (!fields.empty()) text += "            " + fields.substr(1) + '\n';
  if (view.error != Errc::ok)
    fmt::format_to(std::back_inserter(text), "             remedy: {}\n", describe(view.error).remedy);
  if (view.sf) {
    for (const StatusInfo& info : status_table()) {
      if (!status_of(view).has(info.bit)) continue;
      fmt::format_to(std::back_inserter(text), "             {} {}: {}; {}\n", info.field, info.name,
                     info.cause, info.remedy);
    }
  }
  return text;
}

std::vector<std::string_view> status_names(StatusSet status) {
  std::vector<std::string_view> result;
  for (const StatusInfo& info : status_table())
    if (status.has(info.bit)) result.push_back(info.name);
  return result;
}

std::string alarm_lines(StatusSet status, const AlarmPolicy& policy, std::string_view indent) {
  std::string text;
  for (const StatusInfo& info : status_table()) {
    if (!status.has(info.bit)) continue;
    const AlarmLevel level = policy.level(info.bit);
    const std::string_view verdict = level == AlarmLevel::fault     ? "fault"
                                     : level == AlarmLevel::warning ? "warning"
                                                                    : "ignored";
    fmt::format_to(std::back_inserter(text), "{}{} {} ({}): {}\n", indent, info.field, info.name, verdict,
                   info.cause);
    if (level != AlarmLevel::none)
      fmt::format_to(std::back_inserter(text), "{}  remedy: {}\n", indent, info.remedy);
  }
  return text;
}

}  // namespace tm485::cli
