// What is behind a serial port: chip, driver, stable name, and what it makes of a bit rate. Read from sysfs and /dev
// without opening the port, so nothing moves on the line. Specification: section 4.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "tm485/linux/serial_chips.hpp"
#include "tm485/time.hpp"

namespace tm485::linux_hal {

/// Where the system describes itself; tests put their own there.
struct SystemPaths {
  std::string sysfs = "/sys";
  std::string dev = "/dev";
};

enum class PortBus : std::uint8_t { unknown, usb, board, pseudo_terminal };

/// What is not known is empty, 0 or unknown.
struct PortIdentity {
  std::string path;         ///< of the device itself, all links followed: /dev/ttyUSB0
  std::string stable_path;  ///< /dev/serial/by-id/...: the same device under whatever number
  std::string name;         ///< ttyUSB0
  PortBus bus = PortBus::unknown;
  std::string driver;  ///< of the chip: ftdi_sio, cdc_acm, uart-pl011
  std::string chip;    ///< from the tables
  std::string remark;
  std::string source;
  // USB
  std::uint16_t vendor = 0;
  std::uint16_t product = 0;
  std::uint16_t release = 0;  ///< bcdDevice
  std::string product_text;   ///< as the device calls itself
  std::string serial_number;
  std::uint32_t usb_mbit = 0;                     ///< 12: full speed, 480: high speed
  std::optional<unsigned> latency_timer_ms = {};  ///< FTDI only
  // board
  std::uint32_t uart_clock_hz = 0;
  ClockDivider divider = ClockDivider::unknown;
  unsigned timeout_bits = 0;
  bool kernel_console = false;  ///< the kernel writes its messages there
};

/// What a port makes of a bit rate.
struct RateAbility {
  RateVerdict verdict = RateVerdict::unknown;
  std::uint32_t nearest = 0;  ///< bit/s that come out; 0: not known
};

/// Looks a port up. Never fails: what cannot be found stays unknown. Set-up; reads some twenty small files.
[[nodiscard]] PortIdentity identify_port(const std::string& path, const SystemPaths& system = {});

/// Every serial port of the machine that has a device behind it, sorted by name. Consoles, pseudo-terminals and the
/// 8250 driver's empty slots are left out. Set-up.
[[nodiscard]] std::vector<PortIdentity> list_ports(const SystemPaths& system = {});

/// By the tables: an adapter's row speaks of 2.5 Mbit/s (±2 %), a board's UART is computed. `unknown`: the rate that is
/// read back and the first replies have to tell.
[[nodiscard]] RateAbility rate_ability(const PortIdentity& identity, std::uint32_t bit_rate) noexcept;

/// The fastest exchange and the longest delay that a port of this kind can be expected to hold.
struct PortLimits {
  Time shortest_exchange{0};
  Time latency_allowance{0};
  bool best_effort = false;
};
/// How they come about: docs/linux.md, "What cycle to expect". `bit_rate` not 0.
[[nodiscard]] PortLimits port_limits(const PortIdentity& identity, std::uint32_t bit_rate) noexcept;

}  // namespace tm485::linux_hal
