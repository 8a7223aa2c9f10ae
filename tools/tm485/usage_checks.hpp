// What several sub-commands ask of what is typed, for CLI11's check(): empty if it is good, or what is wrong.
#pragma once

#include <string>

namespace tm485::cli {

/// An unset variable of a shell script is an empty word; it must not mean "none" or 0.
[[nodiscard]] inline std::string not_empty(const std::string& text) {
  return text.empty() ? "it is empty" : "";
}

/// Fits 64 bits.
[[nodiscard]] inline std::string seed_number(const std::string& text) {
  constexpr std::size_t kMostDigits = 19;
  const bool number = !text.empty() && text.find_first_not_of("0123456789") == std::string::npos &&
                      text.size() <= kMostDigits;
  return number ? "" : "a seed is a whole number of at most 19 digits";
}

}  // namespace tm485::cli
