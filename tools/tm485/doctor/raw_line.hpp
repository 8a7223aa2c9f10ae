// RawLine: one request at a time on an opened port, and every byte that is heard after it, valid or not. The doctor's
// ear. It keeps T1 and bounds every wait; what the bytes mean is judged elsewhere. Specification: sections 1 and 4.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>

#include "any_port.hpp"
#include "commands.hpp"
#include "problem.hpp"
#include "tm485/linux/clock.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/sim/virtual_clock.hpp"
#include "tm485/time.hpp"

namespace tm485::cli::doctor {

/// What was heard after a request, at most kCapacity bytes of it.
struct Heard {
  static constexpr std::size_t kCapacity = 64;
  std::array<std::uint8_t, kCapacity> bytes{};
  std::size_t count = 0;
  std::array<Time, kCapacity> starts{};  ///< start bit of each byte; only with wire timestamps
  Time request_start{0};
  Time request_end{0};      ///< end of its last stop bit; without wire timestamps an estimate
  Time first_seen{0};       ///< when the first byte was handed out
  Errc fault = Errc::ok;    ///< send_failed, overrun, framing_error or port_gone
  std::uint32_t stray = 0;  ///< bytes that came before the request, when nobody had asked

  [[nodiscard]] std::span<const std::uint8_t> all() const noexcept { return std::span(bytes).first(count); }
};

/// One owner. A simulated encoder runs in virtual time, everything else on the real clock.
class RawLine {
 public:
  RawLine() = default;
  RawLine(const RawLine&) = delete;
  RawLine& operator=(const RawLine&) = delete;

  /// Closes the port that was open, if one was, and opens it at a rate. Problems: those of open_port().
  [[nodiscard]] std::expected<void, Problem> open(const PortOptions& options, std::uint32_t bit_rate);

  /// Sends, and listens until `enough` bytes have come or nothing more can. T1 since the request before has passed when
  /// it sends. Bound: about T1 + listening_time(), on the port's clock.
  [[nodiscard]] Heard ask(const Request& request, const CompiledProfile& profile, std::size_t enough);

  /// Goes on listening after ask(), for a reply that the host hands over late.
  void listen_more(Heard& heard, Time span, std::size_t enough);

  /// Waits, on the port's clock; less if Ctrl-C comes.
  void pause(Time span);

  /// How long after a request a reply may still come: it, the longest T2 that is looked for, and the port's latency.
  [[nodiscard]] Time listening_time() const noexcept;

  [[nodiscard]] Time now() const noexcept { return simulated_ ? virtual_clock_.now() : clock_.now(); }
  /// The device has vanished, or could not be opened again.
  [[nodiscard]] bool gone() const noexcept { return !port_ || port_->gone(); }
  [[nodiscard]] const AnyPort& port() const noexcept { return *port_; }
  [[nodiscard]] const PortCapability& capability() const noexcept { return capability_; }
  [[nodiscard]] std::uint32_t bit_rate() const noexcept { return bit_rate_; }
  [[nodiscard]] bool simulated() const noexcept { return simulated_; }

 private:
  void listen(Heard& heard, Time deadline, std::size_t enough);
  bool take(Heard& heard);

  std::optional<AnyPort> port_;
  PortCapability capability_;
  std::uint32_t bit_rate_ = 0;
  Time character_{0};
  bool simulated_ = false;
  Time next_request_{0};
  linux_hal::MonotonicClock clock_;
  sim::VirtualClock virtual_clock_;
};

}  // namespace tm485::cli::doctor
