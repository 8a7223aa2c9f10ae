// Runs the real tm485 command at a terminal of its own, with a person who types.
#pragma once

#include <string>
#include <vector>

#include "cli/process.hpp"

namespace tm485::test {

/// Runs to the end. Once `prompt` has been shown, types `answer` and Enter. `out` has what the terminal shows: standard
/// output and standard error.
[[nodiscard]] Finished run_at_terminal(const Process::Arguments& arguments, const std::string& prompt,
                                       const std::string& answer);

}  // namespace tm485::test
