#include "doctor/report.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "json_output.hpp"
#include "text_wrap.hpp"

namespace tm485::cli::doctor {

Finding& Report::add(FindingId id, std::string seen) {
  const FindingInfo& info = describe(id);
  return findings_.emplace_back(
      Finding{id, info.severity, std::move(seen), std::string(info.cause), std::string(info.remedy)});
}

void Report::end_check(std::string_view check_name, std::string detail) {
  std::string_view verdict = "good";
  Severity worst = Severity::note;
  for (; judged_ < findings_.size(); ++judged_) {
    worst = std::max(worst, findings_[judged_].severity);
    verdict = name(worst);
  }
  checks_.push_back({std::string(check_name), std::string(verdict), std::move(detail)});
}

void Report::not_judged(std::string_view check_name, std::string why) {
  checks_.push_back({std::string(check_name), "not judged", std::move(why)});
}

void Report::skipped(std::string_view check_name, std::string why) {
  checks_.push_back({std::string(check_name), "skipped", std::move(why)});
}

bool Report::has(FindingId id) const noexcept {
  return std::ranges::any_of(findings_, [id](const Finding& finding) { return finding.id == id; });
}

bool Report::healthy() const noexcept {
  return std::ranges::none_of(findings_,
                              [](const Finding& finding) { return finding.severity == Severity::fault; });
}

std::string report_text(const Report& report, std::string_view port, std::string_view profile) {
  constexpr std::size_t kCheckIndent = 25;
  constexpr std::size_t kFindingIndent = 10;
  std::string text = fmt::format("{}, profile {}\n\n", port, profile);
  for (const Check& check : report.checks())
    text += fmt::format("{:<13} {:<10} {}\n", check.name, check.verdict, wrapped(check.detail, kCheckIndent));
  for (const Finding& finding : report.findings()) {
    text += fmt::format("\n{} {}\n", name(finding.severity), describe(finding.id).name);
    for (const auto& [label, content] :
         {std::pair{"seen", &finding.seen}, {"cause", &finding.cause}, {"remedy", &finding.remedy}})
      if (!content->empty()) text += fmt::format("  {:<7} {}\n", label, wrapped(*content, kFindingIndent));
  }
  if (report.stopped)
    text += "\nstopped before the end: what was not looked at may be wrong too\n";
  else if (report.findings().empty())
    text += "\nhealthy: nothing found\n";
  else if (report.healthy())
    text += "\nno fault found\n";
  return text;
}

std::string report_json(const Report& report, std::string_view port, std::string_view profile) {
  std::vector<JsonObject> checks;
  for (const Check& check : report.checks()) {
    JsonObject json;
    json.set("name", check.name).set("verdict", check.verdict).set("detail", check.detail);
    checks.push_back(std::move(json));
  }
  std::vector<JsonObject> findings;
  for (const Finding& finding : report.findings()) {
    JsonObject json;
    json.set("name", describe(finding.id).name).set("severity", name(finding.severity));
    json.set("seen", finding.seen).set("cause", finding.cause).set("remedy", finding.remedy);
    findings.push_back(std::move(json));
  }
  JsonObject json;
  json.set("port", port).set("profile", profile).set("healthy", report.healthy() && !report.stopped);
  json.set("stopped", report.stopped).set("checks", std::move(checks)).set("findings", std::move(findings));
  return json.text() + '\n';
}

}  // namespace tm485::cli::doctor
