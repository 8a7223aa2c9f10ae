// Files that must not be half there: read whole, replaced whole.
#pragma once

#include <cstddef>
#include <expected>
#include <string>
#include <string_view>

#include "problem.hpp"

namespace tm485::cli {

/// The content of a regular file of at most `most` bytes. Problem: file_failed (exit code 2).
[[nodiscard]] std::expected<std::string, Problem> read_whole_file(const std::string& path, std::size_t most);

/// Makes `content` the whole content of a file: whoever reads it, also after a crash at any moment, finds all of the old
/// content or all of the new, and after the return the new one. Waits for the disk. Problem: file_failed (exit code 1),
/// and nothing has changed.
[[nodiscard]] std::expected<void, Problem> replace_file(const std::string& path, std::string_view content);

/// The same for a file that must not exist yet; a crash can leave it empty. Problem: also file_exists (exit code 2).
[[nodiscard]] std::expected<void, Problem> create_file(const std::string& path, std::string_view content);

}  // namespace tm485::cli
