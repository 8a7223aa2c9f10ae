// The version of the stack, by Semantic Versioning. The build files read the three numbers from
// here, so this is the only place that states them.
#pragma once

#include <string_view>

#define TM485_VERSION_MAJOR 0
#define TM485_VERSION_MINOR 1
#define TM485_VERSION_PATCH 0

#define TM485_VERSION_QUOTED(x) #x
#define TM485_VERSION_TEXT(x) TM485_VERSION_QUOTED(x)

/// "MAJOR.MINOR.PATCH" of the headers that a program was compiled with.
#define TM485_VERSION_STRING              \
  TM485_VERSION_TEXT(TM485_VERSION_MAJOR) \
  "." TM485_VERSION_TEXT(TM485_VERSION_MINOR) "." TM485_VERSION_TEXT(TM485_VERSION_PATCH)

namespace tm485 {

struct Version {
  int major_number;
  int minor_number;
  int patch_number;
  std::string_view text;  ///< "MAJOR.MINOR.PATCH", in static storage

  friend constexpr bool operator==(const Version&, const Version&) = default;
};

/// The version of the library that a program runs with; it differs from the macros where the
/// headers and the library are of two installations. Any thread or interrupt; constant time.
[[nodiscard]] Version version() noexcept;

}  // namespace tm485
