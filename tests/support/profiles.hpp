// Short ways to a compiled profile.
#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

#include "tm485/protocol/profile.hpp"

namespace tm485::test {

inline Profile preset(std::string_view name) {
  const auto profile = find_profile(name);
  if (!profile) throw std::runtime_error("no preset " + std::string(name));
  return *profile;
}

inline CompiledProfile compiled(const Profile& profile) {
  const auto result = CompiledProfile::compile(profile);
  if (!result) throw std::runtime_error("profile refused: " + std::string(result.error().field));
  return *result;
}
inline CompiledProfile compiled(std::string_view name) { return compiled(preset(name)); }

}  // namespace tm485::test
