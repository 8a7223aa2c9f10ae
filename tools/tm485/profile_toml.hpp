// A profile written in TOML. The keys are the names of the members of Profile; `base` names the preset that the
// others change. Specification: section 7.
#pragma once

#include <expected>
#include <string>
#include <string_view>

#include "problem.hpp"
#include "tm485/protocol/profile.hpp"

namespace tm485::cli {

/// Problem: bad_profile, with `path`, the line and what is expected there.
[[nodiscard]] std::expected<CompiledProfile, Problem> profile_from_toml(std::string_view text,
                                                                        const std::string& path);

}  // namespace tm485::cli
