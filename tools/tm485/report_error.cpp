#include <fmt/format.h>

#include <cstdio>

#include "plain_text.hpp"
#include "problem.hpp"

namespace tm485::cli {

Problem problem_of(Errc code, std::string_view where) {
  const ErrorInfo& info = describe(code);
  std::string cause(where);
  if (!cause.empty()) cause += ": ";
  cause += info.cause;
  const int exit_code = info.error_class == ErrorClass::usage ? kExitUsage : kExitFailure;
  return {std::string(info.name), std::move(cause), std::string(info.remedy), exit_code};
}

int report(const Problem& problem) {
  std::fflush(stdout);
  std::string text = fmt::format("tm485: {}: {}\n", problem.name, problem.cause);
  if (!problem.remedy.empty()) text += fmt::format("  remedy: {}\n", problem.remedy);
  // A cause may quote a file that somebody else has made.
  std::fputs(plain_lines(text).c_str(), stderr);
  return problem.exit_code;
}

}  // namespace tm485::cli
