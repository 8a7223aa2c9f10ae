#include "tm485/linux/mmio_uart.hpp"

#include <cerrno>
#include <charconv>
#include <chrono>
#include <string_view>
#include <utility>

namespace tm485::linux_hal {
namespace {

using std::chrono::microseconds;

constexpr mcu::BaudFamily family_of(MmioBlock block) noexcept {
  return block == MmioBlock::pl011 ? mcu::BaudFamily::pl011 : mcu::BaudFamily::ns16550;
}

constexpr std::string_view name_of(MmioBlock block) noexcept {
  return block == MmioBlock::pl011 ? "PL011" : "16550";
}

std::string hexadecimal(std::uint64_t number) {
  char digits[16];
  const auto end = std::to_chars(digits, digits + sizeof digits, number, 16).ptr;
  return "0x" + std::string(digits, end);
}

std::string where(const MmioOptions& options) {
  std::string text(name_of(options.block));
  text += options.address == 0 ? " of " + options.uio : " at " + hexadecimal(options.address);
  return text;
}

OsError refusal(const MmioOptions& options, Errc code, std::string_view why, std::string remedy) {
  return {code, 0, "cannot open the " + where(options) + ": " + std::string(why), std::move(remedy)};
}

bool negative(const std::optional<Time>& time) noexcept { return time.value_or(Time{0}) < Time{0}; }

/// Empty, or what is impossible.
std::string_view impossible(const MmioOptions& options) noexcept {
  if (options.clock_hz == 0 || options.bit_rate == 0) return "clock and bit rate must be above 0";
  if (options.address == 0 && options.uio.empty()) return "it needs an address or a UIO device";
  if (options.address % 4 != 0 && options.block == MmioBlock::pl011) return "the address is no multiple of 4";
  if (!options.layout.valid()) return "shift is 0 to 2, width 1, 2 or 4 and not more than the shift leaves";
  if (options.block == MmioBlock::ns16550 && options.address % options.layout.width != 0)
    return "the address is no multiple of the width";
  if (options.driver_lead < Time{0} || negative(options.latency_allowance) ||
      negative(options.shortest_exchange) || negative(options.release_bound))
    return "a time is negative";
  if (options.direction.kind == MmioDirection::Kind::call && !options.direction.call)
    return "the direction has nothing to call";
  return {};
}

OsError driver_bound(const MmioOptions& options, const BoundDriver& bound) {
  OsError error = refusal(options, Errc::bad_argument, "the kernel's driver has it, as " + bound.tty,
                          "unbind the driver first, as root");
  error.error_number = EBUSY;
  if (!bound.driver.empty())
    error.remedy +=
        ": echo " + bound.device + " > /sys/bus/" + bound.bus + "/drivers/" + bound.driver + "/unbind";
  error.remedy += " (writing the same to bind gives it back)";
  return error;
}

OsError rate_refused_by(const MmioOptions& options, const mcu::BaudRefusal& refused) {
  return refusal(
      options, Errc::bad_argument,
      std::to_string(options.bit_rate) + " bit/s cannot be made of a clock of " +
          std::to_string(options.clock_hz) + " Hz: the nearest is " + std::to_string(refused.nearest) +
          " bit/s, more than 2 % off",
      "raise the UART's clock: 16 times the bit rate is the least (40 MHz for 2.5 Mbit/s; on a Raspberry "
      "Pi init_uart_clock=48000000 in config.txt), or give its true value");
}

OsError setup_refused(const MmioOptions& options, Errc code) {
  if (code == Errc::bad_argument)
    return refusal(
        options, code, "it has no working FIFOs",
        "check the address and the distance of its registers (shift); a 16450 loses bytes and is not taken");
  if (code == Errc::send_failed)
    return refusal(options, code, "the direction line does not obey",
                   "check the line that switches the RS-485 driver");
  return refusal(
      options, code, "its registers do not keep what is written to them",
      "check address, kind and distance of its registers (shift), and that its clock runs: the kernel may "
      "have switched it off together with its driver");
}

PortCapability capability_of(const MmioOptions& options) noexcept {
  const bool automatic = options.direction.kind == MmioDirection::Kind::automatic;
  PortCapability capability;
  capability.shortest_exchange = options.shortest_exchange.value_or(Time{0});
  capability.jitter_margin = microseconds(5);
  capability.latency_allowance = options.latency_allowance.value_or(microseconds(100));
  capability.release_bound = options.release_bound.value_or(automatic ? Time{0} : Time{microseconds(5)});
  // A driver that is still on when the encoder answers spoils the reply's first bit.
  constexpr Time kEarliestReply{2'800};
  capability.timing =
      capability.release_bound <= kEarliestReply ? TimingClass::soft : TimingClass::best_effort;
  return capability;
}

}  // namespace

std::expected<MmioUart, OsError> MmioUart::open(const MmioOptions& options) {
  if (const std::string_view why = impossible(options); !why.empty()) {
    OsError error = refusal(options, Errc::bad_argument, why, "give other options");
    error.error_number = EINVAL;
    return std::unexpected(std::move(error));
  }
  const auto divisor = mcu::solve_baud(family_of(options.block), options.clock_hz, options.bit_rate);
  if (!divisor) return std::unexpected(rate_refused_by(options, divisor.error()));
  if (options.address != 0) {
    if (const BoundDriver bound = find_bound_driver(options.sysfs, options.address); !bound.tty.empty())
      return std::unexpected(driver_bound(options, bound));
  }
  const bool is_pl011 = options.block == MmioBlock::pl011;
  const RegisterRange range =
      is_pl011 ? RegisterRange{options.address, mcu::Pl011<mcu::VolatileRegisters>::kSpan}
               : RegisterRange{options.address, options.layout.span(), options.layout.width};
  auto mapping = options.uio.empty() ? MemoryMapping::physical(options.memory, range)
                                     : MemoryMapping::uio(options.uio, options.sysfs, range);
  if (!mapping) return std::unexpected(std::move(mapping.error()));

  const mcu::VolatileRegisters registers(mapping->registers());
  const mcu::PolledPortConfig config{.driver_lead = options.driver_lead,
                                     .capability = capability_of(options)};
  // From here on the destructor leaves the UART as it should be left.
  MmioUart port(std::move(*mapping),
                MmioPort(options.block, registers, options.layout, options.direction, config), *divisor);
  const auto started = port.start(*divisor);
  if (!started) return std::unexpected(setup_refused(options, started.error()));
  return port;
}

MmioUart& MmioUart::operator=(MmioUart&& other) noexcept {
  if (this == &other) return *this;
  close();
  MmioPort::operator=(static_cast<MmioPort&&>(other));  // the part of it that is the port
  mapping_ = std::move(other.mapping_);
  divisor_ = other.divisor_;
  return *this;
}

void MmioUart::close() noexcept {
  MmioPort::close();
  mapping_ = MemoryMapping();
}

}  // namespace tm485::linux_hal
