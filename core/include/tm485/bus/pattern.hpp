// Pattern: what is read in every slot, over and over, and whether that can be done.
//
//   Pattern(Cycle{DataId::everything, 62500ns})                      one ID, one period
//   Pattern(40us, {{DataId::single_turn, 6}, {DataId::everything, 1, 2}})
//                                                                    ID0 in six slots, ID3 in two
//
// A step is one request; `slots` beyond the first are a declared gap: what the T1 of an ID needs, or room for
// background exchanges. Specification: section 4.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <initializer_list>

#include "tm485/bus/port.hpp"
#include "tm485/errc.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// One ID in every slot.
struct Cycle {
  DataId id = DataId::everything;  ///< ID0, ID1, ID2 or ID3
  Time period{0};                  ///< request start to request start; 0: the shortest possible
};

/// `times` requests of one ID in a row, each in `slots` slots.
struct PatternRun {
  DataId id = DataId::everything;  ///< ID0, ID1, ID2 or ID3
  std::uint8_t times = 1;          ///< 1 or more
  std::uint8_t slots = 1;          ///< 1 or more
};

/// A repeating mix of up to 32 requests. Plain data; whether it can be kept is the scheduler's to say.
class Pattern {
 public:
  static constexpr std::size_t kMaxSteps = 32;
  struct Step {
    DataId id = DataId::everything;
    std::uint8_t slots = 1;
  };

  /// One ID in every slot. Not explicit: a Cycle is the simplest pattern.
  constexpr Pattern(const Cycle& cycle = {}) noexcept  // NOLINT(google-explicit-constructor)
      : slot_(cycle.period), count_(1) {
    steps_[0] = {cycle.id, 1};
  }
  /// Runs one after the other, in slots of `slot` (0: the shortest possible). Without any step, or with more than
  /// kMaxSteps, the scheduler refuses it.
  constexpr Pattern(Time slot, std::initializer_list<PatternRun> runs) noexcept : slot_(slot) {
    for (const PatternRun& run : runs)
      for (unsigned i = 0; i < run.times; ++i) add({run.id, run.slots});
  }

  /// One more step at the end.
  constexpr void add(Step step) noexcept {
    if (count_ < kMaxSteps) steps_[count_] = step;
    if (count_ <= kMaxSteps) ++count_;
  }

  /// 0 or more than kMaxSteps: refused.
  [[nodiscard]] constexpr std::size_t size() const noexcept { return count_; }
  [[nodiscard]] constexpr const Step& step(std::size_t index) const noexcept { return steps_[index]; }
  /// 0: the shortest possible.
  [[nodiscard]] constexpr Time slot() const noexcept { return slot_; }
  constexpr void set_slot(Time slot) noexcept { slot_ = slot; }

 private:
  std::array<Step, kMaxSteps> steps_{};
  Time slot_{0};
  std::uint8_t count_ = 0;
};

/// A servo clock to which the pattern is locked: its ticks come through Bus::on_servo_tick.
struct ServoClock {
  Time period{0};  ///< nominal; the pattern's length is a whole multiple of it, or the other way round
  Time lead{0};    ///< the first step's position is latched this long before a tick
};

/// When a pattern starts.
struct Phase {
  enum class Kind : std::uint8_t {
    any,    ///< at once
    epoch,  ///< the first step's latch instants fall on `epoch` + n times the length: several buses in step
    servo,  ///< locked to a servo clock
  };
  Kind kind = Kind::any;
  Time epoch{0};
  ServoClock servo;

  [[nodiscard]] static constexpr Phase at(Time epoch) noexcept { return {Kind::epoch, epoch, {}}; }
  [[nodiscard]] static constexpr Phase locked_to(const ServoClock& clock) noexcept {
    return {Kind::servo, Time{0}, clock};
  }
};

/// Why a pattern is impossible, and the nearest that is possible.
struct CycleRefusal {
  /// bad_argument (no step, too many, an ID that is not read in cycles, a slot above an hour, an axis that is not
  /// valid), period_below_t1, period_below_port, position_lost, servo_mismatch or lead_too_short.
  Errc code;
  Time nearest{0};  ///< the shortest slot (lead_too_short: lead) that would be accepted; 0: none would help
  std::uint8_t step = 0;  ///< which step of the pattern it is about
};

/// What an accepted pattern leaves.
struct Feasibility {
  Time slot{0};               ///< as given, or the shortest possible
  Time length{0};             ///< of the whole pattern
  Time slack{0};              ///< how late a request may be without delaying the next: the least of all steps
  Time gap{0};                ///< longest background exchange (with its T1) that a gap holds; 0: none does
  Time ready{0};              ///< from the latch to the sample, at the latest, without the port's latency
  bool free_running = false;  ///< a late start moves the grid: nothing of the pattern is left to catch up in
};

}  // namespace tm485
