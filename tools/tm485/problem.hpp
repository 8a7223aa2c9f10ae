// Problem: what went wrong in a command, for the person who typed it. Every one has a name, a cause, a remedy
// and the exit code that it leads to.
#pragma once

#include <string>
#include <string_view>

#include "tm485/errc.hpp"

namespace tm485::cli {

/// The exit codes of the command.
inline constexpr int kExitGood = 0;
inline constexpr int kExitFailure = 1;  ///< the device, the line or the protocol failed
inline constexpr int kExitUsage = 2;    ///< the command cannot be carried out as it was given

struct Problem {
  std::string name;    ///< stable identifier, for example "bad_period"
  std::string cause;   ///< what happened
  std::string remedy;  ///< what to do about it
  int exit_code = kExitUsage;
};

/// A mistake in the command or in a file that it names: exit code 2.
[[nodiscard]] inline Problem usage_problem(std::string name, std::string cause, std::string remedy) {
  return {std::move(name), std::move(cause), std::move(remedy), kExitUsage};
}

/// The texts of an error code, with exit code 2 for usage errors and 1 for all others. `where` (may be empty) is put
/// before the cause.
[[nodiscard]] Problem problem_of(Errc code, std::string_view where = {});

/// Writes "tm485: NAME: cause" and the remedy to standard error and answers the exit code.
int report(const Problem& problem);

}  // namespace tm485::cli
