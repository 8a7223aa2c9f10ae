// Text from outside (a file, an argument) on a terminal.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace tm485::cli {

/// What of it can be shown: control characters, which could move the cursor, clear the screen or write a line of their own,
/// become '?', so does a line's end; of more than `most` bytes the beginning and "...".
[[nodiscard]] std::string plain_text(std::string_view text, std::size_t most = 256);

/// The same of a text of several lines.
[[nodiscard]] std::string plain_lines(std::string_view text, std::size_t most = 16'384);

}  // namespace tm485::cli
