#include "tm485/linux/rs485_direction.hpp"

#include <array>
#include <utility>

#include "tm485/linux/port_identity.hpp"

namespace tm485::linux_hal {
namespace {

// How late the drivers of the kernel release, by their sources (6.1) and by what users report. A bit is 0.4 us.
constexpr Time kHardware{400};
constexpr Time kByInterrupt{3'000'000};

struct DriverRow {
  std::string_view driver;
  ReleaseBound release;
};
constexpr std::array kDrivers{
    DriverRow{"stm32-usart", {kHardware, true, "the USART switches DE itself"}},
    DriverRow{"exar_serial", {kHardware, true, "the UART switches the direction itself"}},
    DriverRow{"uart-pl011", {kByInterrupt, false, "an interrupt handler that looks every 4 us"}},
    DriverRow{"imx-uart", {kByInterrupt, false, "an interrupt handler; users report 8 us to 3 ms"}},
    DriverRow{"omap8250", {kByInterrupt, false, "an interrupt handler and a timer"}},
    DriverRow{"bcm2835-aux-uart", {kByInterrupt, false, "an interrupt handler and a timer"}},
    DriverRow{"dw-apb-uart",
              {kByInterrupt, false, "hardware if the UART has DE registers, otherwise an interrupt handler"}},
    DriverRow{"fsl-lpuart", {kByInterrupt, false, "RTS of the UART's modem control"}},
};
constexpr ReleaseBound kUnknownDriver{kByInterrupt, false, "as a rule an interrupt handler"};
/// What a real-time thread on a quiet machine keeps; an ordinary one has no bound.
constexpr ReleaseBound kGpio{Time{100'000}, false, "a program"};

std::string microseconds_text(Time time) {
  const std::int64_t tenths = (time.count() + 50) / 100;
  return std::to_string(tenths / 10) + "." + std::to_string(tenths % 10) + " us";
}

}  // namespace

ReleaseBound release_of_driver(std::string_view driver) noexcept {
  for (const DriverRow& row : kDrivers)
    if (row.driver == driver) return row.release;
  return kUnknownDriver;
}

std::optional<std::string> direction_warning(DirectionKind kind, const ReleaseBound& release,
                                             std::optional<Time> measured, Time limit) {
  const bool late = measured.value_or(Time{0}) > limit;
  if (kind == DirectionKind::automatic || (release.bound <= limit && !late)) return std::nullopt;
  std::string text = "best effort: the driver is released by ";
  text.append(release.basis).append(", ");
  if (late)
    text += "up to " + microseconds_text(*measured) + " late in this run";
  else
    text += "for which no time below " + microseconds_text(limit) + " is promised";
  text += "; an encoder answers " + microseconds_text(limit) +
          " after the request, and the start of its reply is lost if the driver is still on. What helps: "
          "a UART with a DE output in hardware (";
  text += kind == DirectionKind::kernel
              ? "STM32, Exar"
              : "--direction kernel where the driver leaves it to hardware: STM32, Exar";
  text += "), or a transceiver or adapter that switches by itself (--direction auto)";
  return text;
}

std::expected<Rs485Direction, OsError> Rs485Direction::open(const DirectionConfig& config, int fd,
                                                            const std::string& path,
                                                            const GpioOptions& gpio) {
  Rs485Direction direction;
  direction.config_ = config;
  direction.gpio_ = gpio;
  direction.path_ = path;
  if (auto opened = direction.open_again(fd); !opened) return std::unexpected(std::move(opened.error()));
  return direction;
}

std::expected<void, OsError> Rs485Direction::open_again(int fd) {
  let_go();
  switch (config_.kind) {
    case DirectionKind::automatic:
      break;
    case DirectionKind::kernel: {
      auto mode = KernelRs485::set(fd, path_, config_.rts_low, config_.mute);
      if (!mode) return std::unexpected(std::move(mode.error()));
      means_ = std::move(*mode);
      driver_ = identify_port(path_).driver;
      bound_ = release_of_driver(driver_);
      break;
    }
    case DirectionKind::gpio: {
      auto line = GpioLine::open(config_.gpio, gpio_);
      if (!line) return std::unexpected(std::move(line.error()));
      means_ = std::move(*line);
      bound_ = kGpio;
      break;
    }
  }
  return {};
}

std::string Rs485Direction::description() const {
  switch (config_.kind) {
    case DirectionKind::automatic:
      break;
    case DirectionKind::kernel:
      return "kernel, driver " + (driver_.empty() ? "unknown" : driver_) + " (" + std::string(bound_.basis) +
             ")";
    case DirectionKind::gpio:
      if (const GpioLine* const line = std::get_if<GpioLine>(&means_))
        return "GPIO " + line->description() + ", by " + gpio_library();
      return to_text(config_) + ", not open";
  }
  return "auto: transceiver, adapter or UART";
}

}  // namespace tm485::linux_hal
