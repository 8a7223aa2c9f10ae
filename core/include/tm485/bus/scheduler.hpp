// Scheduler: when the next cyclic request is due, and what a late one does to the grid.
//
// A start is max(slot, previous start + T1 of the previous ID); T1 is kept by RequestSpacing for
// every request of the bus, cyclic or not. A pattern that leaves nothing beyond its T1s, or less than the jitter
// margin, runs *free* if nobody asks for a phase: a late start moves the grid and the slip is counted (keeping phase
// there would lose every other cycle). Any other keeps its *phase*: a late start is caught up in the next free time
// of the pattern, a missed slot is skipped and counted, and requests never bunch up.
// Specification: section 4.
#pragma once

#include <cstdint>
#include <expected>

#include "tm485/bus/pattern.hpp"
#include "tm485/bus/port.hpp"
#include "tm485/bus/servo_lock.hpp"
#include "tm485/bus/statistics.hpp"
#include "tm485/errc.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// The minimum distance between requests. One for each bus; every request goes through it.
class RequestSpacing {
 public:
  /// No request may start earlier.
  [[nodiscard]] Time earliest() const noexcept { return earliest_; }
  /// A request started at `start`; the next may follow `t1` later.
  void on_start(Time start, Time t1) noexcept { hold_off(start + t1); }
  /// Bytes of the reply were seen at `seen`. Without wire timestamps the start of the request is an
  /// estimate; but its true start was at least `shortest` before `seen`, which bounds it from above.
  void on_reply_seen(Time seen, Time shortest, Time t1) noexcept {
    const Time bound = seen - shortest + t1;
    if (bound > earliest_) earliest_ = bound;
  }

  /// Nothing is sent before `until`, besides.
  void hold_off(Time until) noexcept {
    if (until > earliest_) earliest_ = until;
  }

 private:
  Time earliest_{0};
};

/// The cyclic grid. One owner. Every function: bounded by Pattern::kMaxSteps; no 64-bit division but in make(). After a
/// stall, in begin() and, with a servo clock, in on_servo_tick() a whole_in().
class Scheduler {
 public:
  /// Checks a pattern and its phase against the profile and the port. `profile` must outlive the scheduler.
  [[nodiscard]] static std::expected<Scheduler, CycleRefusal> make(const Pattern& pattern, const Phase& phase,
                                                                   const CompiledProfile& profile,
                                                                   const PortCapability& port) noexcept;
  [[nodiscard]] static std::expected<Scheduler, CycleRefusal> make(const Pattern& pattern,
                                                                   const CompiledProfile& profile,
                                                                   const PortCapability& port) noexcept {
    return make(pattern, Phase{}, profile, port);
  }

  /// The pattern begins, at `first` or at the next instant of its phase.
  void begin(Time first) noexcept;
  /// No pattern runs, until begin(). The servo clock is followed all the same.
  void pause() noexcept { running_ = false; }
  /// The slot that is next.
  [[nodiscard]] Time slot() const noexcept { return slot_; }
  /// What is read in it.
  [[nodiscard]] DataId id() const noexcept { return id_; }
  /// Which step of the pattern that is.
  [[nodiscard]] std::size_t step() const noexcept { return step_; }
  /// From it to the one after.
  [[nodiscard]] Time period() const noexcept { return to_next_; }
  /// Of the whole pattern.
  [[nodiscard]] Time length() const noexcept { return length_; }
  [[nodiscard]] const Pattern& pattern() const noexcept { return pattern_; }
  /// The longest time from one request of the pattern to the next.
  [[nodiscard]] Time longest_step() const noexcept;
  /// True if a late start moves the grid.
  [[nodiscard]] bool free_running() const noexcept { return free_; }
  [[nodiscard]] Feasibility feasibility() const noexcept;
  /// True if some step reads a position. If so, replies without one do not count as samples.
  [[nodiscard]] bool reads_position() const noexcept { return reads_position_; }
  /// True if some step reads turns together with the position.
  [[nodiscard]] bool reads_turns() const noexcept { return reads_turns_; }
  /// The longest time from one position to the next, or, without positions, from one reply to the next.
  [[nodiscard]] Time sample_gap() const noexcept { return sample_gap_; }
  /// The longest time over which single-turn data alone must be unwrapped; 0: they never are.
  [[nodiscard]] Time unwrap_gap() const noexcept { return unwrap_gap_; }
  /// The lock to the servo clock, if there is one.
  [[nodiscard]] const ServoLock* servo_lock() const noexcept { return locked_ ? &lock_ : nullptr; }

