// The port of a command line, with everything that its options say of it.
#pragma once

#include <cstdint>
#include <expected>

#include "any_port.hpp"
#include "commands.hpp"
#include "problem.hpp"

namespace tm485::cli {

/// Opens it: direction, any chip, and the latency allowance where one is given. Problems: bad_latency (exit code 2, before
/// anything is opened), and those of AnyPort::open.
[[nodiscard]] std::expected<AnyPort, Problem> open_port(const PortOptions& options, std::uint32_t bit_rate,
                                                        bool virtual_time);

}  // namespace tm485::cli
