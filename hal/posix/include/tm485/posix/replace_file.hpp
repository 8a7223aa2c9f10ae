// Files that must not be half there: replaced whole, and nothing beside them is touched.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <system_error>

namespace tm485::posix {

/// Where the links at the end of `path` lead, so that a file is replaced and not the link. The path itself if that cannot be
/// told. Any thread; system calls.
[[nodiscard]] std::string without_links(const std::string& path);

/// Makes `content` the whole content of the regular file `path`, or of a new one: whoever reads it, also after a crash at any
/// moment, finds all of the old content or all of the new, and after the return the new one. The permissions of an old
/// file are kept. What is written first is a new file of a name of its own beside it: what lies there is somebody's, a
/// link or a pipe perhaps, and is left alone. A link at `path` is replaced by the file.
///
/// Any thread; waits for the disk. Errors: errno of the step that failed, and nothing has changed; EEXIST: sixteen such
/// names are taken, by what killed processes have left.
[[nodiscard]] std::error_code replace_file(const std::string& path, std::span<const std::uint8_t> content);

}  // namespace tm485::posix
