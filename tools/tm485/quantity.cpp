#include "quantity.hpp"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>

namespace tm485::cli {
namespace {

struct Unit {
  std::string_view name;
  double factor;
};

constexpr double kSecond = 1e9;
constexpr double kLongest = 1e6 * kSecond;

// Both µ of Unicode: the micro sign and the Greek letter.
constexpr std::array kTimeUnits{
    Unit{"ns", 1.0},      Unit{"us", 1e3},           Unit{"\u00B5s", 1e3},
    Unit{"\u03BCs", 1e3}, Unit{"ms", 1e6},           Unit{"s", kSecond},
    Unit{"sec", kSecond}, Unit{"min", 60 * kSecond}, Unit{"h", 3600 * kSecond},
};
constexpr std::array kRateUnits{Unit{"Hz", 1.0}, Unit{"kHz", 1e3}, Unit{"MHz", 1e6}};
constexpr std::array kSpeedUnits{
    Unit{"", 1.0},
    Unit{"rpm", 1.0},
    Unit{"1/min", 1.0},
    Unit{"rps", 60.0},
    Unit{"rev/s", 60.0},
    Unit{"1/s", 60.0},
    Unit{"deg/s", 60.0 / 360},
    Unit{"rad/s", 60.0 / 6.283185307179586},
};
constexpr std::array kAccelerationUnits{
    Unit{"", 1.0},
    Unit{"rpm/s", 1.0},
    Unit{"rev/s2", 60.0},
    Unit{"rev/s^2", 60.0},
    Unit{"rad/s2", 60.0 / 6.283185307179586},
    Unit{"rad/s^2", 60.0 / 6.283185307179586},
};
constexpr std::array kAngleUnits{
    Unit{"rev", 1.0},         Unit{"turn", 1.0},         Unit{"turns", 1.0},
    Unit{"deg", 1.0 / 360.0}, Unit{"\u00B0", 1.0 / 360}, Unit{"rad", 1.0 / 6.283185307179586},
};
constexpr std::array kTorqueUnits{Unit{"", 1.0}, Unit{"Nm", 1.0}, Unit{"N m", 1.0}, Unit{"mNm", 1e-3}};
constexpr std::array kRatioUnits{Unit{"", 1.0}, Unit{"ppm", 1.0}, Unit{"%", 1e4}};

struct NumberAndUnit {
  double number;
  std::string_view unit;
};

std::string_view trim(std::string_view text) {
  constexpr std::string_view kBlank = " \t";
  const auto first = text.find_first_not_of(kBlank);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlank) - first + 1);
}

std::expected<NumberAndUnit, std::string> split(std::string_view text) {
  text = trim(text);
  if (text.empty()) return std::unexpected("it is empty");
  if (text.front() == '+') text.remove_prefix(1);
  NumberAndUnit result{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), result.number);
  if (error != std::errc{} || !std::isfinite(result.number))
    return std::unexpected(fmt::format("'{}' has no number in front", text));
  result.unit = trim(text.substr(static_cast<std::size_t>(end - text.data())));
  return result;
}

template <std::size_t N>
const Unit* find(const std::array<Unit, N>& units, std::string_view name) {
  for (const Unit& unit : units)
    if (unit.name == name) return &unit;
  return nullptr;
}

/// A number within ±`largest` of the base unit, which is the one of factor 1.
template <std::size_t N>
std::expected<double, std::string> parse_with(std::string_view text, const std::array<Unit, N>& units,
                                              std::string_view hint, std::string_view limit,
                                              double largest = 1e6) {
  const auto parts = split(text);
  if (!parts) return std::unexpected(parts.error());
  const Unit* unit = find(units, parts->unit);
  if (unit == nullptr) return std::unexpected(fmt::format("'{}' is no unit of {}", parts->unit, hint));
  const double value = parts->number * unit->factor;
  if (std::abs(value) > largest) return std::unexpected(fmt::format("it is above {}", limit));
  return value;
}

std::expected<Time, std::string> to_time(double ns) {
  if (ns < 0.0) return std::unexpected("it is negative");
  if (ns > kLongest) return std::unexpected("it is longer than 1000000 s");
  return Time{std::llround(ns)};
}

}  // namespace

std::expected<Time, std::string> parse_time(std::string_view text, PlainNumber plain) {
  const auto parts = split(text);
  if (!parts) return std::unexpected(parts.error());
  if (parts->unit.empty() && plain == PlainNumber::seconds) return to_time(parts->number * kSecond);
  if (parts->unit.empty() && plain == PlainNumber::nanoseconds) return to_time(parts->number);
  if (parts->unit.empty() && parts->number == 0.0) return Time{0};
  if (parts->unit.empty()) return std::unexpected("the unit is missing: ns, us, ms or s");
  if (const Unit* unit = find(kTimeUnits, parts->unit)) return to_time(parts->number * unit->factor);
  return std::unexpected(fmt::format("'{}' is no unit of time: use ns, us, ms, s, min or h", parts->unit));
}

std::expected<Time, std::string> parse_period(std::string_view text) {
  const auto parts = split(text);
  if (!parts) return std::unexpected(parts.error());
  const Unit* unit = find(kRateUnits, parts->unit);
  if (unit == nullptr) return parse_time(text, PlainNumber::refused);
  if (parts->number <= 0.0) return std::unexpected("a rate must be above 0");
  return to_time(kSecond / (parts->number * unit->factor));
}

std::expected<double, std::string> parse_rpm(std::string_view text) {
  return parse_with(text, kSpeedUnits, "speed: use rpm, rev/s or deg/s", "1000000 rpm");
}

std::expected<double, std::string> parse_acceleration(std::string_view text) {
  return parse_with(text, kAccelerationUnits, "acceleration: use rpm/s, rev/s2 or rad/s2", "100000000 rpm/s",
                    1e8);
}

std::expected<double, std::string> parse_angle(std::string_view text) {
  const auto parts = split(text);
  if (parts && parts->unit.empty()) return std::unexpected("the unit is missing: deg, rev or rad");
  return parse_with(text, kAngleUnits, "angle: use deg, rev or rad", "1000000 revolutions");
}

std::expected<double, std::string> parse_torque(std::string_view text) {
  return parse_with(text, kTorqueUnits, "torque: use Nm or mNm", "1000000 Nm");
}

std::expected<double, std::string> parse_ppm(std::string_view text) {
  return parse_with(text, kRatioUnits, "ratio: use ppm or %", "1000000 ppm");
}

std::expected<double, std::string> parse_frequency(std::string_view text) {
  const auto parts = split(text);
  if (!parts) return std::unexpected(parts.error());
  const Unit* unit = find(kRateUnits, parts->unit.empty() ? "Hz" : parts->unit);
  if (unit == nullptr)
    return std::unexpected(fmt::format("'{}' is no unit of frequency: use Hz or kHz", parts->unit));
  const double hertz = parts->number * unit->factor;
  if (!(hertz > 0.0) || hertz > 1e9) return std::unexpected("it is not above 0, or above 1 GHz");
  return hertz;
}

std::string format_time(Time time) {
  const std::int64_t ns = time.count();
  const std::int64_t size = ns < 0 ? -ns : ns;
  if (size >= 1'000'000'000) return fmt::format("{}s", static_cast<double>(ns) / 1e9);
  if (size >= 1'000'000) return fmt::format("{}ms", static_cast<double>(ns) / 1e6);
  if (size >= 1'000) return fmt::format("{}us", static_cast<double>(ns) / 1e3);
  return fmt::format("{}ns", ns);
}

}  // namespace tm485::cli
