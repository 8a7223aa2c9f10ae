#include "plain_text.hpp"

#include <algorithm>

namespace tm485::cli {
namespace {

/// How many bytes of `text` make a character that can be shown, in UTF-8; 0: its first one cannot.
std::size_t character(std::string_view text) {
  const auto lead = static_cast<unsigned char>(text[0]);
  if (lead < 0x80) return lead >= 0x20 && lead != 0x7F ? 1 : 0;
  const std::size_t length = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4 || text.size() < length) return 0;
  const auto continues = [](char byte) { return (static_cast<unsigned char>(byte) & 0xC0U) == 0x80; };
  if (!std::ranges::all_of(text.substr(1, length - 1), continues)) return 0;
  const bool control = lead == 0xC2 && static_cast<unsigned char>(text[1]) < 0xA0;  // U+0080 to U+009F
  return control ? 0 : length;
}

std::string plain(std::string_view text, std::size_t most, bool lines) {
  std::string result;
  const std::string_view shown = text.substr(0, most);
  for (std::size_t at = 0; at < shown.size();) {
    const std::size_t length = lines && shown[at] == '\n' ? 1 : character(shown.substr(at));
    result += length == 0 ? std::string_view("?") : shown.substr(at, length);
    at += std::max<std::size_t>(length, 1);
  }
  if (text.size() > most) result += "...";
  return result;
}

}  // namespace

std::string plain_text(std::string_view text, std::size_t most) { return plain(text, most, false); }

std::string plain_lines(std::string_view text, std::size_t most) { return plain(text, most, true); }

}  // namespace tm485::cli
