// What a bus has counted, as text and as JSON.
#pragma once

#include <string>
#include <vector>

#include "json_output.hpp"
#include "tm485/bus/port.hpp"
#include "tm485/bus/statistics.hpp"

namespace tm485::cli {

/// "crc_error 3, timeout 1", the most frequent first; "none".
[[nodiscard]] std::string error_counts(const Statistics& statistics);
/// {"crc_error": 3, "timeout": 1}: those that happened.
[[nodiscard]] JsonObject error_counts_json(const Statistics& statistics);

/// "2.9 / 3.0 / 3.1 us": minimum, mean, maximum; "-" if there are none.
[[nodiscard]] std::string min_mean_max(const TimeStatistic& statistic);
/// {"min_ns", "mean_ns", "max_ns", "samples"}
[[nodiscard]] JsonObject to_json(const TimeStatistic& statistic);
/// Sixteen bars, scaled to the highest one.
[[nodiscard]] std::string bars(const Histogram& histogram);

/// One line for people; an object for programs.
[[nodiscard]] std::string capability_text(const PortCapability& capability);
[[nodiscard]] JsonObject to_json(const PortCapability& capability);

/// "T2" where the port has wire timestamps, otherwise "reply delay"; for JSON "t2" and "reply_delay".
[[nodiscard]] std::string_view reply_delay_name(const PortCapability& capability);
[[nodiscard]] std::string_view reply_delay_key(const PortCapability& capability);

}  // namespace tm485::cli
