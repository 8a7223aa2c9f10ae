// What can be typed after `tm485 rt-check` and `tm485 servo-demo`.
#pragma once

#include <CLI/CLI.hpp>

#include "commands.hpp"

namespace tm485::cli {

void add_rt_check(CLI::App& root, RtCheckOptions& options);
void add_servo_demo(CLI::App& root, ServoDemoOptions& options);

}  // namespace tm485::cli
