// A fault plan as it is given to a command: the plan itself, or the name of a file with it.
#pragma once

#include <expected>
#include <string>

#include "problem.hpp"
#include "tm485/sim/fault_plan.hpp"

namespace tm485::cli {

/// A text with the name of a fault is a plan, anything else the name of a file of at most 16 KiB. Problems (exit code 2):
/// file_failed, and those of sim::PlanError with the file and the line.
[[nodiscard]] std::expected<sim::FaultPlan, Problem> plan_from(const std::string& text_or_file);

}  // namespace tm485::cli
