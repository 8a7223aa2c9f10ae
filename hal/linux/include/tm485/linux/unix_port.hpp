// UnixPort: a stream socket of the Unix domain as a port of the bus, for an encoder that another process
// simulates. Specification: section 4.
#pragma once

#include <chrono>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>

#include "tm485/bus/port.hpp"
#include "tm485/linux/os_error.hpp"
#include "tm485/linux/stream_port.hpp"
#include "tm485/time.hpp"

namespace tm485::linux_hal {

struct UnixOptions {
  std::uint32_t bit_rate = 2'500'000;           ///< bit/s of the line that is simulated, not 0
  Time connect_time = std::chrono::seconds(1);  ///< how long to try while the server does not accept
  std::optional<Time> latency_allowance = {};   ///< replaces that of capability(), not negative
  std::optional<Time> shortest_exchange = {};   ///< replaces that of capability(), not negative
};

/// One owner: the context of the bus. See StreamPort for errors and bounds of the port's functions.
class UnixPort {
 public:
  /// Connects. Blocks for `connect_time` at most, and only while the server's queue is full. Errors: an
  /// OsError with the failed step, its errno and a remedy; nothing stays open. Any thread; allocates.
  [[nodiscard]] static std::expected<UnixPort, OsError> connect(const std::string& path,
                                                                const UnixOptions& options = {});

  /// As a pseudo-terminal: T1 only, replies handed out within 50 ms, best effort, no wire timestamps.
  [[nodiscard]] PortCapability capability() const noexcept { return stream_.capability(); }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    return stream_.try_send(request, now);
  }
  [[nodiscard]] Transmission transmission(Time now) noexcept { return stream_.transmission(now); }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    return stream_.try_receive(buffer, now);
  }

  [[nodiscard]] int last_errno() const noexcept { return stream_.last_errno(); }
  [[nodiscard]] int descriptor() const noexcept { return stream_.descriptor(); }

 private:
  explicit UnixPort(StreamPort stream) noexcept : stream_(std::move(stream)) {}

  StreamPort stream_;
};

static_assert(Port<UnixPort>);

}  // namespace tm485::linux_hal
