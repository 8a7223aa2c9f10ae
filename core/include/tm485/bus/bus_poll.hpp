// Bodies of Bus. Included by bus.hpp.
#pragma once

#include <algorithm>
#include <array>

#include "tm485/bus/bus.hpp"

namespace tm485 {

template <Port P>
std::expected<void, CycleRefusal> Bus<P>::start(Time now) noexcept {
  if (!config_.axis.valid()) return std::unexpected(CycleRefusal{Errc::bad_argument});
  if (config_.cycle) {
    const auto scheduler = Scheduler::make(*config_.cycle, *profile_, capability_);
    if (!scheduler) return std::unexpected(scheduler.error());
    const bool by_turns = profile_->profile().multi_turn_bits != 0 && config_.cycle->id == DataId::everything;
    const bool unwraps = layout(config_.cycle->id).abs_at != 0 && !by_turns;
    if (unwraps && scheduler->period() >= tracker_.unwrap_limit())
      return std::unexpected(CycleRefusal{Errc::position_lost, tracker_.unwrap_limit() - Time{1}});
    scheduler_ = *scheduler;
    cyclic_request_ = *Request::make(config_.cycle->id);
  }
  shape_histograms();
  begin_startup(now);
  return {};
}

template <Port P>
void Bus<P>::stop() noexcept {
  abandon();
  state_ = BusState::stopped;
  publish(tracker_.forget());
}

template <Port P>
Time Bus<P>::poll(Time now) noexcept {
  if (now >= stale_at_) [[unlikely]]
    go_stale(now);
  if (in_flight()) {
    receive(now);
    if (in_flight()) return wake_up(exchange_.deadline() + Time{1});
    finish(now);
  }
  if (state_ == BusState::stopped) return kNever;
  if (settling_) [[unlikely]]
    (void)check_quiet(now);  // what comes late is counted and dropped
  if (state_ == BusState::startup && startup_.stage() == StartupStage::quiet) poll_quiet(now);
  const Time due = next_due(now);
  if (now < due) return wake_up(due);
  begin_due(now);
  return wake_up(in_flight() ? exchange_.deadline() + Time{1} : next_due(now));
}

/// The sample that is published is too old, and the cycle that should replace it is not over.
template <Port P>
void Bus<P>::go_stale(Time now) noexcept {
  stale_at_ = kNever;
  saturating_increment(statistics_.invalidated);
  publish(tracker_.hold(now, Time{-1}));
}

template <Port P>
Time Bus<P>::next_due(Time now) const noexcept {
  const Time earliest = spacing_.earliest();
  if (state_ == BusState::startup) {
    return std::max(startup_.due(), earliest);
  }
  if (offered_ && background_fits(std::max(now, earliest))) return earliest;
  return scheduler_ ? std::max(scheduler_->slot(), earliest) : kNever;
}

/// Admission: a background exchange must be over, with its T1, before the next cyclic slot.
template <Port P>
bool Bus<P>::background_fits(Time start) const noexcept {
  if (!scheduler_) return true;
  const Request& request = *offered_;
  return start + std::max(profile_->t1(request), profile_->exchange_max(request.id())) <= scheduler_->slot();
}

template <Port P>
void Bus<P>::begin_due(Time now) noexcept {
  if (state_ == BusState::startup) {
    if (startup_.stage() == StartupStage::quiet) {
      startup_.on_quiet_time(now);
    } else {
      send(*Request::make(startup_.next_id()), Kind::startup, now);
    }
    return;
  }
  if (offered_ && background_fits(now)) return send(*offered_, Kind::background, now);
  if (!scheduler_ || now < scheduler_->slot()) return;
  constexpr std::uint8_t kMostSlots = 64;
  if (offered_ && ++passed_over_ >= kMostSlots) complete_offer(std::unexpected(Errc::no_gap));
  send(cyclic_request_, Kind::cyclic, now);
}

template <Port P>
void Bus<P>::send(const Request& request, Kind kind, Time now) noexcept {
  kind_ = kind;
  if (kind == Kind::cyclic) slot_ = scheduler_->slot();
  const Errc obstacle = check_line(now);
  const std::expected<Time, Errc> start = obstacle == Errc::ok
                                              ? port_->try_send(request.bytes(), now)
                                              : std::expected<Time, Errc>(std::unexpected(obstacle));
  exchange_.begin(request, start.value_or(now), *profile_, capability_);
  if (!start) [[unlikely]] {
    // Nothing went out; still keep the distance, so that a broken port is not asked in a tight loop.
    spacing_.on_start(now, profile_->t1(request));
    if (kind == Kind::cyclic) scheduler_->on_unused(now, statistics_);
    cyclic_start_.reset();
    exchange_.on_fault(start.error());
    finish(now);
    return;
  }
  settling_ = false;
  spacing_.on_start(*start, profile_->t1(request));
  if (kind != Kind::cyclic) return;
  scheduler_->on_start(*start, statistics_);
  if (cyclic_start_) statistics_.t1.add(*start - *cyclic_start_);
  cyclic_start_ = *start;
}

/// What keeps a request from being sent: noise, a vanished port, or the last request still on its way.
template <Port P>
Errc Bus<P>::check_line(Time now) noexcept {
  if (settling_ && port_->transmission(now).state == Transmission::State::sending) return Errc::send_failed;
  return check_quiet(now);
}

/// ok, port_gone, or line_not_quiet: nobody speaks while no exchange is under way.
template <Port P>
Errc Bus<P>::check_quiet(Time now) noexcept {
  std::array<std::uint8_t, 16> scratch;  // not initialised: only counted
  Errc cause = Errc::ok;
  constexpr int kPasses = 256;  // empties what a kernel may have buffered, and no more
  for (int pass = 0; pass < kPasses; ++pass) {
    const Reception reception = port_->try_receive(scratch, now);
    if (reception.count == 0 && reception.fault == Errc::ok) [[likely]]
      break;
    saturating_increment(statistics_.stray_bytes, static_cast<std::uint32_t>(reception.count));
    if (reception.fault == Errc::port_gone) return Errc::port_gone;
    cause = Errc::line_not_quiet;
  }
  return cause;
}

template <Port P>
void Bus<P>::receive(Time now) noexcept {
  // Bounded: echo and reply together have at most kMaxRequest + kMaxReply + 1 bytes, and each pass takes one or more.
  for (std::size_t pass = 0; pass <= kMaxRequest + kMaxReply; ++pass) {
    const Reception reception = port_->try_receive(exchange_.room(), now);
    exchange_.on_received(reception, now);
    if (exchange_.state() == Exchange::State::done) return;
    if (reception.count == 0) break;
  }
  if (now <= exchange_.deadline()) [[likely]]
    return;
  if (const Errc cause = silence_cause(now); cause != Errc::ok) return exchange_.on_fault(cause);
  exchange_.on_time(now);
}

/// Past the deadline: was the request sent at all?
template <Port P>
Errc Bus<P>::silence_cause(Time now) noexcept {
  const Transmission transmission = port_->transmission(now);
  if (transmission.state == Transmission::State::failed)
    return transmission.fault == Errc::ok ? Errc::send_failed : transmission.fault;
  return transmission.state == Transmission::State::sending ? Errc::send_failed : Errc::ok;
}

/// The exchange failed on the line. A port that may still hold bytes of it, or the request itself, gets time
/// to hand them out before anything else is asked: a late reply must not answer the next request.
template <Port P>
void Bus<P>::settle(Time now) noexcept {
  settling_ = true;
  if (capability_.wire_timestamps) return;
  spacing_.hold_off(now + capability_.latency_allowance);
}

/// Latest minus earliest instant at which the encoder can have latched. With wire timestamps the profile's;
/// without, the start is the earliest possible and the arrival of the reply bounds it from above.
template <Port P>
Time Bus<P>::latch_uncertainty(Time seen) const noexcept {
  const Time known = profile_->profile().latch_uncertainty;
  if (capability_.wire_timestamps) return known;
  const Time late = seen - exchange_.start() - profile_->exchange_min(exchange_.id());
  return known + std::clamp(late, Time{0}, Time{std::chrono::seconds(1)});
}

template <Port P>
void Bus<P>::finish(Time now) noexcept {
  if (!capability_.wire_timestamps) {
    // Without a byte of a reply, all that is known is that the request has left.
    const DataId id = exchange_.id();
    const Time shortest = exchange_.has_reply_delay() ? profile_->exchange_min(id, exchange_.reply().size())
                                                      : profile_->request_time(id);
    spacing_.on_reply_seen(now, shortest, profile_->t1(exchange_.request()));
  }
  if (exchange_.error() != Errc::ok) [[unlikely]]
    settle(now);
  switch (kind_) {
    case Kind::cyclic:
      return finish_cyclic(now);
    case Kind::startup:
      return finish_startup(now);
    case Kind::background:
      break;
  }
  finish_background(now);
}

template <Port P>
void Bus<P>::finish_cyclic(Time now) noexcept {
  saturating_increment(statistics_.cycles);
  if (exchange_.has_reply_delay()) statistics_.reply_delay.add(exchange_.reply_delay());
  if (exchange_.error() != Errc::ok) return cycle_failed(exchange_.error(), now);
  const auto reply = Reply::parse(exchange_.reply(), exchange_.id(), *profile_);
  if (!reply) {
    settle(now);
    return cycle_failed(reply.error(), now);
  }
  // Failures as long as a restart: the encoder may have begun to count anew.
  if (failed_in_a_row_ != 0 && now - last_good_ >= profile_->profile().boot_time_min) return give_up(now);
  Sample& sample = latest_.draft();
  const Errc error = tracker_.update(*reply, latch_time(), latch_uncertainty(now), sample);
  if (error != Errc::ok) return cycle_failed(error, now);
  failed_in_a_row_ = 0;
  last_good_ = now;
  stale_at_ = now + valid_for();
  saturating_increment(statistics_.good);
  if (!(reply->frame().status() & profile_->profile().reserved_status).empty())
    saturating_increment(statistics_.reserved_status);
  if (sample.alarm() == AlarmLevel::warning) saturating_increment(statistics_.warnings);
  if (sample.alarm() == AlarmLevel::fault) saturating_increment(statistics_.faults);
  latest_.publish();
  record(Errc::ok, now);
}

template <Port P>
void Bus<P>::cycle_failed(Errc cause, Time now) noexcept {
  saturating_increment(statistics_.failed);
  record(cause, now);
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
  if (lost || cause == Errc::position_lost) give_up(now);
}

template <Port P>
void Bus<P>::give_up(Time now) noexcept {
  saturating_increment(statistics_.lost);
  begin_startup(now);
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
  after_startup_step(now);
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
  // The last frame of the sequence is the first of the position; the first fresh sample comes with the first cycle.
  if (const auto reply = Reply::parse(exchange_.reply(), exchange_.id(), *profile_))
    (void)tracker_.seed(*reply, latch_time(), latch_uncertainty(now));
  saturating_increment(statistics_.startups);
  startup_error_.reset();
  failed_in_a_row_ = 0;
  last_good_ = now;
  cyclic_start_.reset();
  state_ = BusState::running;
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
    while (Time{std::int64_t{Histogram::kBins} << shift} < capability_.latency_allowance) ++shift;
  }
  statistics_.reply_delay =
      TimeStatistic(capability_.wire_timestamps ? profile_->profile().t2_min : Time{0}, shift);
}

