// Questions to the person at the terminal before something is changed for good.
#pragma once

#include <expected>
#include <string>
#include <string_view>

#include "problem.hpp"

namespace tm485::cli {

/// Can a question be answered at all? Problem: not_confirmed (exit code 2) if `answered` (--yes) is false and standard
/// input or standard error is no terminal. Asked before anything is touched.
[[nodiscard]] std::expected<void, Problem> can_confirm(bool answered, std::string_view option);

/// Asks on standard error, unless `answered`. Anything but `word` (case is ignored) is a no, and so is Ctrl-C. Problem:
/// declined (exit code 2).
[[nodiscard]] std::expected<void, Problem> confirm(bool answered, const std::string& question,
                                                   std::string_view word);

/// Asks whether a file that exists may be replaced, before anything else is done. Problem: file_exists (exit code 2), if
/// nobody can be asked; declined.
[[nodiscard]] std::expected<void, Problem> may_replace(bool answered, const std::string& file);

}  // namespace tm485::cli
