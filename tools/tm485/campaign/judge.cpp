#include "campaign/judge.hpp"

namespace tm485::cli::campaign {

void Totals::add(const Totals& other) noexcept {
  runs += other.runs;
  cycles += other.cycles;
  good += other.good;
  failed += other.failed;
  startups += other.startups;
  restarts += other.restarts;
  touched += other.touched;
  changed += other.changed;
  changed_and_fresh += other.changed_and_fresh;
  wrong += other.wrong;
  dangerous += other.dangerous;
  frozen_and_wrong += other.frozen_and_wrong;
  beyond += other.beyond;
  lost_turns += other.lost_turns;
  eeprom_reads += other.eeprom_reads;
  eeprom_judged += other.eeprom_judged;
  longest_loss = std::max(longest_loss, other.longest_loss);
  longest_recovery = std::max(longest_recovery, other.longest_recovery);
  longest_step = std::max(longest_step, other.longest_step);
  longest_startup = std::max(longest_startup, other.longest_startup);
  smallest_t1_margin = std::min(smallest_t1_margin, other.smallest_t1_margin);
}

/// By the bytes that the line carried, as the specification says (section 3): the XOR of a whole frame is 0. What comes
/// behind a whole frame does not make it a broken one: a host that took it before cannot know.
bool Judge::frame_is_broken() const noexcept {
  // What the receiver makes of a distorted burst, or of one that met another driver, is not known here.
  if (encoder_->faults().effects().mixed) return false;
  const sim::Burst& reply = encoder_->faults().last_reply();
  if (reply.count < reply_length_) return true;
  unsigned sum = 0;
  for (unsigned k = 0; k < reply_length_; ++k) sum ^= reply.bytes[k];
  return reply.bytes[0] != cf_ || sum != 0;
}

/// A sensor that stands still looks like a shaft that has stopped. If it could have, between the first two such samples,
/// no host can know better; nor if it could not and the sample says that it made a step.
void Judge::on_frozen(const Sample& sample, Time before) noexcept {
  constexpr double kNoise = 8.0;  // counts, of all roundings
  ++frozen_samples_;
  if (frozen_samples_ == 1) {
    could_stand_ = false;
  } else if (frozen_samples_ == 2) {
    const auto dt = static_cast<double>((sample.latch_time() - before).count());
    const std::int64_t moved =
        encoder_->model().shaft_counts(sample.latch_time()) - encoder_->model().shaft_counts(before);
    could_stand_ = static_cast<double>(std::abs(moved)) <= 2.0 * stopping_ * dt * dt + kNoise;
  }
  if (discontinuities_of(sample) != steps_before_) could_stand_ = true;
}

/// The sample is not plainly the model's latch: how far is it from where the shaft was at its latch time?
bool Judge::on_position(const Sample& sample, const sim::FaultEffects& effects, Time now) noexcept {
  const std::int64_t truth = encoder_->model().shaft_counts(sample.latch_time());
  std::int64_t off = std::abs(sample.position() - truth);
  const bool clean = !effects.bits_changed && !effects.frozen;
  const std::int64_t exact = kQuantisation + uncertain_;
  const bool turns_unknown =
      reply_length_ != 11 &&
      (kStatesHalfWidth<Sample> ? discontinuities_of(sample) != steps_at_startup_ : lost_track_);
  if (off > turn_ / 2 && turns_unknown) {  // until the next start-up
    ++totals_.lost_turns;
    off = std::min(off % turn_, turn_ - off % turn_);
  }
  if (off > exact && effects.frozen && !effects.bits_changed) ++totals_.frozen_and_wrong;
  if (off > exact && effects.bits_changed) {
    ++totals_.wrong;
    if (off * kDangerousOfTurn > turn_) ++totals_.dangerous;
  }
  if (off > exact) stepped_ = true;
  constexpr std::int64_t kPartOfTurn = 4;
  if (off > turn_ / kPartOfTurn) lost_track_ = true;
  wrong_in_a_row_ = off > exact ? wrong_in_a_row_ + 1 : 0;
  const auto allowed = clean ? std::optional(exact) : stated_half_width(sample);
  if (!allowed || off <= *allowed) return true;
  // The half-width counts undetected errors of three readings in a row. A line that makes the same bits of each frame wrong
  // looks like a shaft elsewhere.
  constexpr unsigned kInARow = 3;
  const bool unknowable = (!clean && wrong_in_a_row_ >= kInARow) || (effects.frozen && could_stand_);
  if (!unknowable) return fail(Rule::position, now, off, *allowed);
  ++totals_.beyond;
  could_stand_ = true;  // and goes on to look so, even when the shaft passes by
  return true;
}

/// What a fault has changed on the way may be read as it came: eight bits of CRC let some of it pass. Everything else, a
/// restart with another page selected too, the task must cope with.
bool Judge::on_eeprom(const EepromOutcome& outcome, Time now) noexcept {
  const sim::FaultEffects& effects = encoder_->faults().effects();
  ++totals_.eeprom_reads;
  if (effects.last_change >= outcome.begun) return true;
  ++totals_.eeprom_judged;
  if (outcome.result == Errc::ok)
    return outcome.different == 0 || fail(Rule::eeprom, now, outcome.different, 0);
  return effects.last >= outcome.begun || fail(Rule::eeprom, now, -1, 0);
}

bool Judge::at_end(const Statistics& statistics, Time now) noexcept {
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
