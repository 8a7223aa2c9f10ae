// The interrupt controller of a test: takes the interrupt of a UART's model, and of a one-shot timer, after a latency.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <utility>

#include "tm485/time.hpp"

namespace tm485::test {

/// `M`: a model with engine() and interrupt(); it must not be used without the line. One priority: a handler is not interrupted.
template <class M>
class InterruptLine {
 public:
  InterruptLine(M& model, Time latency) : model_(&model), latency_(latency) {}
  InterruptLine(const InterruptLine&) = delete;
  InterruptLine& operator=(const InterruptLine&) = delete;

  std::function<void(Time)> on_interrupt;
  std::function<void(Time)> on_timer;

  void set_latency(Time latency) { latency_ = latency; }
  /// The timer, see mcu::OneShotTimer.
  void arm(Time span) { timer_ = now() + span; }

  /// Interrupts come while the owner is at work as well, before any of its register accesses takes effect.
  void interrupt_owner() {
    model_->engine().on_access = [this] { take_due(); };
  }

  /// Time passes, interrupts come.
  void run_to(Time until) {
    for (;;) {
      take_due();
      if (next() > until) break;
      model_->engine().advance_to(std::max(next(), now()));
    }
    model_->engine().advance_to(until);
    take_due();
  }

  /// Takes what is due now.
  void take_due() {
    if (std::exchange(busy_, true)) return;
    while (take(raised_, on_interrupt) || take(timer_, on_timer)) {
    }
    busy_ = false;
  }

  /// When something happens by itself, at the earliest.
  [[nodiscard]] Time next() const {
    return std::min(model_->engine().next_event(), std::min(timer_, raised_) + latency_);
  }
  [[nodiscard]] std::uint32_t taken() const { return taken_; }

 private:
  // Far enough away, and a latency can be added.
  static constexpr Time kNone = kNever / 2;

  [[nodiscard]] Time now() const { return model_->engine().now(); }

  bool take(Time& since, const std::function<void(Time)>& handler) {
    look();
    if (since + latency_ > now()) return false;
    since = kNone;
    ++taken_;
    handler(now());
    return true;
  }

  /// The line is a level: low again, it is forgotten.
  void look() {
    if (!model_->interrupt()) {
      raised_ = kNone;
    } else if (raised_ == kNone) {
      raised_ = now();
    }
  }

  M* model_;
  Time latency_;
  Time raised_ = kNone;
  Time timer_ = kNone;
  bool busy_ = false;
  std::uint32_t taken_ = 0;
};

/// The one-shot timer of a port that is under test.
template <class M>
class LineTimer {
 public:
  explicit LineTimer(InterruptLine<M>& line) noexcept : line_(&line) {}
  void arm(Time span) noexcept { line_->arm(span); }

 private:
  InterruptLine<M>* line_;
};

}  // namespace tm485::test
