// Bodies of Bus, first part: what is due, and the request. Included by bus.hpp.
#pragma once

#include <algorithm>
#include <array>

#include "tm485/bus/bus.hpp"

namespace tm485 {

template <Port P>
std::expected<Scheduler, CycleRefusal> Bus<P>::make_scheduler() const noexcept {
  const auto scheduler = Scheduler::make(*config_.cycle, config_.phase, *profile_, capability_);
  if (!scheduler) return scheduler;
  // The gap between two positions is longer than in the pattern by what is not known of their instants.
  const Time longest = tracker_.unwrap_limit() - profile_->profile().latch_uncertainty * 2 -
                       capability_.jitter_margin - Time{1};
  if (scheduler->unwrap_gap() == Time{0} || scheduler->unwrap_gap() <= longest) return scheduler;
  const Time nearest = longest / (scheduler->unwrap_gap() / scheduler->pattern().slot());
  Pattern fastest = *config_.cycle;
  fastest.set_slot(Time{0});
  const auto shortest = Scheduler::make(fastest, *profile_, capability_);
  const bool possible = shortest && shortest->feasibility().slot <= nearest;
  return std::unexpected(CycleRefusal{Errc::position_lost, possible ? nearest : Time{0}});
}

template <Port P>
std::expected<Feasibility, CycleRefusal> Bus<P>::check() const noexcept {
  if (!config_.valid() || !capability_.valid()) return std::unexpected(CycleRefusal{Errc::bad_argument});
  if (!config_.cycle) return Feasibility{};
  const auto scheduler = make_scheduler();
  if (!scheduler) return std::unexpected(scheduler.error());
  return scheduler->feasibility();
}

template <Port P>
std::expected<void, CycleRefusal> Bus<P>::start(Time now) noexcept {
  if (!config_.valid() || !capability_.valid()) return std::unexpected(CycleRefusal{Errc::bad_argument});
  if (config_.cycle) {
    const auto scheduler = make_scheduler();
    if (!scheduler) return std::unexpected(scheduler.error());
    scheduler_ = *scheduler;
    const Time ready = scheduler_->feasibility().ready;
    const Time t2_window = profile_->profile().t2_max - profile_->profile().t2_min;
    const Time gap = scheduler_->sample_gap();
    fresh_for_ = gap + ready + capability_.jitter_margin + capability_.latency_allowance;
    seen_fresh_for_ = gap + capability_.jitter_margin + t2_window;
    seen_valid_for_ = gap + config_.max_hold;
    silence_ = longest_silence();
  }
  shape_histograms();
  begin_startup(now);
  return {};
}

/// That does not mean a restart, though no cycle failed. One slot may be missed, a write may hold the bus, and a pattern in phase
/// may begin a pattern later.
template <Port P>
Time Bus<P>::longest_silence() const noexcept {
  const Profile& p = profile_->profile();
  const Time step = scheduler_->longest_step();
  const bool holds = config_.eeprom_may_hold && p.eeprom_holds_bus;
  const Time held = holds ? std::max(p.eeprom_write_time, p.eeprom_page_time) : Time{0};
  const Time wait = config_.phase.kind == Phase::Kind::any ? Time{0} : scheduler_->length();
  return std::max(p.boot_time_min, 2 * step + std::max(held, wait));
}

template <Port P>
void Bus<P>::stop() noexcept {
  abandon();
  state_ = BusState::stopped;
  publish(tracker_.forget());
}

template <Port P>
Time Bus<P>::poll(Time now) noexcept {
  // One sample is published in a call at most, so that nobody who looks after each call misses one.
  if (now >= stale_at_) [[unlikely]] {
    go_stale(now);
    return now;
  }
  bool verdict = false;
  if (in_flight()) {
    if (!arrived_) {
      receive(now);
      if (in_flight()) return wake_up(exchange_.deadline() + Time{1});
      // The owner may have read its clock long before the port was asked. Where the port does not say when the bytes
      // came, the next call's `now` is the first instant that is known to be later.
      arrived_ = !capability_.wire_timestamps;
      if (arrived_) return now;
    }
    arrived_ = false;
    finish(now);
    verdict = true;
  }
  if (state_ != BusState::running || settling_) [[unlikely]] {
    if (state_ == BusState::stopped) return kNever;
    if (settling_) (void)check_quiet(now);  // what comes late is counted and dropped
    if (state_ == BusState::startup && startup_.stage() == StartupStage::quiet) poll_quiet(now);
  }
  const Time due = next_due(now);
  if (now < due) return wake_up(due);
  if (verdict) return now;
  begin_due(now);
  if (unsent_) [[unlikely]]
    finish(now);
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
  const bool only_cycle = background_.empty() && hold_ == LineHold::none;
  if (state_ == BusState::running && only_cycle) [[likely]]
    return scheduler_ ? std::max(scheduler_->slot(), earliest) : kNever;
  if (state_ == BusState::startup) return std::max(startup_.due(), earliest);
  if (candidate(std::max(now, earliest)) != nullptr) return earliest;
  if (hold_ != LineHold::none) return std::max(hold_until_, earliest);
  return scheduler_ ? std::max(scheduler_->slot(), earliest) : kNever;
}

/// The background request that may go out at `start`, ahead of the cycle or in its free time.
template <Port P>
const Request* Bus<P>::candidate(Time start) const noexcept {
  if (background_.empty()) [[likely]]
    return nullptr;
  const Request* const waiting = background_.next();
  // A run of resets goes first, but not one run after the other for ever.
  const bool unlimited = !scheduler_ || hold_ != LineHold::none;
  if (background_.has_reset() && (unlimited || resets_in_a_row_ < profile_->profile().reset_count))
    return waiting;
  if (hold_ != LineHold::none) return hold_ == LineHold::no_cycle ? waiting : nullptr;
  return fits(*waiting, start) ? waiting : nullptr;
}

/// True for a write during which this profile's encoder wants the line to itself.
template <Port P>
bool Bus<P>::holds_bus(const Request& request) const noexcept {
  return request.id() == DataId::eeprom_write && profile_->profile().eeprom_holds_bus;
}

/// From the start of a background exchange until the line is free again.
template <Port P>
Time Bus<P>::span_of(const Request& request) const noexcept {
  return std::max(profile_->t1(request), profile_->exchange_max(request.id()));
}

/// Admission: a background exchange must be over, with its T1, before the next cyclic slot.
template <Port P>
bool Bus<P>::fits(const Request& request, Time start) const noexcept {
  return !scheduler_ || start + capability_.jitter_margin + span_of(request) <= scheduler_->slot();
}

/// True if a request that fits into no gap, or has not for long, may have the slot that is due.
template <Port P>
bool Bus<P>::may_steal(const Request& request, Time now) const noexcept {
  if (will_hold(request)) return announced_;
  const Time span = span_of(request);
  if (config_.steal_every == 0 || to_steal_ != 0 || !scheduler_->may_give_way(now + span)) return false;
  if (!scheduler_->has_gap_for(span)) return true;
  // Where replies are seen late, a gap can be shorter than it is by the pattern.
  return background_.waited(priority_of(request)) >= BackgroundQueue::kAged && may_take_slots(request);
}

template <Port P>
void Bus<P>::begin_due(Time now) noexcept {
  if (state_ == BusState::startup) {
    if (startup_.stage() == StartupStage::quiet) {
      startup_.on_quiet_time(now);
    } else {
      (void)send(*Request::make(startup_.next_id()), Kind::startup, now);
    }
    return;
  }
  if (!background_.empty() || hold_ != LineHold::none) [[unlikely]] {
    if (begin_before_cycle(now)) return;
  }
  if (!scheduler_ || now < scheduler_->slot()) return;
  if (to_steal_ != 0) --to_steal_;
  resets_in_a_row_ = 0;
  if (cyclic_request_.id() != scheduler_->id()) cyclic_request_ = *Request::make(scheduler_->id());
  (void)send(cyclic_request_, Kind::cyclic, now);
}

/// What goes before the cycle, or keeps it from the line. False: nothing does, at this slot.
template <Port P>
bool Bus<P>::begin_before_cycle(Time now) noexcept {
  if (hold_ != LineHold::none && now >= hold_until_) release_line(now);
  if (const Request* const first = candidate(now)) {
    begin_background(*first, now);
    return true;
  }
  if (!scheduler_ || hold_ != LineHold::none || now < scheduler_->slot()) return true;
  if (background_.empty()) return false;
  const Request& waiting = *background_.next();
  if (may_steal(waiting, now)) {
    begin_background(waiting, now);
    return true;
  }
  slot_passed();
  return false;
}

/// The cyclic slots that it takes fall out; their cycles show the held sample.
template <Port P>
void Bus<P>::begin_background(const Request& request, Time now) noexcept {
  const bool reset = priority_of(request) == Priority::reset_run;
  const bool in_gap = fits(request, now);
  const bool holds = !in_gap && will_hold(request);
  const bool announced = will_hold(request);
  const Time span = span_of(request);
  if (reset && resets_in_a_row_ < UINT8_MAX) ++resets_in_a_row_;
  if (!send(request, Kind::background, now)) {  // nothing is on the line, so nothing has to give way
    if (announced) tracker_.announce_hold(Time{0});
    return;
  }
  if (scheduler_ && hold_ == LineHold::none && !in_gap) {
    const std::uint32_t taken = scheduler_->give_way(
        std::max(exchange_.start() + span, spacing_.earliest()));  // it may have left late
    saturating_increment(reset || holds ? statistics_.displaced : statistics_.stolen, taken);
    if (!reset && !holds) to_steal_ = std::max<std::uint32_t>(taken, 1) * (config_.steal_every - 1U);
    // Once behind each fresh sample: a second hold without one between them does not keep an old sample alive.
    if (holds && stale_at_ != kNever && held_for_ == Time{0}) {
      held_for_ = span;
      stale_at_ += span;
    }
  }
  const bool pauses = scheduler_ ? !in_gap || hold_ != LineHold::none : hold_ != LineHold::none;
  if (pauses && stale_at_ != kNever) publish(tracker_.hold(now, valid_for()));
  if (announced) tracker_.announce_hold(Time{0});  // it has begun: later samples announce the next one
}

/// What waits has waited for one more cyclic slot.
template <Port P>
void Bus<P>::slot_passed() noexcept {
  const std::optional<Priority> starved = background_.on_slot_passed(patience_);
  for (const Priority priority : {Priority::eeprom, Priority::diagnostics})
    statistics_.longest_wait = std::max(statistics_.longest_wait, background_.waited(priority));
  if (!starved) return;
  saturating_increment(statistics_.starved);
  if (starved == Priority::eeprom) tracker_.announce_hold(Time{0});
  background_.complete(*starved, std::unexpected(Errc::no_gap));
}

template <Port P>
bool Bus<P>::send(const Request& request, Kind kind, Time now) noexcept {
  kind_ = kind;
  if (kind == Kind::cyclic) slot_ = scheduler_->slot();
  const Errc obstacle = check_line(now);
  const std::expected<Time, Errc> start = obstacle == Errc::ok
                                              ? port_->try_send(request.bytes(), now)
                                              : std::expected<Time, Errc>(std::unexpected(obstacle));
  if (!start) [[unlikely]] {
    if (!settling_) sent_span_ = span_of(exchange_.request());
    exchange_.begin(request, now, *profile_, capability_);
    // Nothing went out; still keep the distance, so that a broken port is not asked in a tight loop.
    spacing_.on_start(now, std::min(profile_->t1(request), profile_->t1(DataId::everything)));
    if (kind == Kind::cyclic) scheduler_->on_unused(now, statistics_);
    cyclic_start_.reset();
    exchange_.on_fault(start.error());
    unsent_ = true;  // poll() deals with it: not from here, which would be deep in the stack
    return false;
  }
  exchange_.begin(request, *start, *profile_, capability_);
  settling_ = false;
  leaving_ = false;
  spacing_.on_start(*start, profile_->t1(request));
  if (kind != Kind::cyclic) return true;
  scheduler_->on_start(*start, statistics_);
  if (cyclic_start_) statistics_.t1.add(*start - *cyclic_start_);
  cyclic_start_ = *start;
  return true;
}

/// What keeps a request from being sent: noise, a vanished port, or the last request still on its way.
template <Port P>
Errc Bus<P>::check_line(Time now) noexcept {
  if (settling_ && still_leaving(now)) [[unlikely]] {
    spacing_.hold_off(now + sent_span_ + capability_.latency_allowance);
    return Errc::send_failed;
  }
  return check_quiet(now);
}

/// True while the request of the exchange that failed has not left, and once more when it has: only from then on
/// is it known when it left at the latest.
template <Port P>
bool Bus<P>::still_leaving(Time now) noexcept {
  const Transmission::State state = port_->transmission(now).state;
  const bool before = leaving_ && state != Transmission::State::failed;  // what was given up will not leave
  leaving_ = state == Transmission::State::sending;
  return before || leaving_;
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

}  // namespace tm485
