// Files that must not be half there: read whole, replaced whole.
#pragma once

#include <cstddef>
#include <expected>
#include <string>
#include <string_view>

#include "problem.hpp"

namespace tm485::cli {

/// What a symbolic link at the end of a path means. A name that nobody has typed (the journal beside an image) may have
/// been made a link by somebody else, to a file of the user's.
enum class Links { follow, refuse };

/// The content of a regular file of at most `most` bytes; of a larger one nothing is kept. Does not wait for the other end
/// of a pipe. Problem: file_failed (exit code 2).
[[nodiscard]] std::expected<std::string, Problem> read_whole_file(const std::string& path, std::size_t most,
                                                                  Links links = Links::follow);

/// Makes `content` the whole content of a file: whoever reads it, also after a crash at any moment, finds all of the old
/// content or all of the new, and after the return the new one. Waits for the disk. The permissions of an old file are
/// kept. Problem: file_failed (exit code 1), and nothing has changed.
[[nodiscard]] std::expected<void, Problem> replace_file(const std::string& path, std::string_view content,
                                                        Links links = Links::follow);

/// The same for a file that must not exist yet, nor a link of that name, wherever it leads; a crash can leave it empty. Problem: also file_exists (exit code 2).
[[nodiscard]] std::expected<void, Problem> create_file(const std::string& path, std::string_view content);

}  // namespace tm485::cli
