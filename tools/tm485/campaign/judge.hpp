// Judge: what must hold on every cycle, checked against the encoder model. It looks at the samples, records and counters
// that the bus hands out, and shares no code with what makes them.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <utility>

#include "campaign/rules.hpp"
#include "campaign/run_setup.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::cli::campaign {

/// A background task on the EEPROM that is over.
struct EepromOutcome {
  Time begun{0};
  Errc result = Errc::ok;
  bool wrote = false;
  std::int64_t different = 0;  ///< bytes of the task's range that are not those of the EEPROM
  std::int64_t elsewhere = 0;  ///< bytes beyond it that have changed
};

class Judge {
 public:
  Judge(const RunSetup& setup, sim::SimulatedEncoder& encoder, const CompiledProfile& profile) noexcept;

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
  /// Something has the line to itself until then, and says so; no sample is owed before.
  void pause(Time until) noexcept { clear_since_ = std::max(clear_since_, until); }
  void end_pause(Time now) noexcept { clear_since_ = std::min(clear_since_, now); }
  /// The loop has asked for its position to be called referenced.
  void on_homed() noexcept { homed_ = true; }
  /// Zero or turns were set anew: positions have nothing to do with those before.
  void on_new_origin() noexcept { new_origin_ = true; }

  [[nodiscard]] const Violation& violation() const noexcept { return violation_; }
  [[nodiscard]] const Totals& totals() const noexcept { return totals_; }
  [[nodiscard]] Totals& totals() noexcept { return totals_; }
  [[nodiscard]] const sim::FaultEffects& effects() const noexcept { return *effects_; }
  /// T1 of a request that was none of the cycle's has pushed the last cycle out of its slot.
  [[nodiscard]] bool pushed() const noexcept { return pushed_; }
  [[nodiscard]] bool fail(Rule rule, Time now, std::int64_t seen, std::int64_t allowed,
                          std::string_view what = {}) noexcept {
    violation_ = {rule, totals_.cycles, now, seen, allowed, what};
    return false;
  }

