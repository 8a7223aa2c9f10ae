#include "eeprom_runner.hpp"

#include <fmt/format.h>

#include "stop_signal.hpp"

namespace tm485::cli {
namespace {

/// After Ctrl-C the manager ends behind its byte. One whose encoder is silent gives up by itself before that.
constexpr Time kLongestCancel = std::chrono::seconds(20);

void warn_unconfirmed(std::uint32_t pages) {
  for (const unsigned page : pages_of(pages))
    fmt::print(
        stderr,
        "tm485: warning: page {}: a request was not answered while nothing was known of this page. If noise "
        "made\n  a write of it, one byte has changed unseen; compare the page with an older image\n",
        page);
}

}  // namespace

std::vector<unsigned> pages_of(std::uint32_t mask) {
  std::vector<unsigned> pages;
  for (unsigned page = 0; page < 32; ++page)
    if ((mask >> page & 1U) != 0) pages.push_back(page);
  return pages;
}

EepromRunner::EepromRunner(Session& session)
    : session_(&session),
      shape_(shape_of(session.profile().profile())),
      value_(shape_.size()),
      known_(std::make_unique<bool[]>(shape_.size())),
      manager_(session.profile(), {std::span(value_), std::span(known_.get(), shape_.size())}) {}

std::expected<void, Problem> EepromRunner::read(unsigned first, std::span<std::uint8_t> to,
                                                std::string_view label) {
  return run(manager_.start_read(first, to), label);
}

std::expected<void, Problem> EepromRunner::write(unsigned first, std::span<const std::uint8_t> from,
                                                 std::string_view label) {
  return run(manager_.start_write(first, from), label);
}

std::expected<void, Problem> EepromRunner::run(std::expected<void, Errc> started, std::string_view label) {
  if (!started) return std::unexpected(problem_of(started.error()));
  const Time begin = session_->now();
  auto result = drive_to_end(label);
  duration_ = session_->now() - begin;
  bar_.clear();
  const EepromProgress& progress = manager_.progress();
  totals_.writes += progress.writes;
  totals_.page_selects += progress.page_selects;
  totals_.retries += progress.retries;
  totals_.repaired += progress.repaired;
  warn_unconfirmed(progress.unconfirmed_pages & ~totals_.unconfirmed_pages);
  totals_.unconfirmed_pages |= progress.unconfirmed_pages;
  return result;
}

std::expected<void, Problem> EepromRunner::drive_to_end(std::string_view label) {
  Time give_up = kNever;
  while (true) {
    const Time now = session_->now();
    const Time due = drive(manager_, session_->bus(), now);
    if (!manager_.active()) break;
    if (stop_requested() && give_up == kNever) {
      manager_.cancel();
      bar_.clear();
      fmt::print(stderr, "tm485: stopping behind the byte under way; Ctrl-C again stops at once\n");
      give_up = now + kLongestCancel;
    }
    if (now >= give_up)
      return std::unexpected(
          Problem{"stopped", "stopped; the encoder did not answer any more", {}, kExitFailure});
    const EepromProgress& progress = manager_.progress();
    bar_.show(label, progress.done, progress.total, manager_.time_left(), now);
    (void)session_->step(due);
    if (auto problem = session_->failure()) {
      problem->cause += fmt::format(" after {} of {} bytes", progress.done, progress.total);
      return std::unexpected(std::move(*problem));
    }
  }
  const EepromError& outcome = *manager_.outcome();
  if (outcome.code == Errc::ok) return {};
  return std::unexpected(problem_of_outcome(outcome));
}

std::optional<ByteDifference> EepromRunner::mismatch() const {
  const auto& outcome = manager_.outcome();
  if (!outcome || outcome->code != Errc::eeprom_mismatch) return std::nullopt;
  return ByteDifference{outcome->page, outcome->address, outcome->wanted, outcome->found};
}

Problem EepromRunner::problem_of_outcome(const EepromError& outcome) const {
  const EepromProgress& progress = manager_.progress();
  if (outcome.code == Errc::abandoned)
    return {"stopped",
            fmt::format("stopped after {} of {} bytes", progress.done, progress.total),
            {},
            kExitFailure};
  std::string where =
      fmt::format("{}: page {}, address {}", session_->port().text(), outcome.page, outcome.address);
  if (outcome.code == Errc::eeprom_mismatch && outcome.wanted == outcome.found)
    where += fmt::format(" (holds {:02X} since noise made a write of it; what it held was not known)",
                         outcome.found);
  else if (outcome.code == Errc::eeprom_mismatch)
    where += fmt::format(" (wanted {:02X}, found {:02X})", outcome.wanted, outcome.found);
  Problem problem = problem_of(outcome.code, where);
  problem.exit_code = kExitFailure;
  return problem;
}

}  // namespace tm485::cli
