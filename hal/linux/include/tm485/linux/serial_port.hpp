// SerialPort: a tty at any bit rate, as a port of the bus.
//
// opened -> exclusive -> chip judged -> low latency -> raw 8N1 at the rate, read back and judged -> input dropped
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
#include "tm485/linux/latency_timer.hpp"
#include "tm485/linux/line_counters.hpp"
#include "tm485/linux/os_error.hpp"
#include "tm485/linux/port_identity.hpp"
#include "tm485/linux/serial_chips.hpp"
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
  bool refuse_unfit_chip = true;               ///< false: open also a chip that is known not to make the rate
  SystemPaths system = {};                     ///< where sysfs and /dev are
};

/// The error of a port whose chip cannot make the rate, whatever its driver reports: chip_unfit, bad_argument, without
/// an errno.
[[nodiscard]] OsError chip_unfit(const PortIdentity& identity, std::uint32_t asked, std::uint32_t nearest);

/// The error of a port that has set `achieved` when it was asked for `asked`: rate_refused, bad_argument,
/// without an errno.
[[nodiscard]] OsError rate_refused(std::string_view path, std::uint32_t asked, std::uint32_t achieved);

/// One owner: the context of the bus. See StreamPort for errors and bounds of the port's functions.
class SerialPort {
 public:
  /// Opens and sets up. Does not wait for a modem or for data. Errors: an OsError with the failed step, its
  /// errno and a remedy, rate_refused or chip_unfit; nothing stays open. Any thread; allocates.
  [[nodiscard]] static std::expected<SerialPort, OsError> open(const std::string& path,
                                                               const SerialOptions& options = {});

  SerialPort(SerialPort&&) noexcept = default;
  SerialPort& operator=(SerialPort&& other) noexcept;
  SerialPort(const SerialPort&) = delete;
  SerialPort& operator=(const SerialPort&) = delete;
  /// Puts the terminal's settings back and closes; what was not sent yet is dropped, so that a driver that hangs does
  /// not hold the program up.
  ~SerialPort() { restore(); }

  /// Closes now; every function of the port answers port_gone from then on. Owner.
  void close() noexcept;
  /// The device has vanished, or close() was called.
  [[nodiscard]] bool gone() const noexcept { return stream_.gone(); }
  /// Closes, and opens the same device with the same options: by the link that it was opened by, otherwise by its name
  /// in /dev/serial/by-id, which it keeps under whatever number it comes back. Errors: those of open(), and
  /// another_device: what is there now holds less than the port did. Then the port stays closed. Owner; system calls,
  /// allocates.
  [[nodiscard]] std::expected<void, OsError> reopen();
  /// What reopen() opens.
  [[nodiscard]] const std::string& reopen_path() const noexcept { return reopen_path_; }

  // The port.
  /// As port_limits() derives it from the chip: a UART of the board about 100 us between requests (its receive
  /// time-out interrupt comes after the last character), replies handed out within 20 ms, soft; USB 250 us at high
  /// speed, 1 ms at full speed, or the latency timer of an FTDI chip, best effort; a pseudo-terminal T1 only, 50 ms,
  /// best effort. None has wire timestamps. The release of the driver is the hardware's affair and not known here: its
  /// bound reads 0.
  [[nodiscard]] PortCapability capability() const noexcept { return stream_.capability(); }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    return stream_.try_send(request, now);
  }
  [[nodiscard]] Transmission transmission(Time now) noexcept { return stream_.transmission(now); }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    return stream_.try_receive(buffer, now);
  }

  // The line's faults: see StreamPort.
  [[nodiscard]] Errc line_fault() noexcept { return stream_.line_fault(); }
  [[nodiscard]] std::expected<LineCounters, int> line_counters() const noexcept {
    return stream_.line_counters();
  }

  // What became of the options.
  /// bit/s as the driver reports it: within ±2 % of the rate asked for. No proof on FTDI chips, whose
  /// driver repeats the wish.
  [[nodiscard]] std::uint32_t achieved_rate() const noexcept { return achieved_rate_; }
  /// The driver has taken the low-latency setting. It stays set after closing.
  [[nodiscard]] bool low_latency() const noexcept { return low_latency_; }
  /// FTDI chips: what became of the latency timer.
  [[nodiscard]] const LatencyTimer& latency_timer() const noexcept { return latency_timer_; }
  /// Chip, driver and names of the device.
  [[nodiscard]] const PortIdentity& identity() const noexcept { return identity_; }
  [[nodiscard]] bool is_pseudo_terminal() const noexcept { return pseudo_terminal_; }
  [[nodiscard]] int last_errno() const noexcept { return stream_.last_errno(); }
  [[nodiscard]] int descriptor() const noexcept { return stream_.descriptor(); }

 private:
  SerialPort(StreamPort stream, const TerminalSettings& before, PortIdentity identity) noexcept
      : stream_(std::move(stream)), before_(before), identity_(std::move(identity)) {}
  void restore() noexcept;

  StreamPort stream_;
  TerminalSettings before_;
  std::uint32_t achieved_rate_ = 0;
  bool exclusive_ = false;  ///< TIOCEXCL is set
  bool low_latency_ = false;
  bool pseudo_terminal_ = false;
  LatencyTimer latency_timer_;
  PortIdentity identity_;
  SerialOptions options_;
  std::string reopen_path_;
};

static_assert(Port<SerialPort>);

}  // namespace tm485::linux_hal
