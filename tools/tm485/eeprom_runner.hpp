// EepromRunner: takes an EepromManager through one task after the other on a session, with a progress bar and Ctrl-C.
#pragma once

#include <expected>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "eeprom_image.hpp"
#include "problem.hpp"
#include "progress_bar.hpp"
#include "session.hpp"
#include "tm485/bus/eeprom.hpp"

namespace tm485::cli {

/// Of all tasks together.
struct EepromTotals {
  std::uint32_t writes = 0;
  std::uint32_t page_selects = 0;
  std::uint32_t retries = 0;
  std::uint32_t repaired = 0;
  std::uint32_t unconfirmed_pages = 0;  ///< see EepromProgress
};

/// The pages of a mask as EepromProgress and EepromDoubt have them.
[[nodiscard]] std::vector<unsigned> pages_of(std::uint32_t mask);

/// Says on standard error, at the end of each task, which pages noise may have changed unseen. What it has read is known to the manager from then on, so that it puts back what noise has changed.
class EepromRunner {
 public:
  /// Start-up of the session is through; it has no cycle and must outlive the runner.
  explicit EepromRunner(Session& session);
  EepromRunner(const EepromRunner&) = delete;
  EepromRunner& operator=(const EepromRunner&) = delete;

  [[nodiscard]] const EepromShape& shape() const noexcept { return shape_; }

  // Linear addresses. Problems, exit code 1: that of the manager with page, address and bytes; port_gone and what else
  // Session::failure tells; stopped: Ctrl-C, and the byte that was being written is written.
  [[nodiscard]] std::expected<void, Problem> read(unsigned first, std::span<std::uint8_t> to,
                                                  std::string_view label);
  [[nodiscard]] std::expected<void, Problem> write(unsigned first, std::span<const std::uint8_t> from,
                                                   std::string_view label);

  /// The byte at which the last task ended with eeprom_mismatch, if it did.
  [[nodiscard]] std::optional<ByteDifference> mismatch() const;
  /// What the last task has left in doubt.
  [[nodiscard]] std::optional<EepromDoubt> in_doubt() const noexcept { return manager_.in_doubt(); }
  /// Of the last task.
  [[nodiscard]] const EepromProgress& progress() const noexcept { return manager_.progress(); }
  [[nodiscard]] Time duration() const noexcept { return duration_; }
  [[nodiscard]] const EepromTotals& totals() const noexcept { return totals_; }

 private:
  [[nodiscard]] std::expected<void, Problem> run(std::expected<void, Errc> started, std::string_view label);
  [[nodiscard]] std::expected<void, Problem> drive_to_end(std::string_view label);
  [[nodiscard]] Problem problem_of_outcome(const EepromError& outcome) const;

  Session* session_;
  EepromShape shape_;
  std::vector<std::uint8_t> value_;
  std::unique_ptr<bool[]> known_;  // std::vector<bool> has no elements that a span could be of
  EepromManager manager_;
  ProgressBar bar_;
  Time duration_{0};
  EepromTotals totals_;
};

}  // namespace tm485::cli
