// Small files of sysfs, and the links between them.
#pragma once

#include <charconv>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string>
#include <system_error>

namespace tm485::linux_hal {

/// The first line of a file without blanks at its end.
[[nodiscard]] inline std::optional<std::string> read_line(const std::filesystem::path& path) {
  std::ifstream file(path);
  std::string line;
  if (!file || !std::getline(file, line)) return std::nullopt;
  while (!line.empty() && (line.back() == ' ' || line.back() == '\r')) line.pop_back();
  return line;
}

[[nodiscard]] inline std::optional<std::uint32_t> read_number(const std::filesystem::path& path,
                                                              int base = 10) {
  const auto line = read_line(path);
  if (!line) return std::nullopt;
  std::uint32_t value = 0;
  const auto [end, error] = std::from_chars(line->data(), line->data() + line->size(), value, base);
  if (error != std::errc{} || end != line->data() + line->size()) return std::nullopt;
  return value;
}

/// The file behind all links; empty if there is none.
[[nodiscard]] inline std::filesystem::path behind_links(const std::filesystem::path& path) {
  std::error_code error;
  std::filesystem::path real = std::filesystem::canonical(path, error);
  return error ? std::filesystem::path{} : real;
}

/// The last part of what a link leads to; empty if there is none.
[[nodiscard]] inline std::string link_name(const std::filesystem::path& link) {
  return behind_links(link).filename().string();
}

}  // namespace tm485::linux_hal
