#include "profile_file.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <fstream>
#include <iterator>
#include <system_error>

#include "profile_toml.hpp"

namespace tm485::cli {
namespace {

constexpr std::size_t kLargestFile = 262'144;

Problem file_problem(const std::string& path, std::string_view why) {
  return usage_problem("profile_file", fmt::format("{}: {}", path, why),
                       "name a readable TOML file, or one of the presets: tm485 profiles");
}

std::expected<std::string, Problem> read_file(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return std::unexpected(file_problem(path, std::generic_category().message(errno)));
  std::string text(kLargestFile + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (file.bad() || (file.fail() && !file.eof()))
    return std::unexpected(file_problem(path, "it cannot be read"));
  text.resize(static_cast<std::size_t>(file.gcount()));
  if (text.size() > kLargestFile) return std::unexpected(file_problem(path, "it is larger than 256 KiB"));
  return text;
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
