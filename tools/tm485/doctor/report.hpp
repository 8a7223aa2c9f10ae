// The doctor's report: what was looked at, what was found, as text and as JSON.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "doctor/finding_table.hpp"

namespace tm485::cli::doctor {

struct Finding {
  FindingId id;
  Severity severity;
  std::string seen;    ///< the evidence, with its figures
  std::string cause;   ///< that of the table, or a closer one
  std::string remedy;  ///< the same
};

/// One thing that was looked at.
struct Check {
  std::string name;     ///< stable identifier
  std::string verdict;  ///< "good", "note", "warning", "fault", "not judged" or "skipped"
  std::string detail;
};

class Report {
 public:
  /// A finding with the texts of the table. The reference holds until the next one.
  Finding& add(FindingId id, std::string seen);

  /// Ends the check `check_name`: its verdict is the worst of the findings since the check before, or good.
  void end_check(std::string_view check_name, std::string detail);
  /// The same for one that could not be carried out.
  void not_judged(std::string_view check_name, std::string why);
  void skipped(std::string_view check_name, std::string why);

  [[nodiscard]] bool has(FindingId id) const noexcept;
  [[nodiscard]] bool healthy() const noexcept;
  [[nodiscard]] const std::vector<Finding>& findings() const noexcept { return findings_; }
  [[nodiscard]] const std::vector<Check>& checks() const noexcept { return checks_; }

  /// Ctrl-C came before the end.
  bool stopped = false;

 private:
  std::vector<Finding> findings_;
  std::vector<Check> checks_;
  std::size_t judged_ = 0;  // findings that a check has taken into account
};

[[nodiscard]] std::string report_text(const Report& report, std::string_view port, std::string_view profile);
/// One object on one line: port, profile, healthy, stopped, checks, findings.
[[nodiscard]] std::string report_json(const Report& report, std::string_view port, std::string_view profile);

}  // namespace tm485::cli::doctor
