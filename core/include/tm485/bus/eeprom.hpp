// EepromManager: reads, writes and verifies ranges of the encoder's EEPROM, one background exchange at a time.
//
// A state machine without I/O: next() says what to send, on_completion() takes what came of it. drive() ties it to a
// bus. What it guards against: noise (requests and replies that are lost, changed, or changed into other valid ones),
// a busy EEPROM, a page that is not the one wanted, a restart of the encoder at any time. docs/eeprom.md says how, and
// what must be assumed. Specification: section 5.
#pragma once

#include <algorithm>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>

#include "tm485/bus/background.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/errc.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/protocol/request.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// What went wrong, and at which byte.
struct EepromError {
  Errc code = Errc::ok;
  std::uint8_t page = 0;
  std::uint8_t address = 0;
  std::uint8_t wanted =
      0;  ///< with eeprom_mismatch: what should be there; of a byte of which nothing was known, as found
  std::uint8_t found = 0;  ///< with eeprom_mismatch
};

/// What may hold neither the old nor the new value if nothing more is done, as after a cable was pulled.
struct EepromDoubt {
  std::uint8_t page = 0;  ///< the byte that was being written or looked at
  std::uint8_t address = 0;
  /// One bit a page: any byte of it. A write of which no echo was heard may have gone to any address of its page.
  std::uint32_t pages = 0;
};

struct EepromProgress {
  /// Bytes that are dealt with. Of a write it can go back to 0: if a write got no echo and nothing is known of the EEPROM, the
  /// task's own bytes are looked at once more at its end, at most six times; then it ends with why no echo came.
  std::uint32_t done = 0;
  std::uint32_t total = 0;
  std::uint32_t writes = 0;        ///< of bytes: each costs one of the cell's 100 000
  std::uint32_t page_selects = 0;  ///< writes of the page register
  std::uint32_t retries = 0;       ///< exchanges that failed and were repeated
  std::uint32_t repaired = 0;      ///< bytes that noise had changed, put back
  std::uint32_t mismatches = 0;    ///< verify: bytes that differ
  /// One bit a page: something was written in it, if only the page register, no echo came, and not all of its bytes were
  /// known. Noise may have made a write of another byte of it, and nobody can say which.
  std::uint32_t unconfirmed_pages = 0;
};

/// What is known of the contents, by linear address; either both spans have as many elements as the EEPROM has bytes,
/// or both are empty. The manager reads and updates it. With it a byte that noise has changed can be put back.
struct EepromKnowledge {
  std::span<std::uint8_t> value;
  std::span<bool> known;
};

/// What a manager does. A test's twin leaves one thing out, to see that the test notices.
struct EepromDiscipline {
  static constexpr bool kChecksBusy = true;
  static constexpr bool kChecksPage = true;
  static constexpr bool kReadsBack = true;
  static constexpr bool kComparesEcho = true;
};

/// One owner: the context of the bus. Every function: constant time.
template <class Discipline = EepromDiscipline>
class BasicEepromManager {
 public:
  /// `profile` and the spans of `known` must outlive the manager.
  explicit BasicEepromManager(const CompiledProfile& profile, const EepromKnowledge& known = {}) noexcept
      : profile_(&profile), known_(known) {}
  explicit BasicEepromManager(const CompiledProfile&& profile, const EepromKnowledge& known = {}) = delete;

  /// Bytes in all: pages times bytes of a page.
  [[nodiscard]] unsigned size() const noexcept {
    return unsigned{profile_->profile().eeprom_pages} * profile_->profile().eeprom_page_bytes;
  }
  /// The linear address of a byte, or bad_argument: a page that the profile has not, or the page register.
  [[nodiscard]] std::expected<unsigned, Errc> linear(unsigned page, unsigned address) const noexcept {
    const Profile& p = profile_->profile();
    if (page >= p.eeprom_pages || address >= p.eeprom_page_bytes) return std::unexpected(Errc::bad_argument);
    return page * p.eeprom_page_bytes + address;
  }

