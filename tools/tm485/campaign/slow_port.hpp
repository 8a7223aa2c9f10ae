// SlowPort: a port that knows nothing of the wire, as a kernel gives it: a request starts later than it says, bytes are
// handed out late, and there are no timestamps. docs/adr/0004-t1-without-wire-timestamps.md
#pragma once

#include <cstdint>
#include <expected>
#include <span>

#include "tm485/bus/port.hpp"
#include "tm485/sim/random.hpp"

namespace tm485::cli::campaign {

/// Over a simulated port, whose start jitter it does not betray. With a latency of 0 it is the port itself. One owner.
template <class P>
class SlowPort {
 public:
  /// `latency`: the latency allowance; a third of it may be the start jitter of `port`, the rest is how late bytes are.
  SlowPort(P& port, Time latency, std::uint64_t seed) noexcept
      : port_(&port), latency_(latency), random_(seed) {}

  [[nodiscard]] PortCapability capability() const noexcept {
    PortCapability c = port_->capability();
    if (latency_ == Time{0}) return c;
    c.wire_timestamps = false;
    c.latency_allowance = latency_;
    return c;
  }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    const auto start = port_->try_send(request, now);
    if (latency_ == Time{0}) [[likely]]
      return start;
    late_ = Time{random_.below(latency_.count() * 2 / 3)};
    return start ? std::expected<Time, Errc>(now) : start;
  }
  [[nodiscard]] Transmission transmission(Time now) const noexcept { return port_->transmission(now); }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    if (latency_ == Time{0}) [[likely]]
      return port_->try_receive(buffer, now);
    Reception reception = port_->try_receive(buffer, now - late_);
    reception.first_start = Time{0};
    return reception;
  }

  /// By how much what is on the line is handed out later.
  [[nodiscard]] Time late() const noexcept { return late_; }

 private:
  P* port_;
  Time latency_;
  Time late_{0};
  sim::Random random_;
};

}  // namespace tm485::cli::campaign
