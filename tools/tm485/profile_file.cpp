#include "profile_file.hpp"

#include <fmt/format.h>

#include <utility>

#include "profile_toml.hpp"
#include "safe_file.hpp"

namespace tm485::cli {
namespace {

constexpr std::size_t kLargestFile = 262'144;

std::expected<std::string, Problem> read_file(const std::string& path) {
  auto text = read_whole_file(path, kLargestFile);
  if (text) return text;
  return std::unexpected(usage_problem("profile_file", std::move(text.error().cause),
                                       "name a readable TOML file, or one of the presets: tm485 profiles"));
}

Problem unknown_profile(const std::string& name) {
  std::string names;
  for (const Profile& preset : profile_presets()) {
    if (!names.empty()) names += ", ";
    names += preset.name;
  }
  return usage_problem("unknown_profile", fmt::format("no profile is called '{}'", name),
                       fmt::format("use {}, or a file whose name ends with .toml", names));
}

}  // namespace

std::expected<CompiledProfile, Problem> load_profile(const std::string& name_or_file) {
  if (const auto preset = find_profile(name_or_file)) {
    if (const auto compiled = CompiledProfile::compile(*preset)) return *compiled;
    return std::unexpected(problem_of(Errc::bad_profile, name_or_file));
  }
  if (!name_or_file.ends_with(".toml") && name_or_file.find('/') == std::string::npos)
    return std::unexpected(unknown_profile(name_or_file));
  const auto text = read_file(name_or_file);
  if (!text) return std::unexpected(text.error());
  return profile_from_toml(*text, name_or_file);
}

}  // namespace tm485::cli
