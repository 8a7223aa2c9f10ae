#include "hex_input.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "tm485/protocol/layout.hpp"

namespace tm485::cli {
namespace {

/// 0..15, or -1.
int digit(char c) noexcept {
  if (c >= '0' && c <= '9') return c - '0';
  if (c >= 'a' && c <= 'f') return c - 'a' + 10;
  if (c >= 'A' && c <= 'F') return c - 'A' + 10;
  return -1;
}

constexpr std::string_view kSeparators = " \t\r\n,:;";

/// What can be shown of a text that may be anything.
std::string shown(std::string_view text) {
  constexpr std::size_t kLongest = 24;
  std::string result;
  for (const char c : text.substr(0, kLongest)) result += c >= ' ' && c <= '~' ? c : '?';
  if (text.size() > kLongest) result += "...";
  return result;
}

std::expected<void, std::string> add_token(FrameBytes& frame, std::string_view token) {
  std::string_view digits = token;
  if (digits.starts_with("0x") || digits.starts_with("0X")) digits.remove_prefix(2);
  if (digits.empty() || !std::ranges::all_of(digits, [](char c) { return digit(c) >= 0; }))
    return std::unexpected(fmt::format("'{}' is not hexadecimal", shown(token)));
  if (digits.size() % 2 != 0)
    return std::unexpected(fmt::format("'{}' has an odd number of hexadecimal digits", shown(token)));
  for (std::size_t i = 0; i < digits.size(); i += 2)
    frame.add(static_cast<std::uint8_t>(digit(digits[i]) * 16 + digit(digits[i + 1])));
  return {};
}

}  // namespace

std::expected<FrameBytes, std::string> parse_hex(std::string_view text) {
  FrameBytes frame;
  text = text.substr(0, text.find('#'));
  while (true) {
    const auto start = text.find_first_not_of(kSeparators);
    if (start == std::string_view::npos) return frame;
    text.remove_prefix(start);
    const auto length = std::min(text.find_first_of(kSeparators), text.size());
    if (auto added = add_token(frame, text.substr(0, length)); !added)
      return std::unexpected(std::move(added.error()));
    text.remove_prefix(length);
  }
}

std::vector<FrameBytes> group_frames(const std::vector<FrameBytes>& arguments) {
  const auto single = [](const FrameBytes& frame) { return frame.size() == 1; };
  const auto is_cf = [](const FrameBytes& frame) {
    return parse_control_field(frame.bytes()[0]).has_value();
  };
  if (arguments.size() < 2 || !std::ranges::all_of(arguments, single)) return arguments;
  const auto id = parse_control_field(arguments.front().bytes()[0]);
  if (!id || std::ranges::all_of(arguments, is_cf)) return arguments;
  const Layout& row = layout(*id);
  if (arguments.size() != row.reply_length && arguments.size() != row.request_length) return arguments;
  FrameBytes joined;
  for (const FrameBytes& argument : arguments) joined.add(argument.bytes()[0]);
  return {joined};
}

}  // namespace tm485::cli
