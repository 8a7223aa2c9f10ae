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
  lost_turns += other.lost_turns;
  longest_loss = std::max(longest_loss, other.longest_loss);
  longest_recovery = std::max(longest_recovery, other.longest_recovery);
  longest_step = std::max(longest_step, other.longest_step);
  longest_startup = std::max(longest_startup, other.longest_startup);
  smallest_t1_margin = std::min(smallest_t1_margin, other.smallest_t1_margin);
}

/// By the bytes that the line carried, as the specification says (section 3): the XOR of a whole frame is 0.
bool Judge::frame_is_broken() const noexcept {
  // What the receiver makes of a distorted burst, or of one that met another driver, is not known here.
  if (encoder_->faults().effects().mixed) return false;
  const sim::Burst& reply = encoder_->faults().last_reply();
  unsigned sum = 0;
  for (unsigned k = 0; k < reply.count; ++k) sum ^= reply.bytes[k];
  return reply.count != reply_length_ || reply.bytes[0] != cf_ || sum != 0;
}

/// The sample is not plainly the model's latch: how far is it from where the shaft was at its latch time?
bool Judge::on_position(const Sample& sample, const sim::FaultEffects& effects, Time now) noexcept {
  const std::int64_t truth = encoder_->model().shaft_counts(sample.latch_time());
  const std::int64_t off = std::abs(sample.position() - truth);
  const bool clean = !effects.bits_changed && !effects.frozen;
  const std::int64_t exact = kQuantisation + uncertain_;
  if (off > exact && effects.frozen && !effects.bits_changed) ++totals_.frozen_and_wrong;
  if (off > exact && effects.bits_changed) {
    ++totals_.wrong;
    if (off * kDangerousOfTurn > turn_) ++totals_.dangerous;
  }
  if (off > exact) stepped_ = true;
  if (clean && off > exact && was_frozen_ && !kStatesHalfWidth<Sample>) {
    // Nothing in this stack can see it, so it is no news: counted, and gone with the next start-up.
    const std::int64_t rest = off % turn_;
    if (std::min(rest, turn_ - rest) <= exact) {
      ++totals_.lost_turns;
      return true;
    }
  }
  const auto allowed = clean ? std::optional(exact) : stated_half_width(sample);
  return !allowed || off <= *allowed || fail(Rule::position, now, off, *allowed);
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
