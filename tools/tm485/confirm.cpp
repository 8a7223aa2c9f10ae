#include "confirm.hpp"

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdio>

#include "line_reader.hpp"

namespace tm485::cli {
namespace {

std::string lower(std::string_view text) {
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.back())) != 0) text.remove_suffix(1);
  while (!text.empty() && std::isspace(static_cast<unsigned char>(text.front())) != 0) text.remove_prefix(1);
  std::string result(text);
  std::transform(result.begin(), result.end(), result.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return result;
}

}  // namespace

std::expected<void, Problem> can_confirm(bool answered, std::string_view option) {
  if (answered || (::isatty(STDIN_FILENO) == 1 && ::isatty(STDERR_FILENO) == 1)) return {};
  return std::unexpected(usage_problem("not_confirmed",
                                       "this changes the encoder, and there is no terminal to ask at",
                                       fmt::format("add {} if that is what you want", option)));
}

std::expected<void, Problem> confirm(bool answered, const std::string& question, std::string_view word) {
  if (answered) return {};
  fmt::print(stderr, "{} (type {}) ", question, word);
  std::fflush(stderr);
  LineReader reader;
  std::string_view line;
  if (reader.next(line) == LineReader::Result::line && lower(line) == word) return {};
  return std::unexpected(usage_problem("declined", fmt::format("the answer was not '{}'", word),
                                       "nothing was changed; run the command again to be asked again"));
}

std::expected<void, Problem> may_replace(bool answered, const std::string& file) {
  struct stat status{};
  if (::stat(file.c_str(), &status) != 0 || !S_ISREG(status.st_mode)) return {};
  if (!can_confirm(answered, "--yes"))
    return std::unexpected(usage_problem("file_exists", fmt::format("'{}' exists already", file),
                                         "choose another name, or add --yes to replace it"));
  return confirm(answered, fmt::format("Replace '{}'?", file), "yes");
}

}  // namespace tm485::cli
