// What a servo loop of the campaign has besides samples: a clock that the cycle is locked to, and an estimator. Held against
// the encoder model: is a sample latched at its place before a tick, and is the shaft where the estimate says?
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "campaign/dice.hpp"
#include "campaign/judge.hpp"
#include "campaign/run_setup.hpp"
#include "tm485/bus/axis.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::cli::campaign {

/// When the loop runs: by its clock, or once a cycle. One owner.
class ServoTicks {
 public:
  explicit ServoTicks(const RunSetup& setup) noexcept
      : drift_ppm_(setup.servo ? setup.servo->drift_ppm : 0),
        jitter_(setup.servo ? setup.servo->tick_jitter : Time{0}),
        lead_(setup.servo ? setup.servo->clock.lead : Time{0}),
        period_(setup.servo ? setup.servo->clock.period : setup.cycle_time()),
        start_jitter_(setup.start_jitter),
        on_(setup.servo.has_value()),
        judged_(on_ && setup.pattern.size() == 1 && setup.latency == Time{0} && setup.keeps_every_slot()),
        dice_(setup.seed + setup.run + 41) {}

  /// The tick behind the one at `now`. Without a clock of its own the loop has the host's.
  [[nodiscard]] Time after(Time now) noexcept {
    if (!on_) return now + period_;
    ++ticks_;
    return period_ + drifted(period_ * ticks_);
  }

  /// Tells the axis of the tick at `now`.
  template <class A>
  void tick(A& axis, Time now) noexcept {
    if (!on_) return;
    axis.client().servo_tick(now + (jitter_ > Time{0} ? Time{dice_.below(jitter_.count())} : Time{0}));
    const ServoLock* const lock = axis.bus().scheduler()->servo_lock();
    const bool locked = lock->state() == ServoLock::State::locked && axis.bus().state() == BusState::running;
    if (!locked) settled_ = 0;
  }

  /// A fresh sample: has it been latched where the phase wants it?
  template <class A>
  [[nodiscard]] bool on_fresh(const A& axis, const Sample& sample, Judge& judge, Time now) noexcept {
    if (!judged_ || ++settled_ < kSettling || judge.effects().last + period_ * kSettling > now) return true;
    const Time unit = drifted(std::min(axis.bus().scheduler()->length(), period_));
    std::int64_t off = (sample.latch_time() + lead_ - now).count() % unit.count();
    if (off > unit.count() / 2) off -= unit.count();
    if (off < -unit.count() / 2) off += unit.count();
    ++judge.totals().phases;
    const Time pushed = judge.pushed() ? std::max(start_jitter_, kMostPushed) : Time{0};
    const Time allowed = start_jitter_ + pushed + jitter_ + unit / kPartOfUnit + kRounding;
    return std::abs(off) <= allowed.count() ||
           judge.fail(Rule::axis, now, off, allowed.count(), "latched out of phase with the servo clock");
  }

 private:
  static constexpr int kSettling =
      500;  // looks at a cycle that runs: in holds of the line nothing is learned
  static constexpr std::int64_t kPartOfUnit = 64;
  static constexpr Time kRounding{500};
  static constexpr Time kMostPushed{1'000};  // by T1, or the jitter margin if that is longer

  [[nodiscard]] Time drifted(Time span) const noexcept { return span + span * drift_ppm_ / 1'000'000; }

  std::int64_t drift_ppm_;
  Time jitter_;
  Time lead_;
  Time period_;
  Time start_jitter_;
  bool on_;
  bool judged_;  // nothing but faults moves a request out of its slot
  Dice dice_;
  std::int64_t ticks_ = 0;
  int settled_ = 0;  // fresh samples since the cycle is locked
};

/// Whether the shaft is where the estimator says. What is allowed is wide: it is to find an estimator that was not told of a
/// step, of other turns or of a direction, not to measure its lag (tests/core/estimator_test.cpp does that). One owner.
class EstimateWatch {
 public:
  EstimateWatch(const RunSetup& setup, sim::SimulatedEncoder& encoder) noexcept
      : encoder_(&encoder),
        on_(setup.bandwidth != 0.0),
        period_(setup.position_period()),
        turn_(std::int64_t{1} << encoder.model().config().single_turn_bits) {
    const auto turn = static_cast<double>(turn_);
    fastest_ = AxisConfig{}.max_speed_rpm / 60.0 * 1e-9 * turn;
    const bool steady = setup.motion.starts_with("motion=constant");
    steepest_ = steady ? 0.0 : AxisConfig{}.max_acceleration_rpm_s / 60.0 * 1e-18 * turn;
  }

  template <class A>
  [[nodiscard]] bool on_usable(A& axis, const Sample& sample, Judge& judge, Time now) noexcept {
    if (!on_) return true;
    const Estimate shaft = axis.client().estimate_at(now);
    const sim::FaultEffects& effects = judge.effects();
    if (effects.frozen) last_wrong_ = now;
    // Positions that were wrong have their say in the speed for a while.
    if (!shaft.valid() ||
        std::max(last_wrong_, effects.last_change) + period_ * kMemory > sample.latch_time())
      return true;
    const auto& model = encoder_->model();
    const std::int64_t moved = model.shaft_counts(now) - model.shaft_counts(sample.latch_time());
    const std::int64_t off = std::abs(shaft.position - sample.position() - moved);
    const auto period = static_cast<double>(period_.count());
    const auto age = static_cast<double>(sample.age(now).count());
    const double known = 8.0 + 2.0 * static_cast<double>(sample.half_width()) +
                         fastest_ * static_cast<double>(sample.latch_uncertainty().count());
    const double lag = age + kLag * period;
    const auto allowed =
        static_cast<std::int64_t>(known * (4.0 + 4.0 * age / period) + steepest_ * lag * lag / 2.0);
    if (allowed > turn_ / kPartOfTurn) return true;  // could be anywhere
    ++judge.totals().estimates;
    return off <= allowed ||
           judge.fail(Rule::axis, now, off, allowed, "the shaft is not where the estimate says");
  }

 private:
  static constexpr int kMemory = 64;   // periods: the estimator starts anew after 32
  static constexpr double kLag = 8.0;  // periods, of an estimator of an eighth of the rate
  static constexpr std::int64_t kPartOfTurn = 4;

  sim::SimulatedEncoder* encoder_;
  bool on_;
  Time period_;
  std::int64_t turn_;
  double fastest_;   // counts per ns
  double steepest_;  // counts per ns^2
  Time last_wrong_ = -kNever;
};

}  // namespace tm485::cli::campaign
