#include "tm485/linux/port_identity.hpp"

#include <algorithm>
#include <cctype>
#include <chrono>
#include <filesystem>

#include "system_files.hpp"

namespace tm485::linux_hal {
namespace {

namespace fs = std::filesystem;
using std::chrono::microseconds;
using std::chrono::milliseconds;

/// From the tty up to the device that names itself: a USB device is three levels up, a port of a hub no more.
constexpr int kLevels = 6;

/// The link of `folder` that leads to `device`; empty if there is none.
std::string link_to(const fs::path& folder, const fs::path& device) {
  std::error_code error;
  std::vector<std::string> found;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (behind_links(entry->path()) == device) found.push_back(entry->path().string());
  return found.empty() ? std::string{} : std::ranges::min(found);
}

/// The driver of the nearest ancestor, those of the kernel's own serial layers left out.
std::string driver_above(const fs::path& device) {
  fs::path level = device;
  for (int i = 0; i < kLevels && level.has_relative_path(); ++i, level = level.parent_path()) {
    const std::string driver = link_name(level / "driver");
    if (!driver.empty() && link_name(level / "subsystem") != "serial-base") return driver;
  }
  return {};
}

/// The USB device to which `device` belongs; empty if it belongs to none.
fs::path usb_device_above(const fs::path& device) {
  fs::path level = device;
  std::error_code error;
  for (int i = 0; i < kLevels && level.has_relative_path(); ++i, level = level.parent_path())
    if (fs::exists(level / "idVendor", error)) return level;
  return {};
}

std::uint16_t read_id(const fs::path& path) {
  return static_cast<std::uint16_t>(read_number(path, 16).value_or(0));
}

void read_usb(const fs::path& device, PortIdentity& identity) {
  identity.bus = PortBus::usb;
  identity.vendor = read_id(device / "idVendor");
  identity.product = read_id(device / "idProduct");
  identity.release = read_id(device / "bcdDevice");
  identity.product_text = read_line(device / "product").value_or("");
  identity.serial_number = read_line(device / "serial").value_or("");
  identity.usb_mbit = read_number(device / "speed").value_or(0);
  const UsbChip* const chip = find_usb_chip(identity.vendor, identity.product, identity.release);
  if (chip == nullptr) return;
  identity.chip = chip->name;
  identity.remark = chip->remark;
  identity.source = chip->source;
}

void read_board(const fs::path& tty, PortIdentity& identity) {
  identity.bus = PortBus::board;
  identity.uart_clock_hz = read_number(tty / "uartclk").value_or(0);
  const UartDriver* const driver = find_uart_driver(identity.driver);
  if (driver == nullptr) return;
  identity.chip = driver->name;
  identity.remark = driver->remark;
  identity.source = driver->source;
  identity.divider = driver->divider;
  identity.timeout_bits = driver->timeout_bits;
}

/// True for /dev/pts/N and for nothing else: its name in sysfs would be N.
bool is_pseudo(const fs::path& device) { return device.parent_path().filename() == "pts"; }

/// An 8250 slot without a UART has the type 0.
bool is_empty_slot(const fs::path& tty) { return read_number(tty / "type") == 0U; }

/// By name, and the numbers in it as numbers: ttyS2 before ttyS10.
bool before(const PortIdentity& left, const PortIdentity& right) {
  const auto stem = [](const std::string& name) { return name.find_last_not_of("0123456789") + 1; };
  const std::size_t a = stem(left.name);
  const std::size_t b = stem(right.name);
  if (left.name.substr(0, a) != right.name.substr(0, b)) return left.name < right.name;
  if (left.name.size() != right.name.size()) return left.name.size() < right.name.size();
  return left.name < right.name;
}

}  // namespace

PortIdentity identify_port(const std::string& path, const SystemPaths& system) {
  PortIdentity identity;
  const fs::path device = behind_links(path);
  identity.path = device.empty() ? path : device.string();
  identity.name = fs::path(identity.path).filename().string();
  if (is_pseudo(identity.path)) {
    identity.bus = PortBus::pseudo_terminal;
    return identity;
  }
  if (!device.empty()) identity.stable_path = link_to(fs::path(system.dev) / "serial/by-id", device);
  const fs::path tty = fs::path(system.sysfs) / "class/tty" / identity.name;
  const fs::path hardware = behind_links(tty / "device");
  if (hardware.empty()) return identity;
  identity.driver = driver_above(hardware);
  identity.kernel_console = read_line(tty / "console") == "Y";
  identity.latency_timer_ms = read_number(hardware / "latency_timer");
  if (const fs::path usb = usb_device_above(hardware); !usb.empty())
    read_usb(usb, identity);
  else
    read_board(tty, identity);
  return identity;
}

std::vector<PortIdentity> list_ports(const SystemPaths& system) {
  std::vector<PortIdentity> ports;
  std::error_code error;
  const fs::path ttys = fs::path(system.sysfs) / "class/tty";
  for (fs::directory_iterator entry(ttys, error), end; !error && entry != end; entry.increment(error)) {
    std::error_code absent;
    if (!fs::exists(entry->path() / "device", absent) || is_empty_slot(entry->path())) continue;
    ports.push_back(identify_port((fs::path(system.dev) / entry->path().filename()).string(), system));
  }
  std::ranges::sort(ports, before);
  return ports;
}

RateAbility rate_ability(const PortIdentity& identity, std::uint32_t bit_rate) noexcept {
  if (identity.bus == PortBus::usb) {
    const UsbChip* const chip = find_usb_chip(identity.vendor, identity.product, identity.release);
    if (chip == nullptr || !rate_acceptable(kTm485Rate, bit_rate)) return {};
    return {chip->verdict, chip->nearest_rate};
  }
  const auto rate = nearest_rate(identity.divider, identity.uart_clock_hz, bit_rate);
  if (!rate) return {};
  return {rate_acceptable(bit_rate, *rate) ? RateVerdict::holds : RateVerdict::cannot, *rate};
}

PortLimits port_limits(const PortIdentity& identity, std::uint32_t bit_rate) noexcept {
  // The kernel may hand a character out this late on a machine without real-time settings.
  constexpr Time kHandOver = milliseconds(20);
  switch (identity.bus) {
    case PortBus::pseudo_terminal:
      return {Time{0}, milliseconds(50), true};
    case PortBus::usb: {
      // There and back: two of the bus's frames at high speed; at full speed both may fall into one.
      Time shortest = identity.usb_mbit >= 480 ? Time{microseconds(250)} : Time{milliseconds(1)};
      Time latency = kHandOver;
      if (identity.latency_timer_ms) {
        // A reply is shorter than the chip's packet, so it leaves when the timer has run out.
        const Time timer = milliseconds(*identity.latency_timer_ms);
        shortest = std::max(shortest, timer);
        latency += timer;
      }
      return {shortest, latency, true};
    }
    case PortBus::board:
    case PortBus::unknown:
      break;
  }
  // The longest exchange (1 + 11 characters, T2 of 3 us), the receive time-out that follows the last character, and
  // what kernel and caller take: 15 us to hand it over, 20 us to begin anew.
  constexpr std::int64_t kBits = 120;  // 12 characters
  constexpr unsigned kUsualTimeout = 40;
  const unsigned timeout = identity.timeout_bits == 0 ? kUsualTimeout : identity.timeout_bits;
  const Time wire{(kBits + timeout) * 1'000'000'000 / std::int64_t{bit_rate}};
  return {wire + microseconds(3 + 15 + 20), kHandOver, false};
}

}  // namespace tm485::linux_hal
