// The text form of a memory-mapped UART: `mmio:pl011@0x9000000,clock=48MHz`.
#pragma once

#include <expected>
#include <string>
#include <string_view>

#include "tm485/linux/mmio_uart.hpp"

namespace tm485::cli {

/// What a person may write, in one line each for help and errors.
[[nodiscard]] std::string_view mmio_usage() noexcept;

/// Parses what follows `mmio:`. The error says what is wrong, as one clause.
[[nodiscard]] std::expected<linux_hal::MmioOptions, std::string> parse_mmio(std::string_view text);

}  // namespace tm485::cli
