// Profiles by name or from a TOML file. Specification: section 7; docs/protocol.md lists the keys.
#pragma once

#include <expected>
#include <string>

#include "problem.hpp"
#include "tm485/protocol/profile.hpp"

namespace tm485::cli {

/// The profile of a preset's name, or of a TOML file (a text that ends with .toml or contains a slash). Problems:
/// unknown_profile, profile_file (cannot be read), bad_profile with file, line and what is expected; all exit code 2.
/// The profile's name stays valid until the end of the process.
[[nodiscard]] std::expected<CompiledProfile, Problem> load_profile(const std::string& name_or_file);

}  // namespace tm485::cli
