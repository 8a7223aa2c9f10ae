#include "tm485/bus/scheduler.hpp"

#include <algorithm>

namespace tm485 {
namespace {

constexpr Time kLongest = std::chrono::hours(1);
/// Lateness that is carried on to the step that can catch it up, where not every step can.
constexpr Time kCarried{1'000};

[[nodiscard]] constexpr Time ceil_div(Time span, std::int64_t by) noexcept {
  return Time{(span.count() + by - 1) / by};
}

/// The first step that no pattern can have, or size() if all are good.
[[nodiscard]] std::size_t first_bad_step(const Pattern& pattern) noexcept {
  std::size_t i = 0;
  while (i < pattern.size() && number(pattern.step(i).id) <= number(DataId::everything) &&
         pattern.step(i).slots != 0)
    ++i;
  return i;
}

[[nodiscard]] Time longest_ready(DataId id, const CompiledProfile& profile) noexcept {
  return profile.exchange_max(id) - profile.request_time(id) - profile.profile().latch_offset;
}

}  // namespace

std::expected<Scheduler, CycleRefusal> Scheduler::make(const Pattern& pattern, const Phase& phase,
                                                       const CompiledProfile& profile,
                                                       const PortCapability& port) noexcept {
  const auto refuse = [](Errc code, Time nearest = Time{0}, std::size_t step = 0) {
    return std::unexpected(CycleRefusal{code, nearest, static_cast<std::uint8_t>(step)});
  };
  if (pattern.size() == 0 || pattern.size() > Pattern::kMaxSteps) return refuse(Errc::bad_argument);
  if (const std::size_t bad = first_bad_step(pattern); bad < pattern.size())
    return refuse(Errc::bad_argument, Time{0}, bad);
  if (pattern.slot() > kLongest) return refuse(Errc::bad_argument, kLongest);
  const Time shortest = shortest_slot(pattern, profile, port);
  if (pattern.slot() < Time{0}) return refuse(Errc::period_below_t1, shortest);
  Pattern complete = pattern;
  if (pattern.slot() == Time{0}) complete.set_slot(shortest);
  for (std::size_t i = 0; i < complete.size(); ++i) {
    const Time span = complete.slot() * complete.step(i).slots;
    if (span < profile.t1(complete.step(i).id)) return refuse(Errc::period_below_t1, shortest, i);
    if (span < port.shortest_exchange) return refuse(Errc::period_below_port, shortest, i);
  }
  Scheduler scheduler(complete, phase, profile, port);
  if (scheduler.length_ > kLongest)
    return refuse(Errc::bad_argument, kLongest / (scheduler.length_ / complete.slot()));
  if (phase.kind == Phase::Kind::servo) {
    const CycleRefusal refusal = scheduler.check_servo(phase.servo, shortest);
    if (refusal.code != Errc::ok) return std::unexpected(refusal);
    scheduler.lock_ = ServoLock(phase.servo, scheduler.length_, scheduler.latch_after());
  }
  return scheduler;
}

Scheduler::Scheduler(const Pattern& pattern, const Phase& phase, const CompiledProfile& profile,
                     const PortCapability& port) noexcept
    : jitter_margin_(port.jitter_margin),
      uniform_(pattern.size() == 1 && phase.kind != Phase::Kind::servo),
      locked_(phase.kind == Phase::Kind::servo),
      in_epoch_(phase.kind == Phase::Kind::epoch),
      pattern_(pattern),
      profile_(&profile),
      epoch_(phase.epoch) {
  measure(port);
  load_step();
}

/// What the pattern's steps add up to.
void Scheduler::measure(const PortCapability& port) noexcept {
  Time total_slack{0};
  Time last_position = -kNever;
  const Profile& profile = profile_->profile();
  // Twice round, so that the way from the last position to the first is seen as well.
  for (std::size_t i = 0; i < 2 * pattern_.size(); ++i) {
    const std::size_t step = i % pattern_.size();
    const DataId id = pattern_.step(step).id;
    const Time to_next = step_length(step);
    if (layout(id).abs_at != 0) {
      const Time gap = length_ - last_position;
      const bool by_turns = id == DataId::everything && profile.multi_turn_bits != 0;
      if (reads_position_) {
        sample_gap_ = std::max(sample_gap_, gap);
        if (!by_turns) unwrap_gap_ = std::max(unwrap_gap_, gap);
      }
      reads_position_ = true;
      reads_turns_ = reads_turns_ || by_turns;
      last_position = length_;
    }
    length_ += to_next;
    const Time slack = to_next - profile_->t1(id);
    total_slack += slack;
    gap_ = std::max(gap_, slack - 2 * port.jitter_margin);  // the request before is late, and so is this one
  }
  length_ /= 2;
  total_slack /= 2;
  if (!reads_position_) {
    for (std::size_t i = 0; i < pattern_.size(); ++i) sample_gap_ = std::max(sample_gap_, step_length(i));
  }
  const bool nothing_left = total_slack == Time{0} || total_slack < jitter_margin_;
  free_ = !locked_ && !in_epoch_ && nothing_left;
  const bool each_for_itself = pattern_.size() == 1 && !locked_ && !in_epoch_;
  tolerance_ = each_for_itself ? jitter_margin_ : std::max(jitter_margin_, kCarried);
}

Time Scheduler::shortest_slot(const Pattern& pattern, const CompiledProfile& profile,
                              const PortCapability& port) noexcept {
  Time shortest{1};
  for (std::size_t i = 0; i < pattern.size(); ++i) {
    const Pattern::Step step = pattern.step(i);
    const Time needed = std::max(profile.t1(step.id), port.shortest_exchange);
    shortest = std::max(shortest, ceil_div(needed, step.slots));
  }
  return shortest;
}

/// One of pattern and servo period is a whole multiple of the other, and the sample is there when the tick comes.
CycleRefusal Scheduler::check_servo(const ServoClock& clock, Time shortest) const noexcept {
  // With more, the drift that the lock can follow would be more in one period than it hears.
  constexpr std::int64_t kMostPeriods = 60;
  if (clock.period <= Time{0} || clock.period > kLongest) return {Errc::servo_mismatch};
  const bool pattern_longer = length_ >= clock.period;
  const Time longer = std::max(length_, clock.period);
  const Time shorter = std::min(length_, clock.period);
  const std::int64_t ratio = (longer + shorter / 2) / shorter;
  const Time off = longer - shorter * ratio;
  constexpr std::int64_t kWithin = 2000;  // 500 ppm: half of what the lock can follow
  if (ratio > kMostPeriods || std::max(off, -off) > longer / kWithin) {
    // The next longer slot with which it would fit.
    const std::int64_t slots = length_ / pattern_.slot();
    const Time length = pattern_longer ? clock.period * ((length_ + clock.period - Time{1}) / clock.period)
                                       : clock.period / (clock.period / length_);
    const Time slot = length / slots;
    return {Errc::servo_mismatch, slot >= shortest && ratio <= kMostPeriods ? slot : Time{0}};
  }
  const Time ready = longest_ready(pattern_.step(0).id, *profile_);
  if (clock.lead < ready) return {Errc::lead_too_short, ready};
  if (clock.lead > longer) return {Errc::bad_argument};
  return {Errc::ok};
}

Time Scheduler::longest_step() const noexcept {
  Time longest{0};
  for (std::size_t i = 0; i < pattern_.size(); ++i) longest = std::max(longest, step_length(i));
  return longest;
}

Feasibility Scheduler::feasibility() const noexcept {
  Feasibility result;
  result.slot = pattern_.slot();
  result.length = length_;
  result.slack = kNever;
  result.gap = gap_;
  result.free_running = free_;
  for (std::size_t i = 0; i < pattern_.size(); ++i) {
    const DataId id = pattern_.step(i).id;
    result.ready = std::max(result.ready, longest_ready(id, *profile_));
    result.slack = std::min(result.slack, step_length(i) - profile_->t1(id));
  }
  return result;
}

void Scheduler::begin(Time first) noexcept {
  slot_ = first;
  step_ = 0;
  gave_way_ = 0;
  running_ = true;
  load_step();
  if (in_epoch_) {
    const Time latch = first + latch_after();
    if (latch >= epoch_) {
      const Time into = left_of(latch - epoch_, length_);
      if (into > Time{0}) slot_ += length_ - into;
    } else {
      slot_ += left_of(epoch_ - latch, length_);
    }
  }
  if (locked_) slot_ = lock_.begin(first);
}

void Scheduler::load_step() noexcept {
  id_ = pattern_.step(step_).id;
  to_next_ = step_length(step_);
  t1_ = profile_->t1(id_);
}

void Scheduler::next_step() noexcept {
  if (++step_ == pattern_.size()) {
    step_ = 0;
    if (locked_) slot_ = lock_.advance(1);
  }
  load_step();
}

std::uint32_t Scheduler::pass(Time until) noexcept {
  std::uint64_t passed = 0;
  if (!uniform_ && !locked_ && !in_epoch_) {
    // Nobody counts on a step's place in time: slots fall out, and no step does. Otherwise a line that loses as many slots
    // at a time as the pattern has steps, less one, would never get beyond one of them.
    const Time slot = pattern_.slot();
    const std::int64_t slots = whole_in(until - slot_ + slot - Time{1}, slot);
    slot_ += slot * slots;
    passed = static_cast<std::uint64_t>(slots);
  } else if (until - slot_ > length_) {
    const std::int64_t patterns = whole_in(until - slot_, length_);
    passed = static_cast<std::uint64_t>(patterns) * pattern_.size();
    slot_ += length_ * patterns;
    if (locked_ && step_ == 0) slot_ = lock_.advance(patterns);
    if (locked_ && step_ != 0) (void)lock_.advance(patterns);
  }
  // What the servo clock's drift adds to so many patterns can be more than one of them; the rest is caught up later.
  for (std::size_t i = 0; i <= Pattern::kMaxSteps && slot_ < until; ++i) {
    next();
    ++passed;
  }
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(passed, UINT32_MAX));
}

std::uint32_t Scheduler::steps_until(Time until) const noexcept {
  if (uniform_ || (!locked_ && !in_epoch_)) return 0;  // none does
  std::uint32_t steps = 0;
  Time slot = slot_;
  for (std::size_t step = step_, left = pattern_.size(); left != 0 && slot < until; --left) {
    steps |= 1U << step;
    slot += step_length(step);
    if (++step == pattern_.size()) step = 0;
  }
  return steps;
}

std::uint32_t Scheduler::give_way(Time free_at) noexcept {
  if (free_) {  // the grid moves
    if (slot_ >= free_at) return 0;
    const std::int64_t taken = whole_in(free_at - slot_ + to_next_ - Time{1}, to_next_);
    slot_ = free_at;
    return static_cast<std::uint32_t>(std::min<std::int64_t>(taken, UINT32_MAX));
  }
  const Time until = free_at - tolerance_;
  if (slot_ >= until) return 0;
  gave_way_ |= steps_until(until);
  if (locked_) lock_.put_off(slot_, until);
  return pass(until);
}

void Scheduler::on_servo_tick(Time tick, Statistics& statistics) noexcept {
  if (!locked_) return;
  saturating_increment(statistics.servo_ticks);
  if (!running_) {
    lock_.follow(tick);
  } else if (lock_.stands_still(tick)) {
    return lock_.coast(tick);
  }
  const std::optional<Time> error = lock_.on_tick(tick);
  if (!error) return saturating_increment(statistics.servo_locks);
  if (lock_.state() == ServoLock::State::locked) statistics.servo_phase.add(*error);
}

}  // namespace tm485
