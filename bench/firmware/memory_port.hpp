// MemoryPort: a port whose line is memory. What a bus on it costs is the bus.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <expected>
#include <span>

#include "tm485/bus/port.hpp"
#include "tm485/errc.hpp"
#include "tm485/protocol/layout.hpp"
#include "tm485/time.hpp"

namespace tm485::cost {

/// One owner. Whoever owns it plays the encoder: load() puts a reply into memory, and it is there once a request was sent.
class MemoryPort {
 public:
  explicit MemoryPort(bool wire_timestamps) noexcept : wire_timestamps_(wire_timestamps) {}

  [[nodiscard]] PortCapability capability() const noexcept {
    return {.latency_allowance = Time{4'000}, .wire_timestamps = wire_timestamps_};
  }
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    for (std::size_t i = 0; i < request.size(); ++i) request_[i] = request[i];
    started_ = now;
    sent_ = true;
    return now;
  }
  [[nodiscard]] Transmission transmission(Time) const noexcept {
    return {.state = Transmission::State::sent};
  }
  Reception try_receive(std::span<std::uint8_t> buffer, Time) noexcept {
    if (!sent_ || length_ == 0 || length_ > buffer.size()) return {};
    Reception reception;
    reception.count = length_;
    reception.first_start = started_ + delay_;
    std::memcpy(buffer.data(), reply_.data(), length_);
    length_ = 0;
    return reception;
  }

  /// The last request; what is behind its end is left from those before.
  [[nodiscard]] const std::array<std::uint8_t, kMaxRequest>& request() const noexcept { return request_; }
  /// The reply to the next request, or to one that was sent: its start bit comes `delay` behind the request's.
  void load(std::span<const std::uint8_t> reply, Time delay) noexcept {
    std::memcpy(reply_.data(), reply.data(), reply.size());
    delay_ = delay;
    length_ = reply.size();
  }
  /// No request was sent since.
  void clear() noexcept { sent_ = false; }

 private:
  std::array<std::uint8_t, kMaxRequest> request_{};
  std::array<std::uint8_t, kMaxReply> reply_{};
  std::size_t length_ = 0;
  Time started_{0};
  Time delay_{0};
  bool sent_ = false;
  bool wire_timestamps_;
};

}  // namespace tm485::cost
