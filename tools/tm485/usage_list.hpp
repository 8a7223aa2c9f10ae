// What can be typed behind `tm485 list`.
#pragma once

#include <CLI/CLI.hpp>

#include "commands.hpp"

namespace tm485::cli {

/// Adds the sub-command to `root`; what is typed goes to `options`.
void add_list(CLI::App& root, ListOptions& options);

}  // namespace tm485::cli
