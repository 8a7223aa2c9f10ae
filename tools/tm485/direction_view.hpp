// What commands say about who switches a port's RS-485 driver, and how late it was released.
#pragma once

#include <string>

#include "any_port.hpp"
#include "json_output.hpp"

namespace tm485::cli {

/// {"control": text} and, where this program switches the driver, "release" (as times are written, with "limit_ns" and
/// "late"); "warning" if there is one.
[[nodiscard]] JsonObject direction_json(const AnyPort& port);

/// "direction GPIO line 3 ...": one line; empty if nothing is switched here.
[[nodiscard]] std::string direction_line(const AnyPort& port);
/// A row of the table of times; empty if this program does not switch the driver.
[[nodiscard]] std::string release_row(const AnyPort& port);
/// "warning  best effort: ..." with how many were late; empty if there is nothing to say.
[[nodiscard]] std::string direction_warning_lines(const AnyPort& port);

/// What a port's direction cannot hold, on standard error: for commands that show none of the above. A port without such a
/// warning prints nothing.
void warn_of_direction(const AnyPort& port);

}  // namespace tm485::cli
