// MmioPort: the port over whichever of the memory-mapped blocks it is, and over any access to its registers, so that a
// model of them with character time can take their place. MmioUart is this on mapped memory.
// Specification: sections 1 and 4.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <functional>
#include <span>
#include <utility>
#include <variant>

#include "tm485/bus/port.hpp"
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

/// One owner: the context of the bus. No function waits.
template <mcu::RegisterAccess R>
class MmioPort {
 public:
  /// `layout` counts for a 16550 only.
  MmioPort(MmioBlock block, R registers, const mcu::Layout16550& layout, MmioDirection direction,
           const mcu::PolledPortConfig& config)
      : port_(block == MmioBlock::pl011
                  ? AnyUart(std::in_place_type<Pl011Port>, mcu::Pl011<R>(std::move(registers)),
                            std::move(direction), config)
                  : AnyUart(std::in_place_type<Uart16550Port>,
                            mcu::Uart16550<R>(std::move(registers), layout), std::move(direction), config)) {}
  /// What was moved from is closed.
  MmioPort(MmioPort&& other) noexcept
      : port_(std::move(other.port_)), open_(std::exchange(other.open_, false)) {}
  MmioPort& operator=(MmioPort&& other) noexcept {
    port_ = std::move(other.port_);
    open_ = std::exchange(other.open_, false);
    return *this;
  }
  MmioPort(const MmioPort&) = delete;
  MmioPort& operator=(const MmioPort&) = delete;
  ~MmioPort() = default;

  /// Errors: those of PolledUartPort::start().
  [[nodiscard]] std::expected<void, Errc> start(const mcu::BaudDivisor& divisor) noexcept {
    return with([&](auto& port) { return port.start(divisor); });
  }
  /// Takes the driver off the line, switches the UART off and lets go of what switches the driver. From then on the
  /// functions below answer port_gone, and the registers are not touched again.
  void close() noexcept {
    if (std::exchange(open_, false)) with([](auto& port) { port.stop(); });
    with([](auto& port) { port.direction() = MmioDirection(); });
  }

  /// After close() what it was. Limited by T1 only; no wire timestamps.
  [[nodiscard]] PortCapability capability() const noexcept {
    return with([](const auto& port) { return port.capability(); });
  }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    if (!open_) [[unlikely]]
      return std::unexpected(Errc::port_gone);
    return with([&](auto& port) { return port.try_send(request, now); });
  }
  [[nodiscard]] Transmission transmission(Time now) noexcept {
    if (!open_) [[unlikely]]
      return {Transmission::State::failed, Errc::port_gone};
    return with([&](auto& port) { return port.transmission(now); });
  }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    if (!open_) [[unlikely]]
      return {.fault = Errc::port_gone};
    return with([&](auto& port) { return port.try_receive(buffer, now); });
  }

  /// From the earliest end of the last request to the release of the driver: an upper bound.
  [[nodiscard]] Time last_release() const noexcept {
    return with([](const auto& port) { return port.last_release(); });
  }

 private:
  using Pl011Port = mcu::PolledUartPort<mcu::Pl011<R>, MmioDirection>;
  using Uart16550Port = mcu::PolledUartPort<mcu::Uart16550<R>, MmioDirection>;
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

  AnyUart port_;
  bool open_ = true;
};

}  // namespace tm485::linux_hal
