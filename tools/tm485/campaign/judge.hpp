// Judge: what must hold on every cycle, checked against the encoder model. It looks at the samples, records and counters
// that the bus hands out, and shares no code with what makes them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <optional>

#include "campaign/run_setup.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::cli::campaign {

/// The bounds. A cycle is the period, or T1 where that is longer.
/// A sample of an encoder that is gone is called fresh no longer.
inline constexpr int kCyclesUntilLoss = 3;
/// From the last effect of a fault to a fresh sample, without a start-up.
inline constexpr int kCyclesUntilFresh = 4;
/// The same if the last fresh sample was wrong, so that the right position is a step.
inline constexpr int kCyclesAfterStep = 20;
/// The same through a start-up, or from the end of the boot time.
inline constexpr int kCyclesAfterStartup = 20;
inline constexpr std::int64_t kQuantisation = 1;  ///< counts
/// A wrong position is dangerous from here on: 0.18 degrees.
inline constexpr std::int64_t kDangerousOfTurn = 2'000;

enum class Rule : std::uint8_t {
  position,          ///< a fresh sample is where the shaft was, or within the half-width stated with it
  broken_frame,      ///< no frame that is broken by its length, CF or CRC becomes a fresh sample
  stale,             ///< a fresh sample was latched in its own cycle
  failed_and_fresh,  ///< a failed cycle shows no fresh sample, a good one does
  loss,              ///< loss is found within kCyclesUntilLoss
  recovery,          ///< fresh again within the bounds after the last effect of a fault
  t1,                ///< T1 holds by the model's count
  statistics,        ///< what the bus counts is what was seen
  eeprom,            ///< what a background task has read is what the EEPROM holds
  heap,              ///< nothing is allocated in the cycles
  refused,           ///< the cycle can be started at all
};
[[nodiscard]] constexpr std::string_view name(Rule rule) noexcept {
  constexpr std::array<std::string_view, 11> kNames{"position", "broken_frame", "stale",  "failed_and_fresh",
                                                    "loss",     "recovery",     "t1",     "statistics",
                                                    "eeprom",   "heap",         "refused"};
  return kNames[static_cast<std::size_t>(rule)];
}

/// A background task that is over.
struct EepromOutcome {
  Time begun{0};
  Errc result = Errc::ok;
  std::int64_t different = 0;  ///< bytes that are not those of the EEPROM
};

struct Violation {
  Rule rule = Rule::position;
  std::uint64_t cycle = 0;
  Time time{0};
  std::int64_t seen = 0;     ///< counts, ns or a number, by the rule
  std::int64_t allowed = 0;  ///< likewise
};

/// What was seen, good and bad.
struct Totals {
  std::uint64_t runs = 0;
  std::uint64_t cycles = 0;
  std::uint64_t good = 0;
  std::uint64_t failed = 0;
  std::uint64_t startups = 0;
  std::uint64_t restarts = 0;
  std::uint64_t touched = 0;            ///< cycles in which a fault had an effect
  std::uint64_t changed = 0;            ///< those in which bits were changed
  std::uint64_t changed_and_fresh = 0;  ///< and whose reply became a fresh sample
  std::uint64_t wrong = 0;              ///< of these: a wrong position
  std::uint64_t dangerous = 0;          ///< of these: by more than 0.18 degrees
  std::uint64_t frozen_and_wrong = 0;   ///< fresh, but the sensor stood still
  /// Beyond the half-width stated, where nothing can be told: see Judge::on_position().
  std::uint64_t beyond = 0;
  /// Fresh, whole turns off: read without turns (ID0), after a step of which no host can tell the direction, or after a
  /// sensor that stood still for half a turn.
  std::uint64_t lost_turns = 0;
  std::uint64_t eeprom_reads = 0;     ///< background tasks
  std::uint64_t eeprom_judged = 0;    ///< of them those of whose exchanges no bit was changed
  Time longest_loss{0};               ///< the oldest sample that was called fresh
  std::int64_t longest_recovery = 0;  ///< in hundredths of a cycle, without a start-up
  std::int64_t longest_step =
      0;                    ///< the same if the last fresh sample before was wrong, or of a frozen sensor
  Time longest_startup{0};  ///< from the last effect to the fresh sample, through a start-up
  Time smallest_t1_margin = kNever;

  void add(const Totals& other) noexcept;
};

template <class S>
inline constexpr bool kStatesHalfWidth = requires(const S& sample) { sample.half_width(); };

/// The half-width that a sample states, in counts; nothing where samples state none: a changed frame may then be
/// anywhere, and is only counted.
template <class S>
[[nodiscard]] std::optional<std::int64_t> stated_half_width(const S& sample) noexcept {
  if constexpr (kStatesHalfWidth<S>) {
    return static_cast<std::int64_t>(sample.half_width());
  } else {
    return std::nullopt;
  }
}