  /// The slot's request started at `start`, not before the slot. Moves on to the next slot.
  void on_start(Time start, Statistics& statistics) noexcept {
    if (!uniform_) gave_way_ &= ~(1U << step_);
    if (free_) {
      if (start - slot_ > jitter_margin_) saturating_increment(statistics.slips);
      slot_ = start;
      return next();
    }
    const Time free_at = start + t1_ - tolerance_;
    next();
    // T1 would push the next request out of its slot.
    if (free_at > slot_) [[unlikely]]
      saturating_increment(statistics.skipped, pass(free_at));
  }

  /// The slot passed at `now` without a request.
  void on_unused(Time now, Statistics& statistics) noexcept {
    next();
    if (slot_ <= now) saturating_increment(statistics.skipped, pass(now + Time{1}));
  }

  /// The line is taken until `free_at` by something else. Answers how many slots fall to it.
  [[nodiscard]] std::uint32_t give_way(Time free_at) noexcept;
  /// May it be? In a pattern that is in phase the steps of these slots fall out, and of a few steps it could be the same one every
  /// time, the only position, or the only turns: false if one of them has given way since it was asked last.
  [[nodiscard]] bool may_give_way(Time free_at) const noexcept {
    return (gave_way_ & steps_until(free_at - tolerance_)) == 0;
  }

  /// True if a gap of the pattern holds an exchange that takes `span`, also behind a start that is late by the jitter margin.
  [[nodiscard]] bool has_gap_for(Time span) const noexcept { return span <= gap_; }

  /// A tick of the servo clock.
  void on_servo_tick(Time tick, Statistics& statistics) noexcept;

 private:
  Scheduler(const Pattern& pattern, const Phase& phase, const CompiledProfile& profile,
            const PortCapability& port) noexcept;
  [[nodiscard]] static Time shortest_slot(const Pattern& pattern, const CompiledProfile& profile,
                                          const PortCapability& port) noexcept;
  [[nodiscard]] CycleRefusal check_servo(const ServoClock& clock, Time shortest) const noexcept;
  /// From the start of the pattern's first request to its latch.
  [[nodiscard]] Time latch_after() const noexcept {
    return profile_->request_time(pattern_.step(0).id) + profile_->profile().latch_offset;
  }
  void measure(const PortCapability& port) noexcept;
  [[nodiscard]] Time step_length(std::size_t step) const noexcept {
    return pattern_.slot() * pattern_.step(step).slots;
  }

  void next() noexcept {
    slot_ += to_next_;
    if (!uniform_) next_step();
  }
  void next_step() noexcept;
  void load_step() noexcept;
  /// Cold: leaves out what lies before `until`; answers how many slots. In phase with an epoch or a servo clock their steps
  /// fall out too; else they follow in order.
  [[nodiscard]] std::uint32_t pass(Time until) noexcept;
  /// Cold: the steps that fall out if the slots before `until` do, a bit each.
  [[nodiscard]] std::uint32_t steps_until(Time until) const noexcept;

  Time slot_{0};
  Time to_next_{0};  ///< of the step that is next
  Time t1_{0};       ///< of the step that is next
  Time jitter_margin_;
  Time tolerance_{0};  ///< a request may be pushed out of its slot by so much without being left out
  DataId id_ = DataId::everything;
  std::uint8_t step_ = 0;
  bool free_ = false;
  bool running_ = false;
  bool uniform_;  ///< one step and no servo clock
  bool locked_;
  bool in_epoch_;
  bool reads_position_ = false;
  bool reads_turns_ = false;

  Pattern pattern_;
  const CompiledProfile* profile_;
  Time length_{0};
  Time gap_{0};
  Time sample_gap_{0};
  Time unwrap_gap_{0};
  std::uint32_t gave_way_ = 0;  ///< since they were asked: a bit a step
  Time epoch_;                  ///< if in_epoch_
  ServoLock lock_;
};

}  // namespace tm485
