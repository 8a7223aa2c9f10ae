// Scheduler: when the next cyclic request is due, and what a late one does to the grid.
//
// A start is max(slot, previous start + T1 of the previous ID); T1 is kept by RequestSpacing for
// every request of the bus, cyclic or not. A period of T1, or below T1 + jitter margin, runs *free*: a late
// start moves the grid and the slip is counted (keeping phase there would lose every other cycle).
// A longer period keeps its *phase*: a missed slot is skipped and counted, and requests never bunch up.
// Specification: section 4.
#pragma once

#include <cstdint>
#include <expected>

#include "tm485/bus/port.hpp"
#include "tm485/bus/statistics.hpp"
#include "tm485/errc.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// What is read in every cycle.
struct Cycle {
  DataId id = DataId::everything;  ///< ID0, ID1, ID2 or ID3
  Time period{0};                  ///< request start to request start; 0: the shortest possible
};

/// Why a cycle is impossible, and the nearest that is possible.
struct CycleRefusal {
  Errc code;        ///< bad_argument (ID, period or axis), period_below_t1, period_below_port, position_lost
  Time nearest{0};  ///< the shortest period that would be accepted; 0 with bad_argument
};

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

/// The cyclic grid. One owner. Every function: constant time; a 64-bit division only after a stall.
class Scheduler {
 public:
  /// Checks a cycle against the profile and the port.
  [[nodiscard]] static std::expected<Scheduler, CycleRefusal> make(const Cycle& cycle,
                                                                   const CompiledProfile& profile,
                                                                   const PortCapability& port) noexcept;

  /// The first slot.
  void begin(Time first) noexcept { slot_ = first; }
  /// The slot that is next.
  [[nodiscard]] Time slot() const noexcept { return slot_; }
  [[nodiscard]] DataId id() const noexcept { return id_; }
  [[nodiscard]] Time period() const noexcept { return period_; }
  /// True if a late start moves the grid.
  [[nodiscard]] bool free_running() const noexcept { return free_; }

  /// The slot's request started at `start`, not before the slot. Moves on to the next slot.
  void on_start(Time start, Statistics& statistics) noexcept {
    const Time late = start - slot_;
    if (free_) {
      if (late > jitter_margin_) saturating_increment(statistics.slips);
      slot_ = start + period_;
      return;
    }
    if (late >= period_) [[unlikely]]
      catch_up(late, statistics);
    slot_ += period_;
    if (start + t1_ > slot_ + jitter_margin_) {  // T1 would push the next request out of its slot
      saturating_increment(statistics.skipped);
      slot_ += period_;
    }
  }

  /// The slot passed at `now` without a request.
  void on_unused(Time now, Statistics& statistics) noexcept {
    if (now - slot_ >= period_) catch_up(now - slot_, statistics);
    slot_ += period_;
  }

  /// True if a gap of the pattern holds an exchange that takes `span`, also behind a start that is late by the jitter margin.
  [[nodiscard]] bool has_gap_for(Time span) const noexcept { return t1_ + jitter_margin_ + span <= period_; }

 private:
  Scheduler(DataId id, Time period, Time t1, Time jitter_margin) noexcept
      : period_(period),
        t1_(t1),
        jitter_margin_(jitter_margin),
        id_(id),
        free_(period <= t1 || period < t1 + jitter_margin) {}

  /// Cold: one or more whole slots have passed.
  void catch_up(Time late, Statistics& statistics) noexcept;

  Time slot_{0};
  Time period_;
  Time t1_;
  Time jitter_margin_;
  DataId id_;
  bool free_;
};

}  // namespace tm485