/// How often a sample says that the shaft was found where it cannot have come to.
template <class S>
[[nodiscard]] std::uint32_t discontinuities_of(const S& sample) noexcept {
  if constexpr (kStatesHalfWidth<S>) {
    return sample.discontinuities();
  } else {
    return 0;
  }
}

/// In rpm/s; 0 where an axis has none.
template <class A>
[[nodiscard]] double greatest_acceleration(const A& axis) noexcept {
  if constexpr (requires { axis.max_acceleration_rpm_s; }) {
    return axis.max_acceleration_rpm_s;
  } else {
    return 0.0;
  }
}
/// A reading that was held back.
template <class E>
[[nodiscard]] bool is_implausible(E result) noexcept {
  if constexpr (requires { E::position_implausible; }) {
    return result == E::position_implausible;
  } else {
    return false;
  }
}

class Judge {
 public:
  Judge(const RunSetup& setup, sim::SimulatedEncoder& encoder, const CompiledProfile& profile,
        Time cycle_time) noexcept
      : encoder_(&encoder),
        reply_length_(setup.id == DataId::everything ? 11 : 6),
        cf_(setup.id == DataId::everything ? 0x1A : 0x02),
        cycle_time_(cycle_time),
        loss_bound_(cycle_time * kCyclesUntilLoss + kLongestExchange),
        recovery_bound_(cycle_time * kCyclesUntilFresh + kLongestExchange),
        step_bound_(kStatesHalfWidth<Sample> ? cycle_time * kCyclesAfterStep + kLongestExchange : kNever),
        startup_bound_(cycle_time * kCyclesAfterStartup + kLongestExchange),
        turn_(std::int64_t{1} << profile.profile().single_turn_bits),
        uncertain_(uncertainty(profile)),
        stopping_(stopping(profile)),
        clear_since_(encoder.model().config().boot_time) {}

  /// After each poll of a bus. False: a rule is broken, see violation().
  template <class B>
  [[nodiscard]] bool after_poll(B& bus, Time now) noexcept {
    const bool ok = bus.record_count() == records_ || on_record(bus, now);
    return ok && look(bus, now);
  }
  /// At the end of a run: do the bus's own counters say what was seen?
  [[nodiscard]] bool at_end(const Statistics& statistics, Time now) noexcept;

  /// A background task has ended.
  [[nodiscard]] bool on_eeprom(const EepromOutcome& outcome, Time now) noexcept;

  [[nodiscard]] const Violation& violation() const noexcept { return violation_; }
  [[nodiscard]] const Totals& totals() const noexcept { return totals_; }
  [[nodiscard]] bool fail(Rule rule, Time now, std::int64_t seen, std::int64_t allowed) noexcept {
    violation_ = {rule, totals_.cycles, now, seen, allowed};
    return false;
  }

