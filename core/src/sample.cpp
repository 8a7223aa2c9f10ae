#include "tm485/motion/sample.hpp"

#include <array>

namespace tm485 {

std::string_view name(Quality quality) noexcept {
  constexpr std::array<std::string_view, 4> kNames{"invalid", "held", "extrapolated", "fresh"};
  return kNames[static_cast<std::size_t>(quality) % kNames.size()];
}

}  // namespace tm485
