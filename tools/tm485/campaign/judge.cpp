#include "campaign/judge.hpp"

namespace tm485::cli::campaign {
namespace {

/// What the shaft turns in this time, at its greatest speed.
std::int64_t most_turned(const CompiledProfile& profile, Time time) noexcept {
  constexpr double kFastestTurnsPerNs = 6'000.0 / 60e9;
  const double counts = kFastestTurnsPerNs * static_cast<double>(time.count()) *
                        static_cast<double>(std::int64_t{1} << profile.profile().single_turn_bits);
  return static_cast<std::int64_t>(counts) + 1;
}

double stopping(const CompiledProfile& profile) noexcept {
  const double turns = AxisConfig{}.max_acceleration_rpm_s / 60.0 * 1e-18;
  return turns * static_cast<double>(std::int64_t{1} << profile.profile().single_turn_bits);
}

/// Any step of the pattern has the turns in its reply.
bool reads_turns(const Pattern& pattern) noexcept {
  for (std::size_t k = 0; k < pattern.size(); ++k)
    if (pattern.step(k).id == DataId::everything) return true;
  return false;
}

/// So many positions until a step is followed that so many replies with turns have to tell.
int rounds_of_turns(const RunSetup& setup, int replies) noexcept {
  const int round = static_cast<int>(setup.pattern.size());
  return reads_turns(setup.pattern) ? std::max(kCyclesUntilFresh, replies * round) : kCyclesUntilFresh;
}

}  // namespace

Judge::Judge(const RunSetup& setup, sim::SimulatedEncoder& encoder, const CompiledProfile& profile) noexcept
    : encoder_(&encoder),
      effects_(&encoder.faults().effects()),
      id_(setup.pattern.step(0).id),
      shape_(shape_of(id_)),
      shaft_(setup.shaft),
      bits_(profile.profile().single_turn_bits),
      start_jitter_(setup.start_jitter),
      battery_(profile.profile().battery),
      resets_(setup.background == Background::resets),
      slow_(setup.latency > Time{0}),
      writes_hold_(setup.writes_hold_the_line()),
      carries_turns_(setup.axis && setup.after_restart == Continuity::re_reference),
      reads_turns_(reads_turns(setup.pattern)),
      mixed_(setup.pattern.size() > 1),
      cycle_time_(setup.cycle_time()),
      position_time_(setup.position_time()),
      loss_bound_(cycle_time_ * kCyclesUntilLoss + kLongestExchange),
      recovery_bound_(setup.time_of_positions(kCyclesUntilFresh) + kLongestExchange),
      step_bound_(setup.time_of_positions(rounds_of_turns(setup, 1)) + kLongestExchange),
      turns_bound_(setup.time_of_positions(rounds_of_turns(setup, 2)) + kLongestExchange),
      startup_bound_(setup.time_of_positions(kCyclesAfterStartup) + kLongestExchange),
      turn_(std::int64_t{1} << profile.profile().single_turn_bits),
      uncertain_(most_turned(profile, profile.profile().latch_uncertainty)),
      earlier_(setup.latency + kLongestExchange),
      stopping_(stopping(profile)),
      clear_since_(encoder.model().config().boot_time),
      power_ups_(encoder.model().statistics().power_ups),
      seen_power_ups_(power_ups_) {}

Judge::Shape Judge::shape_of(DataId id) noexcept {
  switch (id) {
    case DataId::single_turn:
      return {.cf = 0x02, .length = 6, .positioned = true};
    case DataId::multi_turn:
      return {.cf = 0x8A, .length = 6};
    case DataId::encoder_id:
      return {.cf = 0x92, .length = 4};
    default:
      return {.cf = 0x1A, .length = 11, .positioned = true};
  }
}

void Judge::on_other_record(const CycleRecord& record) noexcept {
  if (record.kind == CycleRecord::Kind::startup) {
    if (record.result != Errc::ok) return;
    count_wrong(effects_->bits_changed, record.id);
    if (record.id == DataId::everything) turns_wrong_ = effects_->bits_changed;  // the turns begin with these
    return;
  }
  if (record.id != DataId::eeprom_write || !writes_hold_) return;
  // The line belongs to the write for as long as the encoder needs for it; one of which no reply came may have been a
  // change of the page, the longest of them.
  constexpr Time kLongestWrite = std::chrono::milliseconds(18);
  pause(record.result == Errc::ok ? encoder_->model().eeprom().busy_until() : record.start + kLongestWrite);
}

/// By the bytes that the line carried, as the specification says (section 3): the XOR of a whole frame is 0. What comes
/// behind a whole frame does not make it a broken one: a host that took it before cannot know.
bool Judge::frame_is_broken() const noexcept {
  // What the receiver makes of a distorted burst, or of one that met another driver, is not known here.
  if (effects_->mixed) return false;
  const sim::Burst& reply = encoder_->faults().last_reply();
  if (reply.count < shape_.length) return true;
  unsigned sum = 0;
  for (unsigned k = 0; k < shape_.length; ++k) sum ^= reply.bytes[k];
  return reply.bytes[0] != shape_.cf || sum != 0;
}

/// The first sample behind a start-up. Where turns are carried on over a restart, its position is the one nearest to the
/// last, give or take what the shaft turns from the end of the start-up on; the encoder's own count may be others.
bool Judge::find_origin(const Sample& sample, Time now) noexcept {
  const bool any_before = any_fresh_;
  const bool carries = carries_turns_ && any_before && !new_origin_;
  any_fresh_ = true;
  new_origin_ = false;
  origin_ = origin(sample.latch_time());
  if (!carries_turns_) return true;
  const std::int64_t off = sample.position() - encoder_->model().last_latch().counts;
  const std::int64_t turns = (off + turn_ / 2) >> std::countr_zero(static_cast<std::uint64_t>(turn_));
  // Behind a reset a start-up without a sample may have come already: its turns are what is carried on then.
  carried_ = any_before ? turns * turn_ : 0;
  carried_doubtful_ = turns_wrong_;
  const bool paused = clear_since_ > fresh_latch_;  // it has turned on meanwhile
  const std::int64_t step = std::abs(sample.position() - position_);
  constexpr std::int64_t kTenths = 6;
  return !carries || paused || step * 10 <= turn_ * kTenths ||
         fail(Rule::axis, now, step, turn_ * kTenths / 10, "the turns were not carried on");
}

/// A sensor that stands still looks like a shaft that has stopped. If it could have, between the first two such samples,
/// no host can know better; nor if it could not and the sample says that it made a step.
void Judge::on_frozen(const Sample& sample, Time before) noexcept {
  constexpr double kNoise = 8.0;  // counts, of all roundings
  ++frozen_samples_;
  turns_wrong_ = true;  // while it stood still the shaft may have made some
  if (frozen_samples_ == 1) {
    could_stand_ = false;
  } else if (frozen_samples_ == 2) {
    const auto dt = static_cast<double>((sample.latch_time() - before).count());
    const std::int64_t moved =
        encoder_->model().shaft_counts(sample.latch_time()) - encoder_->model().shaft_counts(before);
    // Where the latch is not known, nor is the speed; the half-width has what that makes.
    const double unknown = slow_ ? static_cast<double>(sample.half_width()) : 0.0;
    could_stand_ = static_cast<double>(std::abs(moved)) <= 2.0 * stopping_ * dt * dt + kNoise + unknown;
  }
  if (sample.discontinuities() != steps_before_) could_stand_ = true;
}

/// Turns of a reply that has no position. Wrong bits, and somebody else's reply, may put the shaft in the turn beside its own,
/// close to where the two meet; nothing may put it elsewhere.
bool Judge::on_turns(const Sample& sample, Time now) noexcept {
  const sim::FaultEffects& effects = *effects_;
  if (effects.frozen) return true;
  const auto off = static_cast<std::int16_t>(sample.turns() - encoder_->model().last_latch().abm);
  const int allowed = effects.bits_changed || slow_ ? 1 : 0;
  if (off <= allowed && -off <= allowed) return true;
  if (stepped_without_turns(sample) || told_wrong_turns())
    return true;  // the position's own turns are others
  return fail(Rule::turns, now, std::abs(int{off}), allowed);
}

/// The sample is not plainly the model's latch: how far is it from where the shaft was at its latch time?
bool Judge::on_position(const Sample& sample, Time now) noexcept {
  const sim::FaultEffects& effects = *effects_;
  const bool clean = !effects.bits_changed && !effects.frozen;
  // Without timestamps the sample's latch time is a bound: what it must be is what the model latched, within its own ±.
  const sim::Latch& latch = encoder_->model().last_latch();
  const bool by_latch = clean && slow_ && latched_at(latch, sample);
  if (carried_doubtful_ &&
      sample.discontinuities() != steps_at_startup_) {  // back from turns that start-up read wrong
    carried_doubtful_ = !clean || id_ != DataId::everything;
    const std::int64_t elsewhere = sample.position() - encoder_->model().shaft_counts(sample.latch_time());
    carried_ = (elsewhere + turn_ / 2) & -turn_;
  }
  const std::int64_t truth =
      (by_latch ? latch.counts : encoder_->model().shaft_counts(sample.latch_time())) + carried_;
  std::int64_t off = std::abs(sample.position() - truth);
  const std::int64_t exact = kQuantisation + uncertain_;
  // Until the next start-up; where some replies have turns, those that have none are as good as the last one that had.
  const bool has_turns = id_ == DataId::everything;
  // A zero reset whose end was lost in noise takes effect while the cycle is on again; from a step that the shaft can have made
  // nobody sees it.
  const bool late_zero = resets_ && !has_turns && origin(sample.latch_time()) != origin_;
  const bool turns_unknown = late_zero || stepped_without_turns(sample) || (told_wrong_turns() && !has_turns);
  if (has_turns) turns_wrong_ = off > turn_ / 2;
  if (off > turn_ / 2 && turns_unknown) {
    ++totals_.lost_turns;
    off = std::min(off % turn_, turn_ - off % turn_);
  }
  if (off > exact && effects.frozen && !effects.bits_changed) ++totals_.frozen_and_wrong;
  if (off > exact && effects.bits_changed) {
    ++totals_.wrong;
    if (off * kDangerousOfTurn > turn_) ++totals_.dangerous;
  }
  if (off > exact) stepped_ = true;
  count_wrong(off > exact, id_);
  const auto stated = static_cast<std::int64_t>(sample.half_width());
  const std::int64_t allowed = clean ? std::min(exact, stated) : stated;
  if (off <= allowed) return true;
  // The half-width counts undetected errors of three readings in a row. A line that makes the same bits of each frame wrong
  // looks like a shaft elsewhere.
  constexpr unsigned kInARow = 3;
  const unsigned turns_in_a_row = mixed_ ? kTellTurns : kInARow;
  const bool again = wrong_in_a_row_ >= kInARow || wrong_turns_in_a_row_ >= turns_in_a_row;
  const bool not_ours = may_be_somebody_elses(sample);
  const bool unknowable = (!clean && again) || (effects.frozen && could_stand_) || not_ours;
  if (!unknowable) return fail(Rule::position, now, off, allowed);
  ++totals_.beyond;
  could_stand_ = could_stand_ || !not_ours;  // and goes on to look so, even when the shaft passes by
  return true;
}

/// Where bytes come late, the reply to what somebody else has asked just before the request may be the first to come. It is where
/// the shaft was when that was asked.
bool Judge::may_be_somebody_elses(const Sample& sample) const noexcept {
  const Time from = sample.latch_time() - earlier_;
  if (!slow_ || effects_->talker_before < from) return false;
  constexpr std::int64_t kBent = 16;  // counts that a shaft can be beyond both, turning about in between
  const std::int64_t margin = static_cast<std::int64_t>(sample.half_width()) + kBent;
  const std::int64_t then = encoder_->model().shaft_counts(from) + carried_;
  const std::int64_t now = encoder_->model().shaft_counts(sample.latch_time()) + carried_;
  return sample.position() >= std::min(then, now) - margin &&
         sample.position() <= std::max(then, now) + margin;
}

void Judge::count_recovery(Time since) noexcept {
  const auto kind = static_cast<std::size_t>(through_startup_ ? Recovery::startup
                                             : stepped_       ? Recovery::step
                                                              : Recovery::plain);
  const std::int64_t hundredths = since * 100 / position_time_;
  totals_.longest_recovery[kind] = std::max(totals_.longest_recovery[kind], hundredths);
  const auto bin = static_cast<std::size_t>(std::max<std::int64_t>(0, (hundredths + 99) / 100));
  ++totals_.recovered[kind][std::min(bin, Totals::kRecoveryBins - 1)];
  if (through_startup_) totals_.longest_startup = std::max(totals_.longest_startup, since);
}

/// What a fault has changed on the way may be read as it came: eight bits of CRC let some of it pass, and make a request one
/// for another byte. What is said to have been written and read back is there all the same. Everything else, a restart with
/// another page selected too, the task must cope with.
bool Judge::on_eeprom(const EepromOutcome& outcome, Time now) noexcept {
  ++(outcome.wrote ? totals_.eeprom_writes : totals_.eeprom_reads);
  const bool good = outcome.result == Errc::ok;
  if (good && outcome.wrote && outcome.different != 0)
    return fail(Rule::eeprom, now, outcome.different, 0, "bytes were said to be written that are not there");
  if (effects_->last_change >= outcome.begun) return true;
  ++totals_.eeprom_judged;
  if (outcome.elsewhere != 0)
    return fail(Rule::eeprom, now, outcome.elsewhere, 0, "bytes have changed that nobody has written");
  if (good)
    return outcome.different == 0 ||
           fail(Rule::eeprom, now, outcome.different, 0, "bytes were read that the EEPROM does not hold");
  // Late replies leave less room than there is by the pattern.
  if (slow_ && outcome.result == Errc::no_gap) return true;
  return effects_->last >= outcome.begun ||
         fail(Rule::eeprom, now, 1, 0, "a task failed on a line without a fault");
}

bool Judge::at_end(const Statistics& statistics, Time now) noexcept {
  totals_.longest_loss_cycles = totals_.longest_loss * 100 / cycle_time_;
  totals_.startups = statistics.startups;
  totals_.restarts = encoder_->model().statistics().power_ups - 1;
  totals_.smallest_t1_margin = encoder_->model().t1().smallest_margin();
  const auto same = [&](std::uint64_t counted, std::uint64_t seen) {
    return counted == seen ||
           fail(Rule::statistics, now, static_cast<std::int64_t>(counted), static_cast<std::int64_t>(seen));
  };
  if (!same(statistics.cycles, totals_.cycles) || !same(statistics.good, totals_.good) ||
      !same(statistics.failed, totals_.failed) ||
      !same(statistics.good + statistics.failed, statistics.cycles))
    return false;
  // By cause: every record is counted, and besides it only start-up sequences that failed as a whole.
  std::uint64_t besides = 0;
  for (std::size_t k = 0; k < kErrcCount; ++k) {
    if (statistics.errors[k] < errors_[k]) return same(statistics.errors[k], errors_[k]);
    besides += statistics.errors[k] - errors_[k];
  }
  return besides <= statistics.startup_failures || same(besides, statistics.startup_failures);
}

}  // namespace tm485::cli::campaign
