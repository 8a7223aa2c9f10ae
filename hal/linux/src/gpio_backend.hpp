// What gpio_line.cpp needs from a GPIO library. CMake takes one of gpio_backend_v1.cpp, _v2.cpp and _none.cpp; the
// two interfaces of libgpiod share the names of their types, so no file includes <gpiod.h> but those.
#pragma once

#include <expected>
#include <memory>
#include <string>

#include "tm485/linux/gpio_line.hpp"

namespace tm485::linux_hal::gpio_backend {

struct Chip;
struct ChipCloser {
  void operator()(Chip* chip) const noexcept;
};
using ChipHandle = std::unique_ptr<Chip, ChipCloser>;
using LineHandle = std::unique_ptr<Line, LineCloser>;

struct LineInfo {
  std::string name;      ///< empty: none
  std::string consumer;  ///< of the program or driver that has it; empty: none, or it gave no name
  bool used = false;
};

/// "libgpiod 1.6.3"; empty: none.
[[nodiscard]] std::string library();

// Errors are errno; ENOSYS without a library.
[[nodiscard]] std::expected<ChipHandle, int> open_chip(const std::string& path);
[[nodiscard]] std::string label_of(Chip& chip);
[[nodiscard]] unsigned line_count(Chip& chip);
[[nodiscard]] std::expected<LineInfo, int> line_info(Chip& chip, unsigned offset);
/// As an output that is inactive. The chip is closed with the line, or now.
[[nodiscard]] std::expected<LineHandle, int> request_output(ChipHandle chip, unsigned offset, bool active_low,
                                                            const std::string& consumer);
/// 0 or errno; allocates nothing.
[[nodiscard]] int set(Line& line, bool active) noexcept;

}  // namespace tm485::linux_hal::gpio_backend
