// A sample as one line of JSON or as a row of a table.
#pragma once

#include <expected>
#include <string>
#include <string_view>

#include "problem.hpp"
#include "session.hpp"
#include "tm485/motion/sample.hpp"

namespace tm485::cli {

/// counts, rev or deg; any other text is counts.
[[nodiscard]] Units units_of(std::string_view text) noexcept;

/// "62.5us", "16kHz", or "min" for the shortest possible (0). Problem: bad_period.
[[nodiscard]] std::expected<Time, Problem> parse_period_option(const std::string& text);

/// The raw ABM of a turn count: its two's complement in the profile's width.
[[nodiscard]] std::uint32_t raw_turns(std::int32_t turns, const Profile& profile) noexcept;

/// One line with its end. Keys that the ID does not have are absent; `result` is that of the cycle.
[[nodiscard]] std::string sample_json(const Session& session, const Sample& sample, Errc result);

/// The same as a row of a table, and the table's head.
[[nodiscard]] std::string sample_row(const Session& session, const Sample& sample, Errc result);
[[nodiscard]] std::string sample_header(const Session& session);

}  // namespace tm485::cli
