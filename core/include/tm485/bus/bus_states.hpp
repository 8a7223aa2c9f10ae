// Bodies of Bus, third part: what the verdict of an exchange means for the state. Included by bus.hpp.
#pragma once

#include <algorithm>

#include "tm485/bus/bus.hpp"

namespace tm485 {

/// ok, or why the cycle has no sample.
template <Port P>
Errc Bus<P>::finish_cyclic(Time now) noexcept {
  saturating_increment(statistics_.cycles);
  if (exchange_.has_reply_delay()) statistics_.reply_delay.add(exchange_.reply_delay());
  if (exchange_.error() != Errc::ok) [[unlikely]]
    return exchange_.error();
  const DataId id = exchange_.id();
  const auto reply = Reply::parse(exchange_.reply(), id, *profile_);
  if (!reply) [[unlikely]] {
    settle(now);
    return reply.error();
  }
  const Time latch = latch_time();
  const Time overdue = latch + fresh_for_;
  const Time stale = overdue + config_.max_hold;
  // Held back for longer than a sample is good: by the port, or by an owner that did not call.
  if (now > stale) [[unlikely]]
    return Errc::timeout;
  // Failures as long as a restart, or nobody asked for so long: the encoder may have begun to count anew.
  if (was_silent(now)) return Errc::position_lost;
  if (layout(id).abs_at == 0 && scheduler_->reads_position()) return note(*reply, latch, now);
  Sample& sample = latest_.draft();
  const Errc error = tracker_.update(*reply, latch, latch_uncertainty(now), sample);
  if (error != Errc::ok) [[unlikely]]
    return error;
  held_for_ = Time{0};
  fresh_until_ = std::min(overdue, now + seen_fresh_for_);
  stale_at_ = std::min(stale, now + seen_valid_for_);
  const AlarmLevel alarm = sample.alarm();
  saturating_increment(statistics_.discontinuities, sample.discontinuities() - discontinuities_);
  discontinuities_ = sample.discontinuities();
  latest_.publish();
  announced_ = true;
  cycle_good(*reply, alarm, now);
  return Errc::ok;
}

/// A good reply without a position, in a pattern that reads positions in other slots: turns, ENID and status are
/// news, the position is the last one.
template <Port P>
[[gnu::noinline]] Errc Bus<P>::note(const Reply& reply, Time latch, Time now) noexcept {
  if (const Errc error = tracker_.note(reply, latch, latch_uncertainty(now)); error != Errc::ok) return error;
  const Sample held = tracker_.hold(now, valid_for());
  publish(held);
  cycle_good(reply, held.alarm(), now);
  return Errc::ok;
}

template <Port P>
void Bus<P>::cycle_good(const Reply& reply, AlarmLevel alarm, Time now) noexcept {
  failed_in_a_row_ = 0;
  last_good_ = last_heard_ = latch_time();
  saturating_increment(statistics_.good);
  const StatusSet status = reply.frame().status();
  const bool all = reply.frame().id() == DataId::everything;
  const StatusSet raised = alarms_.on_reply(status, all ? StatusSet(0xFF, 0xFF) : StatusSet(0xFF, 0));
  link_.on_good();
  if (!(status & profile_->profile().reserved_status).empty())
    saturating_increment(statistics_.reserved_status);
  if (alarm == AlarmLevel::warning) saturating_increment(statistics_.warnings);
  if (alarm == AlarmLevel::fault) saturating_increment(statistics_.faults);
  record(Errc::ok, now);
  if (!(raised & kSetAtPowerUp & ~profile_->profile().reserved_status).empty()) [[unlikely]]
    on_restart(now);
}

/// True if the encoder is given up. Not inlined, as note(): its sample would stand on the stack below every good cycle.
template <Port P>
[[gnu::noinline]] bool Bus<P>::cycle_failed(Errc cause, Time now) noexcept {
  saturating_increment(statistics_.failed);
  record(cause, now);
  link_.on_failed(record_.result);
  if (cause != Errc::position_implausible) tracker_.missed();
  const Sample held = tracker_.hold(now, valid_for());
  if (held.quality() == Quality::invalid && stale_at_ != kNever) {
    stale_at_ = kNever;
    saturating_increment(statistics_.invalidated);
  }
  publish(held);
  constexpr std::uint8_t kFewest = 3;
  if (failed_in_a_row_ < kFewest) ++failed_in_a_row_;
  const Time silent = now - last_good_;
  const bool lost = (failed_in_a_row_ == kFewest && silent >= config_.lost_after) ||
                    silent >= profile_->profile().boot_time_min;
  if (cause == Errc::encoder_restarted) saturating_increment(statistics_.restarts);
  return lost || cause == Errc::position_lost || cause == Errc::encoder_restarted;
}

template <Port P>
void Bus<P>::finish_startup(Time now) noexcept {
  Errc cause = exchange_.error();
  if (cause == Errc::ok) {
    const auto frame = Frame::parse(exchange_.reply(), exchange_.id());
    cause = frame ? Errc::ok : frame.error();
    if (frame) startup_.on_frame(*frame, latch_time(), latch_uncertainty(now), now);
  }
  record(cause, now);
  if (cause != Errc::ok) startup_.on_error(cause, now);
}

template <Port P>
void Bus<P>::after_startup_step(Time now) noexcept {
  if (const auto failure = startup_.take_failure()) {
    saturating_increment(statistics_.startup_failures);
    // A failed exchange has been counted by record(); what only the sequence can see has not.
    if (record_.result == Errc::ok || failure->stage == StartupStage::quiet)
      statistics_.count_error(failure->cause);
    begin_startup(now);
    startup_error_ = failure;
    return;
  }
  if (startup_.stage() != StartupStage::done) return;
  // The frames of the sequence have seeded the position; the first fresh sample comes with the first cycle.
  link_.on_found(statistics_.startups == 0);
  saturating_increment(statistics_.startups);
  startup_error_.reset();
  failed_in_a_row_ = 0;
  last_good_ = last_heard_ = latch_time();
  cyclic_start_.reset();
  state_ = BusState::running;
  tracker_.found(sample_gap(), scheduler_ && scheduler_->reads_turns());
  if (scheduler_) scheduler_->begin(std::max(now, spacing_.earliest()));
}

/// Sixteen bins where they tell most: around the period, and over the T2 window or the port's latency.
template <Port P>
void Bus<P>::shape_histograms() noexcept {
  constexpr std::uint8_t kFine = 8;  // 256 ns a bin
  const Time half = Time{std::int64_t{Histogram::kBins / 2} << kFine};
  if (scheduler_ && statistics_.t1.count() == 0)
    statistics_.t1 = TimeStatistic(scheduler_->period() - half, kFine);
  if (statistics_.reply_delay.count() != 0) return;
  std::uint8_t shift = kFine;
  if (!capability_.wire_timestamps) {
    while (shift < Histogram::kMostShift &&
           Time{std::int64_t{Histogram::kBins} << shift} < capability_.latency_allowance)
      ++shift;
  }
  statistics_.reply_delay =
      TimeStatistic(capability_.wire_timestamps ? profile_->profile().t2_min : Time{0}, shift);
}

/// Leaves the exchange under way and the offer, which is told.
template <Port P>
void Bus<P>::abandon() noexcept {
  if (in_flight()) {
    settling_ = true;  // its request may still be in the port
    sent_span_ = span_of(exchange_.request());
    if (!capability_.wire_timestamps)  // and may have left so much later than estimated
      spacing_.hold_off(exchange_.start() + capability_.latency_allowance +
                        profile_->t1(exchange_.request()));
  }
  const bool sent = in_flight() && kind_ == Kind::background;
  exchange_.abandon();
  arrived_ = false;
  tracker_.announce_hold(Time{0});
  held_for_ = Time{0};
  const auto under_way = sent ? std::optional(priority_of(exchange_.request())) : std::nullopt;
  background_.complete_all(Errc::bad_state, under_way, Errc::abandoned);
  stale_at_ = kNever;
}

template <Port P>
void Bus<P>::begin_startup(Time now) noexcept {
  abandon();
  hold_ = LineHold::none;
  if (scheduler_) scheduler_->pause();
  state_ = BusState::startup;
  link_.on_lost();
  alarms_.on_startup();
  publish(tracker_.forget());
  tracker_.search();  // a lost frame delays the next one of start-up by as long as it likes
  startup_.begin(now, capability_.latency_allowance);
}

template <Port P>
void Bus<P>::hold_line(Time until, LineHold hold) noexcept {
  if (state_ != BusState::running || hold == LineHold::none) return;
  hold_ = hold;
  hold_until_ = until;
}

template <Port P>
void Bus<P>::release_line(Time now) noexcept {
  if (hold_ == LineHold::none) return;
  hold_ = LineHold::none;
  if (scheduler_ && state_ == BusState::running)
    saturating_increment(statistics_.displaced, scheduler_->give_way(std::max(now, spacing_.earliest())));
}

template <Port P>
void Bus<P>::poll_quiet(Time now) noexcept {
  const Errc noise = settling_ && still_leaving(now) ? Errc::send_failed : check_quiet(now);
  if (noise == Errc::ok) return;
  startup_.on_noise(noise, now);
  after_startup_step(now);
}

template <Port P>
void Bus<P>::on_restart(Time now) noexcept {
  if (state_ == BusState::stopped) return;
  saturating_increment(statistics_.restarts);
  begin_startup(now);
}

template <Port P>
void Bus<P>::on_reset(const ResetOutcome& outcome, Time now) noexcept {
  alarms_.on_reset(outcome);
  if (outcome.kind == ResetKind::errors) return;
  // Zero and turns were moved under the tracker's feet.
  tracker_.drop_turns();
  on_restart(now);
}

template <Port P>
std::expected<void, Errc> Bus<P>::offer(const Request& request, std::uint32_t ticket) noexcept {
  if (state_ != BusState::running) return std::unexpected(Errc::bad_state);
  const bool in_cycle =
      scheduler_ && priority_of(request) != Priority::reset_run && hold_ != LineHold::no_cycle;
  if (in_cycle && !scheduler_->has_gap_for(span_of(request)) && !may_take_slots(request))
    return std::unexpected(Errc::no_gap);
  const std::uint32_t every = config_.steal_every;
  const std::uint32_t patience =
      std::max({std::uint32_t{BackgroundQueue::kMostSlots}, 4 * every, to_steal_ + 2 * every});
  patience_ = background_.empty() ? patience : std::max(patience_, patience);
  const auto offered = background_.offer(request, ticket);
  if (offered && in_cycle && will_hold(request) && !scheduler_->has_gap_for(span_of(request))) {
    tracker_.announce_hold(span_of(request));
    announced_ = false;
  }
  return offered;
}

/// May a request that fits into no gap have slots of the cycle? Only if neither the sample becomes invalid meanwhile nor
/// the shaft can turn so far that its position is lost.
template <Port P>
bool Bus<P>::may_take_slots(const Request& request) const noexcept {
  const bool may_hold = will_hold(request);
  if (!may_hold && config_.steal_every == 0) return false;
  const Time span = span_of(request);
  if (!may_hold && sample_gap() + span > config_.max_hold) return false;
  const Time unknown = profile_->profile().latch_uncertainty * 2 + capability_.jitter_margin * 2;
  const Time alone = scheduler_->unwrap_gap();
  return alone == Time{0} || 2 * alone + span + unknown < tracker_.unwrap_limit();
}

template <Port P>
void Bus<P>::finish_background(Time now) noexcept {
  saturating_increment(statistics_.background);
  std::expected<Reply, Errc> result = std::unexpected(exchange_.error());
  if (exchange_.error() == Errc::ok) result = Reply::parse(exchange_.reply(), exchange_.id(), *profile_);
  std::optional<Reply> heard;
  if (result) {
    heard = *result;
    if (!was_silent(latch_time())) last_heard_ = latch_time();  // the next cycle begins anew otherwise
    const Frame& frame = result->frame();
    const bool eeprom = frame.fields().adf_at != 0;
    if (eeprom && frame.address() != exchange_.request().address()) {
      result = std::unexpected(Errc::eeprom_address_mismatch);
    } else if (frame.id() == DataId::eeprom_read && frame.eeprom_busy()) {
      result = std::unexpected(Errc::eeprom_busy);
    }
  }
  record(result ? Errc::ok : result.error(), now);
  background_.complete(priority_of(exchange_.request()), result, heard);
}

}  // namespace tm485
