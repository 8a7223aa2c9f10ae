// What `tm485 servo-demo` prints.
#pragma once

#include <span>
#include <string>

#include "servo_demo.hpp"

namespace tm485::cli {

/// What was asked for, in words: the first lines, and the head of the object.
struct ServoHead {
  std::string port;
  std::string reference;
  double bandwidth_hz;
  double velocity_loop_hz;
};

[[nodiscard]] std::string servo_text(const ServoHead& head, const ServoSettings& settings,
                                     std::span<const ServoRun> runs);
[[nodiscard]] std::string servo_json(const ServoHead& head, const ServoSettings& settings,
                                     std::span<const ServoRun> runs);

}  // namespace tm485::cli
