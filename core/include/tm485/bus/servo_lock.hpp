// ServoLock: keeps the pattern's start at a given phase of a servo clock, whatever the two clocks' drift.
//
// A second-order loop. The oscillator is the grid itself: the start of the pattern plus its length. Each tick tells
// by how much the start is off; an eighth of it moves the start, a 256th the length, a 2048th once 200 have done so (of a
// pattern with many ticks at most a sixteenth in all: they tell one error again and again before it is corrected once). A
// tick that was stamped late (an interrupt that waited) counts at most for a sixteenth of the period. Nothing here knows T1:
// the grid may ask for what it likes, RequestSpacing keeps T1. Specification: section 4.
#pragma once

#include <cstdint>
#include <optional>

#include "tm485/bus/pattern.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// One owner. Every function: constant time.
class ServoLock {
 public:
  enum class State : std::uint8_t {
    waiting,  ///< no tick yet, or none for kLostAfter periods: the grid runs by itself, at the last known rate
    seeking,  ///< ticks come; the phase is not yet within a sixteenth of the period
    locked,
  };
  static constexpr int kLostAfter = 64;

  /// No servo clock.
  ServoLock() = default;
  /// `length` of the pattern; `latch_after` from the start of its first request to the latch.
  ServoLock(const ServoClock& clock, Time length, Time latch_after) noexcept;

  /// A tick at `tick`. Answers the tick less where the grid expected it, within half a period of zero; nothing if it
  /// is the first one, which moves the grid the whole way.
  std::optional<Time> on_tick(Time tick) noexcept;

  /// The grid begins at `first`, or, if ticks have told the phase already, at the next instant that has it. Answers it.
  [[nodiscard]] Time begin(Time first) noexcept;
  /// While no pattern runs: the grid goes along with the ticks, call it before on_tick().
  void follow(Time tick) noexcept { go_to(tick - ahead_); }
  /// A pattern runs, but something else has the line for more than two of them: the grid stands still, was put off or begins
  /// later, and by how much a tick is off says nothing. Such a tick goes to coast() instead of on_tick().
  [[nodiscard]] bool stands_still(Time tick) const noexcept {
    return state_ != State::waiting && tick - last_tick_ <= period_ * kLostAfter &&
           (tick - start_ > length_ * 2 || tick < off_until_ - length_ * 2);
  }
  void coast(Time tick) noexcept {
    last_tick_ = tick;
    excused_ = Time{0};
    coasting_ = true;
  }
  /// The grid is about to be put off from `slot` to `until`, at once: ticks are not missed before they can have come.
  void put_off(Time slot, Time until) noexcept {
    excused_ += until - slot;
    off_until_ = until;
  }
  /// `patterns` later. Answers the start that is due then.
  Time advance(std::int64_t patterns) noexcept;

  [[nodiscard]] State state() const noexcept { return state_; }
  /// By how much the servo clock is slower than ours, in parts per million, as far as the loop knows. Divides.
  [[nodiscard]] std::int32_t drift_ppm() const noexcept;

 private:
  [[nodiscard]] Time error_of(Time tick) const noexcept;
  void shift(std::int64_t by) noexcept;
  void move(std::int64_t patterns) noexcept;
  void go_to(Time at) noexcept;
  void take_up(Time tick, Time error) noexcept;
  void turn(std::int64_t by) noexcept;

  static constexpr unsigned kFraction = 16;  ///< bits of a nanosecond

  Time start_{0};                ///< of the pattern that is under way or next
  std::int32_t fraction_ = 0;    ///< of start_, in 2^-16 ns
  std::int32_t rate_ = 0;        ///< what a pattern is longer than nominal, in 2^-16 ns
  std::int32_t rate_limit_ = 0;  ///< a thousandth of the pattern
  std::int32_t rate_gain_ = 0;   ///< rate_ for one ns of error
  Time length_{0};
  Time unit_{0};    ///< the phase is known modulo this: the shorter of pattern and servo period
  Time period_{0};  ///< of the servo clock, nominal
  Time ahead_{0};   ///< a tick comes this long after the start of a pattern
  Time last_tick_{0};
  Time heard_at_{0};         ///< the last tick that did not coast
  Time off_until_{-kNever};  ///< the grid was put off at once until then, or begins then
  Time excused_{0};          ///< by so much since the last tick
  State state_ = State::waiting;
  std::uint8_t votes_ = 0;   ///< ticks in a row that speak for another state
  std::uint8_t mute_ = 0;    ///< so many more say nothing of the rate
  std::uint8_t taught_ = 0;  ///< so many have told the rate since the first, kTaught at most
  bool coasting_ = false;    ///< the last one has
};

}  // namespace tm485