/// Leaves the exchange under way and the offer, which is told.
template <Port P>
void Bus<P>::abandon() noexcept {
  const bool sent = in_flight() && kind_ == Kind::background;
  exchange_.abandon();
  if (offered_) complete_offer(std::unexpected(sent ? Errc::abandoned : Errc::bad_state));
  stale_at_ = kNever;
}

template <Port P>
void Bus<P>::begin_startup(Time now) noexcept {
  abandon();
  state_ = BusState::startup;
  publish(tracker_.forget());
  startup_.begin(now, capability_.latency_allowance);
}

template <Port P>
void Bus<P>::poll_quiet(Time now) noexcept {
  const Errc noise = check_quiet(now);
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
std::expected<void, Errc> Bus<P>::offer(const Request& request) noexcept {
  if (state_ != BusState::running) return std::unexpected(Errc::bad_state);
  if (offered_ || completion_) return std::unexpected(Errc::busy);
  const Time span = std::max(profile_->t1(request), profile_->exchange_max(request.id()));
  if (scheduler_ && !scheduler_->has_gap_for(span)) return std::unexpected(Errc::no_gap);
  offered_ = request;
  passed_over_ = 0;
  return {};
}

template <Port P>
void Bus<P>::finish_background(Time now) noexcept {
  saturating_increment(statistics_.background);
  std::expected<Reply, Errc> result = std::unexpected(exchange_.error());
  if (exchange_.error() == Errc::ok) result = Reply::parse(exchange_.reply(), exchange_.id(), *profile_);
  if (result) {
    const Frame& frame = result->frame();
    const bool eeprom = frame.fields().adf_at != 0;
    if (eeprom && frame.address() != exchange_.request().address()) {
      result = std::unexpected(Errc::eeprom_address_mismatch);
    } else if (frame.id() == DataId::eeprom_read && frame.eeprom_busy()) {
      result = std::unexpected(Errc::eeprom_busy);
    }
  }
  record(result ? Errc::ok : result.error(), now);
  complete_offer(result);
}

template <Port P>
void Bus<P>::complete_offer(const std::expected<Reply, Errc>& result) noexcept {
  completion_.emplace(*offered_, result);
  offered_.reset();
}

template <Port P>
void Bus<P>::record(Errc result, Time now) noexcept {
  if (result != Errc::ok) [[unlikely]]
    statistics_.count_error(result);
  record_.kind = kind_;
  record_.id = exchange_.id();
  record_.result = result;
  record_.slot = kind_ == Kind::cyclic ? slot_ : exchange_.start();
  record_.start = exchange_.start();
  record_.seen = now;
  record_.reply_delay = exchange_.reply_delay();
  record_.has_reply_delay = exchange_.has_reply_delay();
  ++record_count_;
}

}  // namespace tm485