 private:
  static constexpr Time kLongestExchange{60'000};

  [[nodiscard]] static std::int64_t uncertainty(const CompiledProfile& profile) noexcept {
    constexpr double kFastestTurnsPerNs = 6'000.0 / 60e9;
    const double counts = kFastestTurnsPerNs *
                          static_cast<double>(profile.profile().latch_uncertainty.count()) *
                          static_cast<double>(std::int64_t{1} << profile.profile().single_turn_bits);
    return static_cast<std::int64_t>(counts) + 1;
  }

  /// The greatest acceleration of AxisConfig in counts per ns^2.
  [[nodiscard]] static double stopping(const CompiledProfile& profile) noexcept {
    const double turns = greatest_acceleration(AxisConfig{}) / 60.0 * 1e-18;
    return turns * static_cast<double>(std::int64_t{1} << profile.profile().single_turn_bits);
  }

  template <class B>
  [[nodiscard]] bool on_record(B& bus, Time now) noexcept {
    if (bus.record_count() != ++records_) return fail(Rule::statistics, now, bus.record_count(), records_);
    const CycleRecord& record = bus.last_record();
    if (record.result != Errc::ok) ++errors_[static_cast<std::size_t>(record.result)];
    const sim::FaultEffects& effects = encoder_->faults().effects();
    const bool changed = effects.bits_changed;
    if ((changed || effects.frozen) && is_implausible(record.result)) [[unlikely]]
      ++wrong_in_a_row_;
    if (record.kind != CycleRecord::Kind::cyclic) {
      if (record.kind == CycleRecord::Kind::startup && record.result == Errc::ok)
        wrong_in_a_row_ = changed ? wrong_in_a_row_ + 1 : 0;
      return true;
    }
    ++totals_.cycles;
    totals_.touched += effects.touched ? 1 : 0;
    totals_.changed += effects.bits_changed ? 1 : 0;
    const Sample& sample = bus.latest();
    const bool fresh = sample.quality() == Quality::fresh;
    const bool good = record.result == Errc::ok;
    ++(good ? totals_.good : totals_.failed);
    if (fresh != good) return fail(Rule::failed_and_fresh, now, fresh ? 1 : 0, good ? 1 : 0);
    if (encoder_->model().t1().violations() != 0)
      return fail(Rule::t1, now, encoder_->model().t1().smallest_margin().count(), 0);
    return !fresh || on_fresh(sample, record, now);
  }

  [[nodiscard]] bool on_fresh(const Sample& sample, const CycleRecord& record, Time now) noexcept {
    if (sample.latch_time() < record.start || sample.latch_time() > now)
      return fail(Rule::stale, now, (sample.latch_time() - record.start).count(),
                  (now - record.start).count());
    const Time before = fresh_latch_;
    note_recovery(sample.latch_time());
    const sim::Latch& latch = encoder_->model().last_latch();
    const sim::FaultEffects& effects = encoder_->faults().effects();
    stepped_ = effects.frozen;
    lost_track_ = lost_track_ || effects.frozen;
    if (effects.frozen) [[unlikely]] {
      on_frozen(sample, before);
    } else {
      frozen_samples_ = 0;
      steps_before_ = discontinuities_of(sample);
    }
    if (!effects.bits_changed && !effects.frozen) [[likely]] {
      if (sample.position() == latch.counts && sample.latch_time() == latch.time) [[likely]] {
        wrong_in_a_row_ = 0;
        return true;
      }
    } else if (effects.bits_changed) {
      ++totals_.changed_and_fresh;
      if (frame_is_broken())
        return fail(Rule::broken_frame, now, encoder_->faults().last_reply().count, reply_length_);
    }
    return on_position(sample, effects, now);
  }

  void on_frozen(const Sample& sample, Time before) noexcept;
  [[nodiscard]] bool on_position(const Sample& sample, const sim::FaultEffects& effects, Time now) noexcept;
  [[nodiscard]] bool frame_is_broken() const noexcept;

  void note_recovery(Time latch) noexcept {
    const Time last = encoder_->faults().effects().last;
    if (fresh_latch_ <= last && last < latch) [[unlikely]] {
      const Time since = latch - std::max(last, clear_since_);
      if (through_startup_) {
        totals_.longest_startup = std::max(totals_.longest_startup, since);
      } else {
        std::int64_t& longest = stepped_ ? totals_.longest_step : totals_.longest_recovery;
        longest = std::max(longest, since * 100 / cycle_time_);
      }
    }
    fresh_latch_ = latch;
    through_startup_ = false;
  }

  /// What must hold at every instant.
  template <class B>
  [[nodiscard]] bool look(B& bus, Time now) noexcept {
    // Until just before this poll the sample was what it had been since the last one.
    if (shown_fresh_) {
      const Time age = now - shown_latch_;
      if (age > totals_.longest_loss) [[unlikely]]
        totals_.longest_loss = age;
      if (age > loss_bound_) return fail(Rule::loss, now, age.count(), loss_bound_.count());
    }
    shown_fresh_ = bus.latest().quality() == Quality::fresh;
    shown_latch_ = bus.latest().latch_time();
    if (bus.state() == BusState::startup) [[unlikely]] {
      through_startup_ = true;
      could_stand_ = true;  // nothing is known of its speed
      frozen_samples_ = 1;
      steps_at_startup_ = discontinuities_of(bus.latest());
    }
    const Time since = now - std::max({encoder_->faults().effects().last, fresh_latch_, clear_since_});
    const Time bound = stepped_ ? step_bound_ : through_startup_ ? startup_bound_ : recovery_bound_;
    return since <= bound || fail(Rule::recovery, now, since.count(), bound.count());
  }

  sim::SimulatedEncoder* encoder_;
  unsigned reply_length_;
  std::uint8_t cf_;
  Time cycle_time_;
  Time loss_bound_;
  Time recovery_bound_;
  Time step_bound_;
  Time startup_bound_;
  std::int64_t turn_;
  std::int64_t uncertain_;
  double stopping_;
  Time clear_since_;
  Time fresh_latch_{0};
  bool through_startup_ = true;
  bool shown_fresh_ = false;
  Time shown_latch_{0};
  bool lost_track_ = false;      // of the turns, where samples say nothing of discontinuities
  bool stepped_ = false;         // the last fresh sample was wrong, so that the next right one is a step
  unsigned wrong_in_a_row_ = 0;  // readings of changed frames, since a right one
  unsigned frozen_samples_ = 0;  // fresh ones since the sensor froze
  std::uint32_t steps_at_startup_ = 0;
  bool could_stand_ = false;        // the shaft could have stopped when the sensor did
  std::uint32_t steps_before_ = 0;  // discontinuities, as of the last one before
  std::uint32_t records_ = 0;
  std::array<std::uint64_t, kErrcCount> errors_{};
  Totals totals_;
  Violation violation_;
};

}  // namespace tm485::cli::campaign
