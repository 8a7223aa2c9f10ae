// What can be typed after `tm485 eeprom` and `tm485 reset`.
#pragma once

#include <CLI/CLI.hpp>

#include "commands.hpp"

namespace tm485::cli {

/// Adds PORT and the options that every command with a port has.
using AddPortOptions = void (*)(CLI::App& app, PortOptions& options);

void add_eeprom(CLI::App& root, EepromOptions& options, AddPortOptions add_port_options);
void add_reset(CLI::App& root, ResetOptions& options, AddPortOptions add_port_options);

/// Carries out the one that was chosen below `eeprom`.
int run_eeprom(const CLI::App& root, const EepromOptions& options);

}  // namespace tm485::cli
