// What happens to the encoder by itself: its supply, and an ID8 that takes effect.
#include <algorithm>

#include "tm485/sim/encoder_model.hpp"

namespace tm485::sim {

bool EncoderModel::add_power_change(Time instant, bool on) noexcept {
  if (power_change_count_ == kPowerChanges) return false;
  power_changes_[power_change_count_++] = {.at = instant, .on = on};
  schedule_changes();
  return true;
}

void EncoderModel::schedule_changes() noexcept {
  next_change_ = std::min(zero_at_, power_ == Power::booting ? boot_done_ : kNever);
  if (power_change_count_ != 0) next_change_ = std::min(next_change_, power_changes_[0].at);
}

/// What happened by itself up to `now`, in the order of time.
void EncoderModel::apply_changes(Time now) noexcept {
  while (next_change_ <= now) {
    if (power_change_count_ != 0 && power_changes_[0].at == next_change_) {
      const PowerChange change = power_changes_[0];
      std::shift_left(power_changes_.begin(), power_changes_.end(), 1);
      --power_change_count_;
      if (!change.on) {
        if (power_ != Power::off) eeprom_.on_power_off(change.at);
        power_ = Power::off;
        zero_at_ = kNever;
      } else if (power_ == Power::off) {
        power_up(change.at);
      }
    } else if (zero_at_ == next_change_) {
      zero_offset_ += zero_counts_;
      zero_at_ = kNever;
    } else {
      power_ = Power::on;
    }
    schedule_changes();
  }
}

void EncoderModel::power_up(Time at) noexcept {
  boot_done_ = at + config_.boot_time;
  power_ = config_.boot_time > Time{0} ? Power::booting : Power::on;
  ++statistics_.power_ups;
  if (!config_.battery) {
    const std::int64_t shaft = motion_.counts(at, config_.single_turn_bits) - zero_offset_;
    turn_base_ = config_.start_turn - (shaft >> config_.single_turn_bits);
  }
  phase_ = Phase::ignoring;
  last_end_ = -kNever;
  deaf_until_ = -kNever;
  reset_count_ = 0;
  request_flags_ = 0;
  clear_alarms();
  eeprom_.on_power_up();
  t1_.disarm();
}

/// Drops the characters of `reply` that the supply does not live to finish.
void EncoderModel::cut_by_power_off(Burst& reply) noexcept {
  for (std::size_t k = 0; k < power_change_count_; ++k) {
    const PowerChange& change = power_changes_[k];
    if (change.on || change.at >= reply.driver_off) continue;
    reply.driver_off = change.at;
    while (reply.count != 0 && reply.start + character_time_ * reply.count > change.at) --reply.count;
    return;
  }
}

}  // namespace tm485::sim
