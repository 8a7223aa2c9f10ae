// FrameView: what can be said about some bytes as a frame, for people and for JSON. Specification: sections 2, 3, 5.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "tm485/errc.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/profile.hpp"

namespace tm485::cli {

enum class FrameKind : std::uint8_t { request, reply };

/// A member without a value: the frame has no such field, or it is not known.
struct FrameView {
  FrameKind kind = FrameKind::reply;
  std::optional<DataId> id;
  Errc error = Errc::ok;
  std::optional<std::uint32_t> abs, abm;
  std::optional<std::int32_t> turns;
  std::optional<std::uint8_t> enid, sf, almc, adf, edf, crc;
  std::optional<bool> busy;
};

/// Request or reply by length: 1 byte, 3 bytes and a 4-byte ID6 without ADF.7 are requests.
[[nodiscard]] FrameKind guess_kind(std::span<const std::uint8_t> bytes) noexcept;

/// Judges the bytes. Fields are there only if length, CF and CRC hold; a refusal by the profile leaves them.
[[nodiscard]] FrameView view_frame(std::span<const std::uint8_t> bytes, FrameKind kind,
                                   const CompiledProfile& profile) noexcept;

/// One line of JSON, without a line end.
[[nodiscard]] std::string to_json(const FrameView& view);
/// The same as a few lines of text.
[[nodiscard]] std::string to_text(const FrameView& view, std::span<const std::uint8_t> bytes);

/// The names of the status bits that are set.
[[nodiscard]] std::vector<std::string_view> status_names(StatusSet status);

/// The status bits that are set, one line each with cause and remedy, `indent` before each.
[[nodiscard]] std::string alarm_lines(StatusSet status, const AlarmPolicy& policy, std::string_view indent);

}  // namespace tm485::cli
