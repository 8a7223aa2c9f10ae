#include "screen.hpp"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>

namespace tm485::cli {
namespace {

std::size_t terminal_width() noexcept {
  winsize size{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &size) != 0 || size.ws_col == 0) return 80;
  return size.ws_col;
}

}  // namespace

std::string_view cut(std::string_view text, std::size_t columns) noexcept {
  std::size_t seen = 0;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const bool starts_character = (static_cast<unsigned char>(text[i]) & 0xC0U) != 0x80U;
    if (starts_character && seen++ == columns) return text.substr(0, i);
  }
  return text;
}

std::string gauge(double fraction, std::size_t columns) {
  const auto filled =
      static_cast<std::size_t>(std::lround(std::clamp(fraction, 0.0, 1.0) * static_cast<double>(columns)));
  return std::string(filled, '#') + std::string(columns - filled, '.');
}

bool Screen::show(const std::vector<std::string>& lines) {
  const std::size_t width = terminal_width();
  std::string text = height_ == 0 ? std::string() : fmt::format("\x1b[{}A", height_);
  for (const std::string& line : lines) text += fmt::format("\r\x1b[2K{}\n", cut(line, width));
  text += "\x1b[J";
  height_ = lines.size();
  return output_->write(text) && output_->flush();
}

}  // namespace tm485::cli
