// SerialPort: a tty at any bit rate, as a port of the bus.
//
// opened -> exclusive -> raw 8N1 at the rate, read back and judged -> input dropped -> ready
//
// A pseudo-terminal is recognised: its rate is a mere number, and it promises less.
// Direction control: see stream_port.hpp. Specification: sections 1 and 4.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "tm485/bus/port.hpp"
#include "tm485/linux/os_error.hpp"
#include "tm485/linux/stream_port.hpp"
#include "tm485/linux/termios2.hpp"
#include "tm485/time.hpp"

namespace tm485::linux_hal {

struct SerialOptions {
  std::uint32_t bit_rate = 2'500'000;          ///< bit/s, not 0
  bool exclusive = true;                       ///< keep other programs out
  bool low_latency = true;                     ///< ask the driver for it, where it has the setting
  std::optional<Time> latency_allowance = {};  ///< replaces that of capability(), not negative
  std::optional<Time> shortest_exchange = {};  ///< replaces that of capability(), not negative
};

/// True if a receiver still reads what the other end sends: within ±2 % of the rate, edges included. A
/// character is ten bits, sampled in their middle: 5 % in all, of which the encoder's clock needs its share.
[[nodiscard]] constexpr bool rate_acceptable(std::uint32_t asked, std::uint32_t achieved) noexcept {
  const std::uint64_t difference = asked > achieved ? asked - achieved : achieved - asked;
  return asked != 0 && difference * 50 <= asked;
}

/// The error of a port that has set `achieved` when it was asked for `asked`: bad_argument, without an errno.
[[nodiscard]] OsError rate_refused(std::string_view path, std::uint32_t asked, std::uint32_t achieved);

/// One owner: the context of the bus. See StreamPort for errors and bounds of the port's functions.
class SerialPort {
 public:
  /// Opens and sets up. Does not wait for a modem or for data. Errors: an OsError with the failed step, its
  /// errno and a remedy; nothing stays open. Any thread; allocates.
  [[nodiscard]] static std::expected<SerialPort, OsError> open(const std::string& path,
                                                               const SerialOptions& options = {});

  SerialPort(SerialPort&&) noexcept = default;
  SerialPort& operator=(SerialPort&& other) noexcept;
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;
  /// Puts the terminal's settings back and closes.
  ~SerialPort() { restore(); }

  // The port.
  /// A tty: 100 us between requests (50 to 80 us are typical of good hardware, where the receive time-out
  /// interrupt comes after the last byte), replies handed out within 20 ms, soft. A pseudo-terminal: T1 only,
  /// 50 ms, best effort. Neither has wire timestamps. The release of the driver is the hardware's affair and
  /// not known here: its bound reads 0.
  [[nodiscard]] PortCapability capability() const noexcept { return stream_.capability(); }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    return stream_.try_send(request, now);
  }
  [[nodiscard]] Transmission transmission(Time now) noexcept { return stream_.transmission(now); }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    return stream_.try_receive(buffer, now);
  }

  // What became of the options.
  /// bit/s as the driver reports it: within ±2 % of the rate asked for. No proof on FTDI chips, whose
  /// driver repeats the wish.
  [[nodiscard]] std::uint32_t achieved_rate() const noexcept { return achieved_rate_; }
  /// The driver has taken the low-latency setting. It stays set after closing.
  [[nodiscard]] bool low_latency() const noexcept { return low_latency_; }
  [[nodiscard]] bool is_pseudo_terminal() const noexcept { return pseudo_terminal_; }
  [[nodiscard]] int last_errno() const noexcept { return stream_.last_errno(); }
  [[nodiscard]] int descriptor() const noexcept { return stream_.descriptor(); }

 private:
  SerialPort(StreamPort stream, const TerminalSettings& before) noexcept
      : stream_(std::move(stream)), before_(before) {}
  void restore() noexcept;

  StreamPort stream_;
  TerminalSettings before_;
  std::uint32_t achieved_rate_ = 0;
  bool exclusive_ = false;  ///< TIOCEXCL is set
  bool low_latency_ = false;
  bool pseudo_terminal_ = false;
};

static_assert(Port<SerialPort>);

}  // namespace tm485::linux_hal
