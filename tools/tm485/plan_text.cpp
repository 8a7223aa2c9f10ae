#include "plan_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "safe_file.hpp"

namespace tm485::cli {
namespace {

bool begins_with_a_fault(std::string_view text) {
  text.remove_prefix(std::min(text.find_first_not_of(" \t\r\n;"), text.size()));
  const std::string_view word = text.substr(0, text.find_first_of(" \t\r\n;#"));
  return std::ranges::any_of(sim::fault_kinds(),
                             [word](const sim::FaultInfo& info) { return info.name == word; });
}

}  // namespace

std::expected<sim::FaultPlan, Problem> plan_from(const std::string& text_or_file) {
  const bool is_text = begins_with_a_fault(text_or_file) || text_or_file.starts_with('#') ||
                       text_or_file.find('\n') != std::string::npos ||
                       text_or_file.find('=') != std::string::npos;
  std::string text = text_or_file;
  if (!is_text) {
    auto content = read_whole_file(text_or_file, sim::FaultPlan::kMostBytes);
    if (!content && text_or_file.find('/') == std::string::npos) {
      content.error().cause =
          fmt::format("'{}' is no fault, and as a file: {}", text_or_file, content.error().cause);
      content.error().remedy = "docs/fault-plans.md lists the faults; of a file, check name and permissions";
    }
    if (!content) return std::unexpected(std::move(content.error()));
    text = std::move(*content);
    constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";  // some editors begin a file with it
    if (text.starts_with(kByteOrderMark)) text.erase(0, kByteOrderMark.size());
  }
  auto plan = sim::FaultPlan::parse(text);
  if (plan) return std::move(*plan);
  const sim::PlanError& error = plan.error();
  std::string place = is_text ? std::string("plan") : text_or_file;
  if (error.line != 0) place += fmt::format(", line {}", error.line);
  return std::unexpected(
      usage_problem(std::string(error.name), fmt::format("{}: {}", place, error.cause), error.remedy));
}

}  // namespace tm485::cli
