// MmioUart: a UART without the kernel's driver, polled byte by byte, as a port of the bus: for a thread that spins on
// an isolated core, where a tty costs interrupts, time-outs and a kernel thread.
//
// mapped (UIO or /dev/mem) -> rate solved -> set up, read back -> driver off the line -> ready
//
// The register drivers are those of hal/mcu (docs/adr/0012). Specification: sections 1 and 4.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <variant>

#include "tm485/bus/port.hpp"
#include "tm485/linux/memory_mapping.hpp"
#include "tm485/linux/os_error.hpp"
#include "tm485/mcu/baud.hpp"
#include "tm485/mcu/pl011.hpp"
#include "tm485/mcu/polled_uart_port.hpp"
#include "tm485/mcu/register_access.hpp"
#include "tm485/mcu/uart16550.hpp"
#include "tm485/time.hpp"

namespace tm485::linux_hal {

enum class MmioBlock : std::uint8_t { pl011, ns16550 };

/// Who switches the RS-485 driver. `call(on)` must not wait; false: it could not.
struct MmioDirection {
  enum class Kind : std::uint8_t {
    automatic,  ///< the transceiver itself
    rts,        ///< RTS on means "drive"
    rts_off,    ///< RTS off means "drive"
    call,       ///< `call`, a GPIO line as a rule
  };
  Kind kind = Kind::automatic;
  std::function<bool(bool on)> call = {};

  template <class U>
  bool drive(U& uart, bool on) noexcept {
    switch (kind) {
      case Kind::automatic:
        return true;
      case Kind::rts:
        return mcu::RtsDirection{.inverted = false}.drive(uart, on);
      case Kind::rts_off:
        return mcu::RtsDirection{.inverted = true}.drive(uart, on);
      case Kind::call:
        break;
    }
    return call(on);
  }
};

struct MmioOptions {
  MmioBlock block = MmioBlock::pl011;
  std::uint64_t address = 0;           ///< physical, of the first register; with `uio` 0 takes the device's
  std::uint32_t clock_hz = 0;          ///< the clock that the divisor divides, not 0
  std::uint32_t bit_rate = 2'500'000;  ///< bit/s, not 0; refused if the clock makes it more than 2 % wrong
  mcu::Layout16550 layout = {};        ///< of a 16550: distance and width of its registers
  std::string uio = {};                ///< "/dev/uio0"; empty: `memory`
  MmioDirection direction = {};
  Time driver_lead{0};                         ///< the driver is on this long before the start bit
  std::optional<Time> latency_allowance = {};  ///< replaces that of capability(), not negative
  std::optional<Time> shortest_exchange = {};  ///< replaces that of capability(), not negative
  std::optional<Time> release_bound = {};      ///< replaces that of capability(), not negative
  std::string memory = "/dev/mem";             ///< where physical memory is
  std::string sysfs = "/sys";                  ///< where the kernel describes its devices
};

/// One owner: the context of the bus. No function of the port makes a system call, `direction.call` apart.
class MmioUart {
  using Pl011Port = mcu::PolledUartPort<mcu::Pl011<mcu::VolatileRegisters>, MmioDirection>;
  using Uart16550Port = mcu::PolledUartPort<mcu::Uart16550<mcu::VolatileRegisters>, MmioDirection>;
  using AnyUart = std::variant<Pl011Port, Uart16550Port>;

  template <class F>
  auto with(const F& function) noexcept {
    if (auto* const pl011 = std::get_if<Pl011Port>(&port_)) return function(*pl011);
    return function(*std::get_if<Uart16550Port>(&port_));
  }
  template <class F>
  auto with(const F& function) const noexcept {
    if (const auto* const pl011 = std::get_if<Pl011Port>(&port_)) return function(*pl011);
    return function(*std::get_if<Uart16550Port>(&port_));
  }

 public:
  /// Maps and sets up. Errors: an OsError with the failed step, errno (where the system gave one) and a remedy:
  /// no permission, memory that the kernel keeps for itself, a kernel driver that still has the UART, a rate that the
  /// clock does not make, no UART of this kind at the address. Nothing stays mapped. Set-up; allocates.
  [[nodiscard]] static std::expected<MmioUart, OsError> open(const MmioOptions& options);

  MmioUart(MmioUart&&) noexcept = default;
  MmioUart& operator=(MmioUart&& other) noexcept;
  MmioUart(const MmioUart&) = delete;
  MmioUart& operator=(const MmioUart&) = delete;
  /// Takes the driver off the line, switches the UART off and unmaps it. The kernel's driver sets it up again when it
  /// is bound.
  ~MmioUart() { stop(); }

  /// Takes the driver off the line, switches the UART off, unmaps it and lets go of what switches the driver, so that
  /// the same UART can be opened again. From then on every function of the port answers port_gone. Owner; system calls.
  void close() noexcept;

  // The port. After close() port_gone, and the capability that it had.
  /// Limited by T1 only, 5 us of jitter, replies handed out within 100 us: what a loop that spins on a core of its own
  /// holds. Release: 0 with an automatic transceiver; otherwise one pass of the loop, stated as 5 us and best effort,
  /// since that is after T2 min, unless `release_bound` says better. No wire timestamps.
  [[nodiscard]] PortCapability capability() const noexcept {
    return with([](const auto& port) { return port.capability(); });
  }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    if (!mapping_.valid()) [[unlikely]]
      return std::unexpected(Errc::port_gone);
    return with([&](auto& port) { return port.try_send(request, now); });
  }
  [[nodiscard]] Transmission transmission(Time now) noexcept {
    if (!mapping_.valid()) [[unlikely]]
      return {Transmission::State::failed, Errc::port_gone};
    return with([&](auto& port) { return port.transmission(now); });
  }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    if (!mapping_.valid()) [[unlikely]]
      return {.fault = Errc::port_gone};
    return with([&](auto& port) { return port.try_receive(buffer, now); });
  }

  /// The divisor that was set, its rate and its error.
  [[nodiscard]] const mcu::BaudDivisor& divisor() const noexcept { return divisor_; }
  /// From the earliest end of the last request to the release of the driver: an upper bound.
  [[nodiscard]] Time last_release() const noexcept {
    return with([](const auto& port) { return port.last_release(); });
  }

 private:
  MmioUart(MemoryMapping mapping, AnyUart port, const mcu::BaudDivisor& divisor)
      : mapping_(std::move(mapping)), port_(std::move(port)), divisor_(divisor) {}

  void stop() noexcept;

  MemoryMapping mapping_;
  AnyUart port_;
  mcu::BaudDivisor divisor_;
};

static_assert(Port<MmioUart>);

}  // namespace tm485::linux_hal
