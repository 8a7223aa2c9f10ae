// The pieces of the option text: numbers, times, lists, and the message for a value that is none of them.
#pragma once

#include <charconv>
#include <cmath>
#include <expected>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tm485/time.hpp"

namespace tm485::sim {

inline std::unexpected<std::string> bad(std::string_view key, std::string_view value,
                                        std::string_view expected) {
  return std::unexpected{std::string{key} + "=" + std::string{value} + ": expected " + std::string{expected}};
}

inline std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t at = text.find(separator);
    parts.push_back(text.substr(0, at));
    if (at == std::string_view::npos) return parts;
    text.remove_prefix(at + 1);
  }
}

/// A finite number in low..high, nothing after it.
inline std::optional<double> number(std::string_view text, double low, double high) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if (!std::isfinite(value) || value < low || value > high) return std::nullopt;
  return value;
}

template <class Integer>
std::optional<Integer> integer(std::string_view text, int base = 10) {
  if (base == 16 && (text.starts_with("0x") || text.starts_with("0X"))) text.remove_prefix(2);
  Integer value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// A time of 0..limit with its unit: ns, us (or the micro sign), ms, s.
inline std::optional<Time> time_span(std::string_view text, Time limit) {
  struct Unit {
    std::string_view suffix;
    double ns;
  };
  constexpr std::array<Unit, 6> kUnits{
      {{"ns", 1.0}, {"us", 1e3}, {"\u00B5s", 1e3}, {"\u03BCs", 1e3}, {"ms", 1e6}, {"s", 1e9}}};
  for (const Unit& unit : kUnits) {
    if (!text.ends_with(unit.suffix)) continue;
    text.remove_suffix(unit.suffix.size());
    const auto value = number(text, 0.0, static_cast<double>(limit.count()) / unit.ns);
    if (!value) return std::nullopt;
    return Time{std::llround(*value * unit.ns)};
  }
  return std::nullopt;
}

struct TimeRange {
  Time low{0};
  Time high{0};
};

/// A time T of 0..limit, or two as T..T, the first not the longer one.
inline std::optional<TimeRange> time_range(std::string_view text, Time limit) {
  const std::size_t dots = text.find("..");
  const auto low = time_span(text.substr(0, dots), limit);
  const auto high = dots == std::string_view::npos ? low : time_span(text.substr(dots + 2), limit);
  if (!low || !high || *low > *high) return std::nullopt;
  return TimeRange{*low, *high};
}

/// on or off; nothing means on.
inline std::optional<bool> on_off(std::string_view text) {
  if (text.empty() || text == "on") return true;
  if (text == "off") return false;
  return std::nullopt;
}

}  // namespace tm485::sim
