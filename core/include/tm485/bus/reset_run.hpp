// ResetRun: ten identical reset requests in a row, and the proof that they did what they should.
//
//   standstill (zero only) -> ten requests, nothing between them -> settle time -> read back
//
// A state machine without I/O, as EepromManager: next() says what to send, on_completion() takes what came of it;
// drive() ties it to a bus and keeps the cycle off the line meanwhile. Specification: section 6.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>

#include "tm485/bus/background.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/bus/reset_outcome.hpp"
#include "tm485/errc.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/protocol/request.hpp"
#include "tm485/time.hpp"

namespace tm485 {

struct ResetConfig {
  /// zero: the shaft stands still if it has moved by no more than this, in counts, over `window`. 0: 2^-15 of a turn, at
  /// least 2.
  std::uint32_t standstill = 0;
  Time window = std::chrono::milliseconds(50);
  /// zero: read back within this of 0, in counts. 0: four times `standstill`.
  std::uint32_t tolerance = 0;
  /// multi_turn: so fast the shaft may turn. Turns that are no longer beside their start value when they are read back, because
  /// noise has put that off, are reset again, unless the shaft cannot have come to them from where it was before. At least 1.
  std::int32_t max_speed_rpm = 6'000;
  /// A run that was interrupted, or whose turns were read back too late, starts again, so often in all.
  std::uint8_t most_runs = 5;
};

/// One owner: the context of the bus. Every function: constant time.
class ResetRun {
 public:
  /// `profile` must outlive the run.
  explicit ResetRun(const CompiledProfile& profile, const ResetConfig& config = {}) noexcept;
  explicit ResetRun(const CompiledProfile&& profile, const ResetConfig& config = {}) = delete;

  /// Begins. Errors: busy while one is active. The caller sees to it that no EEPROM task is open.
  [[nodiscard]] std::expected<void, Errc> start(ResetKind kind) noexcept;
  [[nodiscard]] bool active() const noexcept { return stage_ != Stage::idle; }
  /// How the last run ended; nothing while one is active, or before the first.
  [[nodiscard]] const std::optional<ResetOutcome>& outcome() const noexcept { return outcome_; }
  [[nodiscard]] ResetKind kind() const noexcept { return kind_; }

  // The driver's side.
  [[nodiscard]] std::optional<Request> next(Time now) noexcept;
  /// When next() has something, at the earliest; kNever while a request is under way or nothing is to be done.
  [[nodiscard]] Time due() const noexcept { return active() && !under_way_ ? wait_until_ : kNever; }
  [[nodiscard]] bool under_way() const noexcept { return under_way_; }
  /// The class of the request that is under way.
  [[nodiscard]] Priority priority() const noexcept {
    return stage_ == Stage::run ? Priority::reset_run : Priority::diagnostics;
  }
  void on_completion(const Completion& completion, Time now) noexcept;
  void on_refused(Errc cause, Time now) noexcept;

  /// The ten are being sent: nothing else may go to the line.
  [[nodiscard]] bool needs_line() const noexcept { return stage_ == Stage::run; }
  /// The position is not what it was before: the cycle must not go on before start-up was gone through again.
  [[nodiscard]] bool holds_cycle() const noexcept {
    return stage_ == Stage::run || stage_ == Stage::interrupt || stage_ == Stage::verify;
  }

 private:
  enum class Stage : std::uint8_t {
    idle,
    before,     ///< ID3: what it is now, and whether the shaft stands still
    run,        ///< the ten
    interrupt,  ///< ID3: another request, so that the encoder forgets what it has counted
    verify,     ///< ID3, after the settle time
  };
  static constexpr std::uint8_t kMostTries = 12;
  static constexpr Time kLookEvery = std::chrono::milliseconds(5);
  static constexpr std::uint8_t kMostBusy = 100;  ///< looks at a place that is taken, in a row
  static constexpr Time kBusyPause{100'000};

  void on_reply(const Frame& frame, Time now) noexcept;
  void on_failure(Errc cause, Time now) noexcept;
  void look_before(const Frame& frame, Time now) noexcept;
  void judge(const Frame& frame, Time now) noexcept;
  [[nodiscard]] std::int64_t turns_since(Time then, Time now) const noexcept;
  void begin_run(Time now) noexcept;
  void end(ResetVerdict verdict, Errc code = Errc::ok) noexcept;
  [[nodiscard]] std::int64_t abs_distance(std::uint32_t a, std::uint32_t b) const noexcept;
  [[nodiscard]] std::int32_t turns_of(const Frame& frame) const noexcept;

  const CompiledProfile* profile_;
  ResetConfig config_;
  ResetKind kind_ = ResetKind::errors;
  Stage stage_ = Stage::idle;
  bool under_way_ = false;
  bool seen_before_ = false;
  std::uint8_t sent_ = 0;  ///< of the ten, with a good reply
  std::uint8_t tries_ = 0;
  std::uint8_t busy_looks_ = 0;
  Time wait_until_{0};
  Time window_end_{0};
  Time seen_at_{0};             ///< what it was before
  Time done_at_{0};             ///< the tenth was answered
  Errc cause_ = Errc::timeout;  ///< of the last failure
  ResetOutcome result_;
  std::optional<ResetOutcome> outcome_;
};

/// Of its requests, beside those of an Axis, which count from 1.
inline constexpr std::uint32_t kResetRunTicket = 0xFFFF'FF01;

/// Moves a run on by what the bus has for it, and gives the bus what is next. In the bus's context, after each poll.
/// Answers when to poll the bus and call again at the latest: not after `now` if it has
/// offered something, or given the line back.
template <Port P>
Time drive(ResetRun& run, Bus<P>& bus, Time now) noexcept {
  // The end of a run that has kept the cycle from the line.
  const auto give_back = [&] {
    bus.release_line(now);
    bus.on_reset(*run.outcome(), now);
    return now;
  };
  if (run.under_way()) {
    const auto completion = bus.take_completion(run.priority(), kResetRunTicket);
    if (!completion) return kNever;
    const bool held = run.holds_cycle();
    run.on_completion(*completion, now);
    if (held && !run.active()) return give_back();
  }
  if (const auto request = run.next(now)) {
    // For a look before the run one slot is enough; the run itself, and what follows, keep the cycle off the line.
    constexpr Time kOneLook{200'000};
    constexpr Time kLongest = std::chrono::seconds(2);
    bus.hold_line(now + (run.holds_cycle() ? kLongest : kOneLook),
                  run.needs_line() ? LineHold::resets_only : LineHold::no_cycle);
    const auto offered = bus.offer(*request, kResetRunTicket);
    if (offered) return now;
    const bool held = run.holds_cycle();
    run.on_refused(offered.error(), now);
    if (held && !run.active()) return give_back();
  }
  // Also of a look that has to wait: nothing of it is on the line. What the bus has answered before holds no longer.
  if (!run.under_way() && !run.holds_cycle() && bus.line_held()) {
    bus.release_line(now);
    return now;
  }
  return run.due();
}

}  // namespace tm485
