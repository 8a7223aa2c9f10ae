// The port: what the bus needs from a half-duplex line, and what an implementation promises.
//
// The contract, in one sentence, tested on every implementation by one conformance suite:
//
//   When a send is reported complete, the last stop bit has left, the driver is released and
//   the line is idle.
//
// Beyond it: no function blocks, waits or allocates; a request is sent as one gapless burst;
// the port never sends on its own account; bytes that it receives are handed out once, in order.
// One exception, bounded: a port that switches the driver by software may keep `try_send` until the
// request has left (docs/adr/0011-release-inside-try-send.md).
// Specification: sections 1 and 4.
#pragma once

#include <chrono>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <initializer_list>
#include <span>

#include "tm485/errc.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// How far a port's timing can be trusted.
enum class TimingClass : std::uint8_t {
  hard,         ///< bounded by hardware or by the model
  soft,         ///< bounded in practice: a real-time thread on a quiet machine
  best_effort,  ///< no bound: a USB adapter, a pseudo-terminal, software direction control
};

/// What a port can hold. Stated or probed once, before the bus starts; constant afterwards.
struct PortCapability {
  Time shortest_exchange{0};  ///< shortest request start to next request start, for any ID; 0: only T1 limits
  Time jitter_margin{0};      ///< a request may start this much later than asked without being "late"
  Time latency_allowance{0};  ///< last stop bit on the wire until `try_receive` hands the byte out, at most
  bool wire_timestamps = false;  ///< `Reception` times are those of the wire, so T2 can be judged
  Time release_bound{0};         ///< last stop bit of a request until the driver is off the line, at most
  TimingClass timing = TimingClass::hard;

  /// False if a span is below zero or above an hour: nobody means that, and sums with it would overflow. A bus refuses to
  /// start on such a port.
  [[nodiscard]] constexpr bool valid() const noexcept {
    for (const Time span : {shortest_exchange, jitter_margin, latency_allowance, release_bound})
      if (span < Time{0} || span > std::chrono::hours(1)) return false;
    return true;
  }
};

/// How far the last request has got.
struct Transmission {
  enum class State : std::uint8_t {
    idle,     ///< nothing was sent yet
    sending,  ///< bytes or the driver are still on the line
    sent,     ///< complete: see the contract sentence above
    failed,   ///< the port gave up; `fault` says why
  };
  State state = State::idle;
  Errc fault = Errc::ok;
};

/// What `try_receive` found.
struct Reception {
  std::size_t count = 0;  ///< bytes written to the caller's buffer; 0: nothing yet
  Time first_start{0};    ///< start bit of the first of them; only with `wire_timestamps`
  Errc fault = Errc::ok;  ///< overrun, framing_error or port_gone seen since the last call
};

/// The concept, four functions and one more that a port may have:
///
///     Errc line_fault() noexcept
///
/// What the port knows to have gone wrong on the line since the last call: overrun, framing_error, or ok. The bus asks
/// after an exchange that failed by its length or its contents, to name the cause; a port that finds faults while it
/// receives puts them into Reception instead.
///
/// `P` is owned by the bus's context; no function is called from anywhere else.
template <class P>
concept Port = requires(P& port, const P& constant, std::span<const std::uint8_t> request,
                        std::span<std::uint8_t> buffer, Time now) {
  /// What this port holds.
  { constant.capability() } noexcept -> std::convertible_to<PortCapability>;
  /// Starts a request of 1 to 4 bytes, at `now` or as soon after as the port can. Answers the
  /// instant of the first start bit (with wire timestamps exact, otherwise the port's estimate),
  /// or send_failed or port_gone.
  { port.try_send(request, now) } noexcept -> std::same_as<std::expected<Time, Errc>>;
  /// How far the last request has got at `now`.
  { port.transmission(now) } noexcept -> std::same_as<Transmission>;
  /// Takes what has been received until `now`, at most `buffer.size()` bytes.
  { port.try_receive(buffer, now) } noexcept -> std::same_as<Reception>;
};

}  // namespace tm485
