// Quantities as people write them: "62.5us", "40 µs", "1ms", "2.5s", "16kHz", "3000rpm".
#pragma once

#include <expected>
#include <optional>
#include <string>
#include <string_view>

#include "tm485/time.hpp"

namespace tm485::cli {

/// What a number without a unit means.
enum class PlainNumber { refused, seconds, nanoseconds };

/// A time of 0 to 10^6 s in ns, us (µs), ms, s, min, or h. The error says what is wrong with the text, as one clause.
[[nodiscard]] std::expected<Time, std::string> parse_time(std::string_view text, PlainNumber plain);

/// The same, and in addition a rate as its period: "16kHz" is 62.5 µs.
[[nodiscard]] std::expected<Time, std::string> parse_period(std::string_view text);

/// A speed in rpm: plain or "rpm", "rev/s" (rps), "deg/s". Within ±10^6.
[[nodiscard]] std::expected<double, std::string> parse_rpm(std::string_view text);

/// An acceleration in rpm/s: plain or "rpm/s", "rev/s2", "rad/s2". Within ±10^8.
[[nodiscard]] std::expected<double, std::string> parse_acceleration(std::string_view text);

/// An angle in revolutions: "90deg" (°), "0.25rev", "1.5rad". The unit is needed. Within ±10^6 revolutions.
[[nodiscard]] std::expected<double, std::string> parse_angle(std::string_view text);

/// A frequency in Hz: plain or "Hz", "kHz", "MHz". Above 0, up to 10^9.
[[nodiscard]] std::expected<double, std::string> parse_frequency(std::string_view text);

/// A torque in Nm: plain or "Nm", "mNm". Within ±10^6.
[[nodiscard]] std::expected<double, std::string> parse_torque(std::string_view text);

/// A ratio in millionths: plain or "ppm", or "%". Within ±10^6.
[[nodiscard]] std::expected<double, std::string> parse_ppm(std::string_view text);

/// "62.5us", "1ms", "2.5s": the shortest exact way to write it, readable by parse_time.
[[nodiscard]] std::string format_time(Time time);

}  // namespace tm485::cli
