// What can be typed after `tm485 campaign`.
#pragma once

#include <CLI/CLI.hpp>

#include "commands.hpp"

namespace tm485::cli {

void add_campaign(CLI::App& root, CampaignCommandOptions& options);

}  // namespace tm485::cli