  /// Reads to.size() bytes from linear address `first` on. Errors: bad_argument (not within the EEPROM), busy. `to` must
  /// last until the task is over.
  [[nodiscard]] std::expected<void, Errc> start_read(unsigned first, std::span<std::uint8_t> to) noexcept;
  /// Writes the bytes that differ, reads each back. Errors and lifetime as start_read.
  [[nodiscard]] std::expected<void, Errc> start_write(unsigned first,
                                                      std::span<const std::uint8_t> from) noexcept;
  /// Compares. The outcome is eeprom_mismatch with the first byte that differs; progress() counts them.
  [[nodiscard]] std::expected<void, Errc> start_verify(unsigned first,
                                                       std::span<const std::uint8_t> with) noexcept;
  /// Ends the task behind the byte that is being written, with the outcome abandoned. What was done stays done.
  void cancel() noexcept { cancelled_ = true; }

  [[nodiscard]] bool active() const noexcept { return task_ != Task::none; }
  /// How the last task ended; nothing while one is active, or before the first.
  [[nodiscard]] const std::optional<EepromError>& outcome() const noexcept { return outcome_; }
  [[nodiscard]] const EepromProgress& progress() const noexcept { return progress_; }
  /// What a write has left in doubt so far: of the task that is active, or of the last one that did not end well.
  [[nodiscard]] std::optional<EepromDoubt> in_doubt() const noexcept;
  /// How long the rest takes if nothing fails; of a write, if every byte that is left must be written.
  [[nodiscard]] Time time_left() const noexcept;
  /// The page that the encoder has selected, if that is known.
  [[nodiscard]] std::optional<std::uint8_t> page() const noexcept {
    return page_looks_ == kPageLooks ? page_ : std::nullopt;
  }

  // The driver's side.
  /// The request to send at `now`, if one is due and none is under way. It counts as under way from here on.
  [[nodiscard]] std::optional<Request> next(Time now) noexcept;
  /// When next() has something, at the earliest; kNever while a request is under way or nothing is to be done.
  [[nodiscard]] Time due() const noexcept { return active() && !under_way_ ? wait_until_ : kNever; }
  [[nodiscard]] bool under_way() const noexcept { return under_way_; }
  /// The request that next() gave has its result.
  void on_completion(const Completion& completion, Time now) noexcept;
  /// The bus did not take it: no_gap ends the task; anything else is tried again. So is what the bus took and found no gap for.
  void on_refused(Errc cause, Time now) noexcept;
  /// The encoder was restarted, or may have been: its page is not known any more.
  void on_restart() noexcept { doubt_page(); }

 private:
  enum class Task : std::uint8_t { none, read, write, verify };
  /// What is wanted of the task's byte.
  enum class Phase : std::uint8_t { read, write, read_back };
  /// What is wanted of a byte that noise may have changed: when the echo of a write is wrong or missing, of each byte of
  /// its page in turn. It comes first.
  enum class Suspect : std::uint8_t { none, look, restore, look_again };
  /// What the request under way does for it.
  enum class Action : std::uint8_t { check_page, select_page, read, write };

