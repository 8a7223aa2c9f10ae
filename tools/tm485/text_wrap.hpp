// Text in lines that a terminal can show.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace tm485::cli {

/// `text` in lines of at most 100 columns, broken at blanks, each after the first indented. A longer word stays whole.
[[nodiscard]] std::string wrapped(std::string_view text, std::size_t indent);

}  // namespace tm485::cli
