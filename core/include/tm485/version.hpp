// The version of the library that a program runs with. version.h states the numbers.
#pragma once

#include <string_view>

#include "tm485/version.h"  // IWYU pragma: export

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
