#include "plain_text.hpp"

namespace tm485::cli {
namespace {

std::string plain(std::string_view text, std::size_t most, char kept) {
  std::string result;
  for (std::size_t i = 0; i < text.size() && i < most; ++i) {
    const auto byte = static_cast<unsigned char>(text[i]);
    const auto next = i + 1 < text.size() ? static_cast<unsigned char>(text[i + 1]) : 0U;
    const bool second_set = byte == 0xC2 && next >= 0x80 && next <= 0x9F;  // U+0080 to U+009F in UTF-8
    const bool control = (byte < 0x20 && text[i] != kept) || byte == 0x7F || second_set;
    result += control ? '?' : text[i];
    if (second_set) ++i;
  }
  if (text.size() > most) result += "...";
  return result;
}

}  // namespace

std::string plain_text(std::string_view text, std::size_t most) { return plain(text, most, '\0'); }

std::string plain_lines(std::string_view text, std::size_t most) { return plain(text, most, '\n'); }

}  // namespace tm485::cli
