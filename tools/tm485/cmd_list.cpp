// tm485 list: the serial ports of this machine, and what each holds at 2.5 Mbit/s.

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>

#include "commands.hpp"
#include "json_output.hpp"
#include "output.hpp"
#include "problem.hpp"
#include "quantity.hpp"
#include "tm485/linux/latency_timer.hpp"
#include "tm485/linux/os_error.hpp"
#include "tm485/linux/port_identity.hpp"
#include "tm485/linux/port_users.hpp"

namespace tm485::cli {
namespace {

using linux_hal::PortBus;
using linux_hal::PortIdentity;
using linux_hal::RateVerdict;

constexpr std::string_view kHowToSimulate =
    "Without an encoder: tm485 monitor sim:rpm=3000, or tm485 sim --pty --link /tmp/encoder for other "
    "programs.\n";

struct Row {
  PortIdentity port;
  linux_hal::RateAbility ability;
  linux_hal::PortLimits limits;
  int access_errno = 0;
  std::vector<linux_hal::PortUser> users;
};

Row make_row(PortIdentity port) {
  Row row;
  row.ability = linux_hal::rate_ability(port, linux_hal::kTm485Rate);
  PortIdentity opened = port;  // opening a port sets the timer
  if (opened.latency_timer_ms) opened.latency_timer_ms = linux_hal::kShortestLatencyTimer;
  row.limits = linux_hal::port_limits(opened, linux_hal::kTm485Rate);
  if (::access(port.path.c_str(), R_OK | W_OK) != 0) row.access_errno = errno;
  row.users = linux_hal::port_users(port.path);
  row.port = std::move(port);
  return row;
}

std::string_view access_name(const Row& row) {
  if (row.access_errno == ENOENT) return "no_device_node";
  if (row.access_errno != 0) return "no_permission";
  if (row.port.kernel_console) return "console";
  return row.users.empty() ? "free" : "in_use";
}

double error_percent(std::uint32_t rate) {
  return (static_cast<double>(rate) / linux_hal::kTm485Rate - 1.0) * 100.0;
}

std::string_view bus_text(const PortIdentity& port) {
  switch (port.bus) {
    case PortBus::usb:
      return port.usb_mbit >= 480 ? "USB high speed" : port.usb_mbit == 0 ? "USB" : "USB full speed";
    case PortBus::board:
      return "UART of the machine";
    case PortBus::pseudo_terminal:
    case PortBus::unknown:
      break;
  }
  return "unknown bus";
}

std::string chip_text(const PortIdentity& port) {
  if (!port.chip.empty()) return port.chip;
  if (port.bus != PortBus::usb) return "unknown chip";
  return fmt::format("unknown chip {:04x}:{:04x} '{}'", port.vendor, port.product, port.product_text);
}

std::string ability_text(const Row& row) {
  std::string text(linux_hal::verdict_name(row.ability.verdict));
  if (row.ability.nearest != 0)
    text +=
        fmt::format(": makes {} bit/s ({:+.2f} %)", row.ability.nearest, error_percent(row.ability.nearest));
  else if (row.ability.verdict == RateVerdict::unknown)
    text += ": try it; the rate is read back, the first replies prove it";
  if (!row.port.remark.empty()) text += fmt::format("; {}", row.port.remark);
  return text;
}

std::string access_text(const Row& row) {
  if (row.access_errno != 0)
    return fmt::format("{}; {}", row.access_errno == ENOENT ? "there is no device node" : "no permission",
                       linux_hal::remedy_for(linux_hal::Resource::serial_port, row.access_errno));
  if (row.port.kernel_console)
    return fmt::format("the kernel's console: take console={} out of its command line", row.port.name);
  if (row.users.empty()) return "free";
  std::string text = "in use by";
  for (const linux_hal::PortUser& user : row.users)
    text += fmt::format("{} {} (process {})", &user == &row.users.front() ? "" : ",", user.program, user.pid);
  return text;
}

std::string text_of(const Row& row) {
  std::string text = fmt::format("{}   {}, {}", row.port.path, chip_text(row.port), bus_text(row.port));
  if (!row.port.driver.empty()) text += fmt::format(", driver {}", row.port.driver);
  text += '\n';
  if (!row.port.stable_path.empty()) text += fmt::format("  name that stays  {}\n", row.port.stable_path);
  text += fmt::format("  at 2.5 Mbit/s    {}\n", ability_text(row));
  if (row.ability.verdict != RateVerdict::cannot)
    text += fmt::format("  cycle            {} or longer{}\n", format_time(row.limits.shortest_exchange),
                        row.limits.best_effort ? ", best effort" : "");
  if (row.port.latency_timer_ms && *row.port.latency_timer_ms > linux_hal::kShortestLatencyTimer)
    text += fmt::format("  latency timer    {} ms; a port that is opened is set to {} ms, if it may be\n",
                        *row.port.latency_timer_ms, linux_hal::kShortestLatencyTimer);
  return text + fmt::format("  access           {}\n", access_text(row));
}

std::string json_of(const Row& row) {
  const PortIdentity& port = row.port;
  JsonObject json;
  json.set("path", port.path).set("stable_path", port.stable_path);
  json.set("chip", port.chip).set("driver", port.driver);
  json.set("bus", port.bus == PortBus::usb ? "usb" : port.bus == PortBus::board ? "board" : "unknown");
  if (port.bus == PortBus::usb) {
    json.set("usb_id", fmt::format("{:04x}:{:04x}", port.vendor, port.product));
    json.set("usb_release", fmt::format("{:04x}", port.release)).set("usb_mbit", port.usb_mbit);
    json.set("product", port.product_text).set("serial", port.serial_number);
  } else {
    json.set("uart_clock_hz", port.uart_clock_hz);
  }
  if (port.latency_timer_ms) json.set("latency_timer_ms", *port.latency_timer_ms);
  JsonObject rate;
  rate.set("bit_rate", linux_hal::kTm485Rate).set("verdict", linux_hal::verdict_name(row.ability.verdict));
  if (row.ability.nearest != 0)
    rate.set("nearest", row.ability.nearest).set("error_percent", error_percent(row.ability.nearest));
  rate.set("remark", port.remark).set("source", port.source);
  json.set("rate", std::move(rate));
  json.set("shortest_exchange_ns", row.limits.shortest_exchange.count());
  json.set("latency_allowance_ns", row.limits.latency_allowance.count());
  json.set("best_effort", row.limits.best_effort);
  json.set("access", access_name(row)).set("errno", row.access_errno);
  std::vector<JsonObject> users;
  users.reserve(row.users.size());
  for (const linux_hal::PortUser& user : row.users)
    users.push_back(std::move(JsonObject().set("pid", user.pid).set("program", user.program)));
  return json.set("users", std::move(users)).text() + '\n';
}

}  // namespace

int run_list(const ListOptions& options) {
  Output output;
  const auto ports = linux_hal::list_ports(options.system);
  for (const PortIdentity& port : ports) {
    const Row row = make_row(port);
    output.write(options.json ? json_of(row) : text_of(row) + '\n');
  }
  if (!options.json) {
    if (ports.empty())
      output.write(
          "No serial port has a device behind it. Is the adapter plugged in, and its driver loaded "
          "(journalctl -k)?\n");
    output.write(kHowToSimulate);
  }
  return finish(output, kExitGood);
}

}  // namespace tm485::cli
