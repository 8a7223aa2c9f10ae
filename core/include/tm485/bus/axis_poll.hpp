// Bodies of Axis. Included by axis.hpp.
#pragma once

#include <algorithm>

#include "tm485/bus/axis.hpp"

namespace tm485 {

template <Port P>
std::expected<void, CycleRefusal> Axis<P>::start(Time now) noexcept {
  const auto started = bus_.start(now);
  if (started) publish_changes(now);
  return started;
}

template <Port P>
void Axis<P>::stop(Time now) noexcept {
  bus_.stop();
  (void)take_commands(now);
  take_completions();
  offer_waiting();  // each is refused, and answered
  publish_changes(now);
  link_.statistics.put(bus_.statistics());
}

template <Port P>
Time Axis<P>::poll(Time now) noexcept {
  if (const AxisLink::Tick& tick = link_.tick.get(); tick.count != ticks_) {
    ticks_ = tick.count;
    bus_.on_servo_tick(tick.at);
  }
  Time next = bus_.poll(now);
  see_sample(now);
  if (take_commands(now))
    next = now;  // behind the newest sample: resume looks at it. A restart is due at once
  if (offered_count_ != 0) take_completions();
  if (waiting_count_ != 0) {
    const std::uint32_t before = offered_count_;
    offer_waiting();
    if (offered_count_ != before) next = now;  // what was taken just now may be due already
  }
  publish_changes(now);
  if (now >= statistics_at_) [[unlikely]] {
    link_.statistics.put(bus_.statistics());
    statistics_at_ = now + statistics_every_;
  }
  return next;
}

/// At most kAxisCommands: the client posts no more before it has taken results.
template <Port P>
bool Axis<P>::take_commands(Time now) noexcept {
  AxisLink::Posted posted;
  bool any = false;
  while (commands_.try_pop(posted)) {
    any = true;
    if (posted.command.kind != Command::Kind::exchange) {
      execute(posted, now);
    } else if (waiting_count_ < kAxisCommands) {
      waiting_[waiting_count_++] = posted;
    }
  }
  return any;
}

template <Port P>
void Axis<P>::execute(const AxisLink::Posted& posted, Time now) noexcept {
  Errc error = Errc::ok;
  switch (posted.command.kind) {
    case Command::Kind::resume:
      error = resume(now);
      break;
    case Command::Kind::set_referenced:
    case Command::Kind::unreference:
      // Start-up decides anew, so it would not last.
      if (bus_.state() != BusState::running) error = Errc::bad_state;
      if (error == Errc::ok) bus_.set_referenced(posted.command.kind == Command::Kind::set_referenced);
      break;
    case Command::Kind::restart:
      if (bus_.state() == BusState::stopped) error = Errc::bad_state;
      bus_.on_restart(now);
      break;
    case Command::Kind::exchange:
      break;
  }
  answer(posted, error, std::nullopt);
}

template <Port P>
Errc Axis<P>::resume(Time now) noexcept {
  if (!newest_ || now >= valid_until_) return Errc::bad_state;
  if (after_restart_ == Continuity::until_homed && validity_.latched() && !bus_.latest().referenced())
    return Errc::bad_state;
  validity_.resume();
  validity_.on_good();
  jumped_ = false;
  ++resumed_;
  changed_ = true;
  return Errc::ok;
}

/// Hands waiting exchanges to the bus: the oldest of each class whose place is free.
template <Port P>
void Axis<P>::offer_waiting() noexcept {
  std::uint32_t kept = 0;
  for (std::uint32_t i = 0; i < waiting_count_; ++i) {
    const AxisLink::Posted posted = waiting_[i];
    const auto place = static_cast<std::size_t>(priority_of(posted.command.request));
    if (offered_[place]) {
      waiting_[kept++] = posted;
      continue;
    }
    const auto offered = bus_.offer(posted.command.request, posted.ticket);
    if (offered) {
      offered_[place] = posted;
      ++offered_count_;
    } else if (offered.error() == Errc::busy) {  // someone in the bus's context has the place
      waiting_[kept++] = posted;
    } else {
      answer(posted, offered.error(), std::nullopt);
    }
  }
  waiting_count_ = kept;
}

template <Port P>
void Axis<P>::take_completions() noexcept {
  for (std::size_t i = 0; i < kPriorities; ++i) {
    if (!offered_[i]) continue;
    const auto completion = bus_.take_completion(static_cast<Priority>(i), offered_[i]->ticket);
    if (!completion) continue;
    const auto& result = completion->result;
    answer(*offered_[i], result ? Errc::ok : result.error(), result ? std::optional(*result) : std::nullopt);
    offered_[i].reset();
    --offered_count_;
  }
}

/// There is always room: a client has no more commands under way than the ring holds.
template <Port P>
void Axis<P>::answer(const AxisLink::Posted& posted, Errc error, const std::optional<Reply>& reply) noexcept {
  (void)results_.try_push({posted.ticket, posted.command, error, reply});
}

template <Port P>
void Axis<P>::see_sample(Time now) noexcept {
  const Sample& sample = bus_.latest();
  if (sample.sequence() == sequence_) return;
  sequence_ = sample.sequence();
  on_sample(sample, now);
  changed_ = true;
}

template <Port P>
void Axis<P>::publish_changes(Time now) noexcept {
  see_sample(now);  // a command may have made one: restart
  const Sample& sample = bus_.latest();
  if (!changed_ && bus_.state() == state_) return;
  changed_ = false;
  state_ = bus_.state();
  AxisView& view = link_.view.draft();
  view.sample = sample;
  view.estimator = estimator_;
  view.fresh_until = fresh_until_;
  view.valid_until = valid_until_;
  view.newest = newest_;
  view.resumed = resumed_;
  view.valid = validity_.valid();
  view.latched = validity_.latched();
  view.link = bus_.link().state();
  view.alarms = bus_.alarms().latched();
  view.alarm = bus_.alarms().latched_level();
  view.state = state_;
  view.stage = bus_.startup_stage();
  view.startup_cause = bus_.startup_error() ? bus_.startup_error()->cause : Errc::ok;
  link_.view.publish();
}

/// A fresh sample that does not go on from the last one: behind a start-up, or where the shaft cannot have come to.
template <Port P>
void Axis<P>::on_jump(const Sample& sample, Time now) noexcept {
  if (const std::uint32_t startups = bus_.statistics().startups; startups != startups_) {
    startups_ = startups;
    discontinuities_ = sample.discontinuities();
    // A step before it is for somebody to look at: no restart explains it away.
    if (after_restart_ == Continuity::re_reference && !jumped_ && validity_.resume()) ++resumed_;
  }
  if (sample.discontinuities() == discontinuities_) return;
  discontinuities_ = sample.discontinuities();
  jumped_ = true;
  if (estimator_) estimator_->reset();
  validity_.on_lost(now);
}

/// The bus has a new sample: fresh, held or invalid.
template <Port P>
void Axis<P>::on_sample(const Sample& sample, Time now) noexcept {
  switch (sample.quality()) {
    case Quality::fresh:
      on_jump(sample, now);
      if (estimator_) estimator_->update(sample);
      fresh_until_ = bus_.fresh_until();
      valid_until_ = fresh_until_ + max_hold_;
      newest_ = true;
      return validity_.on_good();
    case Quality::held:
    case Quality::extrapolated:
      // A hold that was announced has begun: the bus lets the sample be good for so much longer.
      if (bus_.valid_until() != kNever) valid_until_ = std::max(valid_until_, bus_.valid_until());
      // A good reply without a position is no missing one: the pattern brings the next position in its time.
      if (bus_.last_record().kind == CycleRecord::Kind::cyclic && bus_.last_record().result == Errc::ok &&
          layout(bus_.last_record().id).abs_at == 0)
        return;
      newest_ = false;
      if (estimator_) estimator_->miss(now);
      return;
    case Quality::invalid:
      if (estimator_) estimator_->reset();
      newest_ = false;
      valid_until_ = Time{0};
      return validity_.on_lost(now);
  }
}

}  // namespace tm485