 private:
  static constexpr Time kLongestExchange{60'000};
  /// Replies that agree on wrong turns, and are believed when a step comes besides.
  static constexpr unsigned kTellTurns = 2;

  /// What replies to the requests of a cycle look like, by section 2 of the specification.
  struct Shape {
    std::uint8_t cf = 0;
    std::uint8_t length = 0;
    bool positioned = false;
  };
  [[nodiscard]] static Shape shape_of(DataId id) noexcept;

  template <class B>
  [[nodiscard]] bool on_record(B& bus, Time now) noexcept {
    if (bus.record_count() != ++records_) return fail(Rule::statistics, now, bus.record_count(), records_);
    const CycleRecord& record = bus.last_record();
    if (record.result != Errc::ok) ++errors_[static_cast<std::size_t>(record.result)];
    const sim::FaultEffects& effects = *effects_;
    if (record.result == Errc::position_implausible && (effects.bits_changed || effects.frozen)) [[unlikely]]
      count_wrong(true, record.id);
    if (record.kind != CycleRecord::Kind::cyclic) {
      other_before_ = true;
      on_other_record(record);
      return true;
    }
    // Then it has started as soon as T1 and the host's jitter let it.
    pushed_ = std::exchange(other_before_, false) && encoder_->model().t1().last_margin() <= start_jitter_;
    ++totals_.cycles;
    totals_.touched += effects.touched ? 1 : 0;
    totals_.changed += effects.bits_changed ? 1 : 0;
    const Sample& sample = bus.latest();
    const bool fresh = sample.quality() == Quality::fresh;
    const bool good = record.result == Errc::ok;
    ++(good ? totals_.good : totals_.failed);
    if (record.id != id_) [[unlikely]] {
      id_ = record.id;
      shape_ = shape_of(id_);
    }
    // Somebody has spoken since the cycle before: this one, which could not be sent, is the last that the fault has spoilt.
    if (record.result == Errc::line_not_quiet && effects.last >= cycle_seen_) pause(now);
    cycle_seen_ = now;
    // What brings no position shows the last one, and does not call it fresh. A command that begins start-up anew may have
    // come behind the cycle within the same poll.
    const bool due = good && shape_.positioned && bus.state() == BusState::running;
    if (fresh != due) return fail(Rule::failed_and_fresh, now, fresh ? 1 : 0, good ? 1 : 0);
    if (encoder_->model().t1().violations() != 0)
      return fail(Rule::t1, now, encoder_->model().t1().smallest_margin().count(), 0);
    if (good && record.id == DataId::multi_turn && !on_turns(sample, now)) return false;
    return !fresh || on_fresh(sample, record, now);
  }
  void on_other_record(const CycleRecord& record) noexcept;

  [[nodiscard]] bool on_fresh(const Sample& sample, const CycleRecord& record, Time now) noexcept {
    if (sample.latch_time() < record.start || sample.latch_time() > now)
      return fail(Rule::stale, now, (sample.latch_time() - record.start).count(),
                  (now - record.start).count());
    if (!knows_where_it_began(sample, now)) return false;
    const Time before = fresh_latch_;
    if (through_startup_ && !find_origin(sample, now)) [[unlikely]]
      return false;
    note_recovery(sample.latch_time());
    position_ = sample.position();
    const sim::Latch& latch = encoder_->model().last_latch();
    const sim::FaultEffects& effects = *effects_;
    stepped_ = effects.frozen;
    if (effects.frozen) [[unlikely]] {
      on_frozen(sample, before);
    } else {
      frozen_samples_ = 0;
      steps_before_ = sample.discontinuities();
    }
    if (!effects.bits_changed && !effects.frozen) [[likely]] {
      if (sample.position() - carried_ == latch.counts && latched_at(latch, sample) &&
          sample.half_width() >= kQuantisation) [[likely]] {
        count_wrong(false, id_);
        // Turns of its own, and they are those that were carried on.
        carried_doubtful_ = carried_doubtful_ && id_ != DataId::everything;
        return true;
      }
    } else if (effects.bits_changed) {
      ++totals_.changed_and_fresh;
      if (frame_is_broken())
        return fail(Rule::broken_frame, now, encoder_->faults().last_reply().count, shape_.length);
    }
    return on_position(sample, now);
  }

  /// Is it behind the start-up that a power-up of the encoder asks for, and referenced only by a battery or a command?
  [[nodiscard]] bool knows_where_it_began(const Sample& sample, Time now) noexcept {
    const std::uint64_t power_ups = encoder_->model().statistics().power_ups;
    if (power_ups != seen_power_ups_) [[unlikely]] {
      seen_power_ups_ = power_ups;
      powered_at_ = now;
    }
    // The reply of a slow port can be older.
    if (power_ups != power_ups_ && sample.latch_time() > powered_at_) [[unlikely]]
      return fail(Rule::restart, now, static_cast<std::int64_t>(power_ups),
                  static_cast<std::int64_t>(power_ups_), "fresh behind a power-up without a start-up");
    return !sample.referenced() || battery_ || homed_ ||
           fail(Rule::restart, now, 1, 0, "referenced, and nobody has homed it");
  }

  /// A port with wire timestamps knows the latch; with one without, the sample says how far off it may be.
  [[nodiscard]] bool latched_at(const sim::Latch& latch, const Sample& sample) const noexcept {
    if (!slow_) return sample.latch_time() == latch.time;
    // A T2 that is shorter than the profile allows cannot be seen there: the request left so much later.
    constexpr Time kShortestT2{2'000};
    const Time known = sample.latch_uncertainty() + (effects_->touched ? kShortestT2 : Time{0});
    const Time off = latch.time - sample.latch_time();
    return off <= known && -off <= known;
  }

  void count_wrong(bool wrong, DataId id) noexcept {
    wrong_in_a_row_ = wrong ? wrong_in_a_row_ + 1 : 0;
    if (id != DataId::everything) return;
    wrong_turns_in_a_row_ = wrong ? wrong_turns_in_a_row_ + 1 : 0;
    turns_wrong_ = turns_wrong_ && wrong;
  }
  [[nodiscard]] bool find_origin(const Sample& sample, Time now) noexcept;
  void on_frozen(const Sample& sample, Time before) noexcept;
  [[nodiscard]] bool on_position(const Sample& sample, Time now) noexcept;
  [[nodiscard]] bool on_turns(const Sample& sample, Time now) noexcept;
  [[nodiscard]] bool stepped_without_turns(const Sample& sample) const noexcept {
    return !reads_turns_ && sample.discontinuities() != steps_at_startup_;
  }
  [[nodiscard]] bool told_wrong_turns() const noexcept {
    return turns_wrong_ || wrong_turns_in_a_row_ >= kTellTurns;
  }
  [[nodiscard]] bool frame_is_broken() const noexcept;
  [[nodiscard]] bool may_be_somebody_elses(const Sample& sample) const noexcept;
  /// What the encoder calls 0, in counts of the shaft: a reset or a restart moves it.
  [[nodiscard]] std::int64_t origin(Time at) const noexcept {
    return encoder_->model().shaft_counts(at) - shaft_.counts(at, bits_);
  }

  void note_recovery(Time latch) noexcept {
    const Time last = effects_->last;
    if (fresh_latch_ <= last && last < latch) [[unlikely]]
      count_recovery(latch - std::max(last, clear_since_));
    fresh_latch_ = latch;
    through_startup_ = false;
  }
  void count_recovery(Time since) noexcept;

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
    const Sample& sample = bus.latest();
    shown_fresh_ = sample.quality() == Quality::fresh;
    shown_latch_ = sample.latch_time();
    if (bus.state() == BusState::startup) [[unlikely]]
      on_startup(sample);
    const Time since = now - std::max({effects_->last, fresh_latch_, clear_since_});
    const Time step = turns_wrong_ ? turns_bound_ : step_bound_;
    const Time bound = through_startup_ ? startup_bound_ : stepped_ ? step : recovery_bound_;
    return since <= bound || fail(Rule::recovery, now, since.count(), bound.count());
  }
  void on_startup(const Sample& sample) noexcept {
    power_ups_ = seen_power_ups_ = encoder_->model().statistics().power_ups;
    // A start-up forgets that the axis was homed, and refuses the command that says so.
    homed_ = homed_ && carries_turns_;
    if (writes_hold_) pause(encoder_->model().eeprom().busy_until());  // a write that start-up has cut off
    through_startup_ = true;
    could_stand_ = true;  // of a sensor that has stood still through the start-up nothing is known
    frozen_samples_ = 2;
    steps_at_startup_ = sample.discontinuities();
  }

  sim::SimulatedEncoder* encoder_;
  const sim::FaultEffects* effects_;
  DataId id_;
  Shape shape_;
  sim::MotionProfile shaft_;
  unsigned bits_;
  Time start_jitter_;
  bool battery_;
  bool resets_;
  bool slow_;
  bool writes_hold_;
  bool carries_turns_;
  bool reads_turns_;
  bool mixed_;  // the pattern reads several IDs
  Time cycle_time_;
  Time position_time_;
  Time loss_bound_;
  Time recovery_bound_;
  Time step_bound_;   // where turns are read now and then, a step waits for a reply that has them
  Time turns_bound_;  // and one back from wrong turns for two, if ABS fits to both
  Time startup_bound_;
  std::int64_t turn_;
  std::int64_t uncertain_;  // counts that the shaft turns in the uncertainty of the latch
  Time earlier_;     // by so much the reply can be older that a slow port takes for that to its request
  double stopping_;  // the greatest acceleration, in counts per ns^2
  Time clear_since_;
  Time cycle_seen_{0};  // when the last one ended
  Time fresh_latch_{0};
  std::int64_t position_ = 0;      // of that sample
  std::int64_t carried_ = 0;       // turns carried on over restarts, in counts
  bool carried_doubtful_ = false;  // to where start-up read wrong turns
  std::int64_t origin_ = 0;        // as of the last start-up
  bool any_fresh_ = false;
  bool new_origin_ = false;
  bool through_startup_ = true;
  bool homed_ = false;       // on command, since the last start-up
  std::uint64_t power_ups_;  // as of the last start-up
  std::uint64_t seen_power_ups_;
  Time powered_at_{0};
  bool other_before_ = false;  // the last record is not of a cycle
  bool pushed_ = false;
  bool shown_fresh_ = false;
  Time shown_latch_{0};
  bool stepped_ = false;         // the last fresh sample was wrong, so that the next right one is a step
  unsigned wrong_in_a_row_ = 0;  // readings of changed frames, since a right one
  unsigned wrong_turns_in_a_row_ = 0;  // of those that have turns: their row goes on over right ones without
  bool turns_wrong_ =
      false;  // the last sample that had turns was off by some, or the sensor has stood still since
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
