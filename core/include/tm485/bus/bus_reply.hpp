// Bodies of Bus, second part: from the request to the verdict of its exchange. Included by bus.hpp.
#pragma once

#include <algorithm>
#include <concepts>

#include "tm485/bus/bus.hpp"

namespace tm485 {

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
  leaving_ = transmission.state == Transmission::State::sending;
  return leaving_ ? Errc::send_failed : Errc::ok;
}

/// The exchange failed on the line. A port that may still hold bytes of it, or the request itself, gets time
/// to hand them out before anything else is asked: a late reply must not answer the next request.
template <Port P>
void Bus<P>::settle(Time now) noexcept {
  settling_ = true;
  if (!unsent_) sent_span_ = span_of(exchange_.request());
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
  if (!capability_.wire_timestamps && !unsent_) {
    // Complete before the request itself can have left: a reply to somebody else's.
    if (exchange_.error() == Errc::ok && now - exchange_.start() < profile_->request_time(exchange_.id()))
      exchange_.on_fault(Errc::t2_out_of_window);
    // Without a frame that holds all that is known is that the request has left; other bytes may be somebody else's, and do not
    // even say that.
    const DataId id = exchange_.id();
    const Time t1 = profile_->t1(exchange_.request());
    const bool heard = exchange_.error() == Errc::ok && Frame::parse(exchange_.reply(), id).has_value();
    // An encoder that answers before its T2 is over cannot be told here: by its characters alone.
    spacing_.on_reply_seen(now, profile_->request_time(id) + (heard ? profile_->reply_time(id) : Time{0}),
                           t1);
    if (!heard && exchange_.has_reply_delay())
      spacing_.hold_off(exchange_.start() + capability_.latency_allowance + t1);
  }
  if (exchange_.error() != Errc::ok) [[unlikely]]
    settle(now);
  unsent_ = false;
  if (kind_ == Kind::cyclic) [[likely]] {
    const Errc failure = finish_cyclic(now);
    if (failure == Errc::ok || !cycle_failed(failure, now)) return;
    saturating_increment(statistics_.lost);
    return begin_startup(now);
  }
  if (kind_ == Kind::background) return finish_background(now);
  finish_startup(now);
  after_startup_step(now);
}

/// What the port knows of an exchange that failed by its length or its contents: the line's fault is their cause.
template <Port P>
Errc Bus<P>::line_cause(Errc result) noexcept {
  if constexpr (requires(P& port) {
                  { port.line_fault() } noexcept -> std::same_as<Errc>;
                }) {
    switch (result) {
      case Errc::timeout:
      case Errc::incomplete_reply:
      case Errc::overlong_reply:
      case Errc::line_not_quiet:
      case Errc::echo_mismatch:
      case Errc::cf_sync_error:
      case Errc::cf_parity_error:
      case Errc::unknown_id:
      case Errc::cf_mismatch:
      case Errc::crc_error:
        break;
      default:
        return result;
    }
    if (const Errc fault = port_->line_fault(); fault != Errc::ok) return fault;
  }
  return result;
}

template <Port P>
void Bus<P>::record(Errc result, Time now) noexcept {
  if (result != Errc::ok) [[unlikely]] {
    result = line_cause(result);
    statistics_.count_error(result);
  }
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