  static constexpr std::uint8_t kMostTries = 12;    ///< of one request, in a row, before patience counts
  static constexpr std::uint8_t kMostRewrites = 6;  ///< of one byte
  static constexpr std::uint8_t kMostSelects = 6;   ///< of one page, in a row
  static constexpr std::uint8_t kPageLooks = 2;     ///< that agree: a checksum can fit to a wrong reply
  static constexpr std::uint8_t kMostSweeps = 60;   ///< of pages, while one byte is dealt with
  static constexpr std::uint8_t kMostRounds = 6;    ///< of a task's bytes, if writes stay without echo
  static constexpr std::uint8_t kMostBusy = 200;    ///< looks at a busy EEPROM, kBusyPause apart
  static constexpr Time kBusyPause{500'000};

  [[nodiscard]] std::expected<void, Errc> begin(Task task, unsigned first, std::size_t count) noexcept;
  /// The byte that is wanted now: the task's, or the suspect.
  [[nodiscard]] unsigned target() const noexcept { return suspect_ == Suspect::none ? at_ : other_; }
  [[nodiscard]] std::uint8_t page_of(unsigned at) const noexcept {
    return static_cast<std::uint8_t>(at / profile_->profile().eeprom_page_bytes);
  }
  [[nodiscard]] std::uint8_t address_of(unsigned at) const noexcept {
    return static_cast<std::uint8_t>(at % profile_->profile().eeprom_page_bytes);
  }
  [[nodiscard]] Action choose() const noexcept;
  [[nodiscard]] Request request_for(Action action) const noexcept;
  [[nodiscard]] bool writes() const noexcept {
    return suspect_ == Suspect::none ? phase_ == Phase::write : suspect_ == Suspect::restore;
  }
  /// The encoder may have restarted, or changed its page, since the page was looked at.
  void doubt_page() noexcept {
    if constexpr (Discipline::kChecksPage) page_looks_ = 0;
  }
  void next_byte() noexcept;
  void fail(Errc code, std::uint8_t wanted = 0, std::uint8_t found = 0) noexcept;
  void end(const EepromError& outcome) noexcept;

  void try_again(Errc cause, Time now) noexcept;
  void on_unsent(Errc cause, Time now) noexcept;
  void on_failure(Errc cause, Time now) noexcept;
  void on_busy(Time now) noexcept;
  void on_wrong_echo(const Frame& echo, Time now) noexcept;
  void on_echo(Time now) noexcept;
  void on_data(std::uint8_t data) noexcept;
  void on_task_data(std::uint8_t data) noexcept;
  void on_suspect_data(std::uint8_t data) noexcept;
  void doubt_bytes_of(std::uint8_t page) noexcept;
  void begin_sweep() noexcept;
  [[nodiscard]] static constexpr std::uint32_t bit(unsigned page) noexcept {
    return page < 32 ? std::uint32_t{1} << page : 0;
  }
  void suspect_settled() noexcept;
  void know(unsigned at, std::uint8_t value) noexcept;

  const CompiledProfile* profile_;
  EepromKnowledge known_;
  Task task_ = Task::none;
  Phase phase_ = Phase::read;
  Suspect suspect_ = Suspect::none;
  Action action_ = Action::check_page;
  std::span<std::uint8_t> to_;
  std::span<const std::uint8_t> from_;
  unsigned first_ = 0;
  unsigned count_ = 0;
  unsigned at_ = 0;                   ///< linear address of the task's byte
  unsigned other_ = 0;                ///< and of the suspect
  std::uint32_t doubted_ = 0;         ///< pages whose bytes must be looked at, one bit each
  std::optional<std::uint8_t> page_;  ///< as last read or selected
  std::uint8_t page_looks_ = 0;  ///< have said so, and nothing has happened since that could have changed it
  bool under_way_ = false;
  bool cancelled_ = false;
  bool unsent_ = false;  ///< something was not sent, and since then nothing but the page was heard
  std::uint8_t tries_ = 0;
  std::uint8_t rewrites_ = 0;
  std::uint8_t selects_ = 0;
  std::uint8_t sweeps_ = 0;
  std::uint8_t busy_looks_ = 0;
  std::uint8_t rounds_ = 0;
  bool once_more_ = false;   ///< a write may have gone to a byte that is done already
  Errc unheard_ = Errc::ok;  ///< why the last write got no echo
  Time wait_until_{0};
  Time last_heard_ = -kNever;
  Time failing_since_ = kNever;
  std::optional<EepromError> first_mismatch_;
  std::optional<EepromError> outcome_;
  EepromProgress progress_;
};

using EepromManager = BasicEepromManager<>;

/// Of its requests, beside those of an Axis, which count from 1.
inline constexpr std::uint32_t kEepromTicket = 0xFFFF'FF00;

/// Moves a manager on by what the bus has for it, and gives the bus what is next. In the bus's context, after each
/// poll. Answers when to poll the bus and call again at the latest: not after `now` if it has
/// offered something.
template <class Discipline, Port P>
Time drive(BasicEepromManager<Discipline>& manager, Bus<P>& bus, Time now) noexcept {
  if (manager.under_way()) {
    const auto completion = bus.take_completion(Priority::eeprom, kEepromTicket);
    if (!completion) return kNever;
    manager.on_completion(*completion, now);
  }
  if (bus.state() != BusState::running) manager.on_restart();
  if (const auto request = manager.next(now)) {
    const auto offered = bus.offer(*request, kEepromTicket);
    if (offered) return now;
    manager.on_refused(offered.error(), now);
  }
  return manager.due();
}

}  // namespace tm485

#include "tm485/bus/eeprom_steps.hpp"  // IWYU pragma: export
