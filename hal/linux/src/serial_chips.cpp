#include "tm485/linux/serial_chips.hpp"

#include <algorithm>

namespace tm485::linux_hal {
namespace {

using enum RateVerdict;

constexpr std::uint16_t kAnyRelease = 0xFFFF;

constexpr std::string_view kBelow2 = "divides 3 MHz by 1, 1.5 or more: 2.0 and 3.0 Mbit/s, nothing between";
constexpr std::string_view kHigh = "120 MHz / 10 / 4.75 = 2.526 Mbit/s";
constexpr std::string_view kAn232b = "FTDI AN232B-05; ftdi_sio: 232bm divisor";
constexpr std::string_view kFtdiHigh = "ftdi_sio: ftdi_2232h_baud_base_to_divisor";
constexpr std::string_view kDataSheet = "data sheet";

// The first row that fits counts.
constexpr std::array kUsbChips{
    UsbChip{0x0403, 0x6001, 0x0000, 0x04FF, "FT232B", 2'000'000, cannot, kBelow2, kAn232b},
    UsbChip{0x0403, 0x6001, 0x0500, kAnyRelease, "FT232R", 2'000'000, cannot, kBelow2, kAn232b},
    UsbChip{0x0403, 0x6010, 0x0000, 0x05FF, "FT2232D", 2'000'000, cannot, kBelow2, kAn232b},
    UsbChip{0x0403, 0x6010, 0x0600, kAnyRelease, "FT2232H", 2'526'316, holds, kHigh, kFtdiHigh},
    UsbChip{0x0403, 0x6011, 0x0000, kAnyRelease, "FT4232H", 2'526'316, holds, kHigh, kFtdiHigh},
    UsbChip{0x0403, 0x6014, 0x0000, kAnyRelease, "FT232H", 2'526'316, holds, kHigh, kFtdiHigh},
    UsbChip{0x0403, 0x6015, 0x0000, kAnyRelease, "FT-X (FT230X, FT231X, FT234X)", 2'000'000, cannot, kBelow2,
            "ftdi_sio: 232bm divisor"},
    UsbChip{0x1A86, 0x7522, 0x0000, kAnyRelease, "CH340", 2'000'000, cannot, "2.0 or 3.0 Mbit/s",
            "ch341: ch341_get_divisor; data sheet: up to 2 Mbit/s"},
    UsbChip{0x1A86, 0x7523, 0x0000, kAnyRelease, "CH340", 2'000'000, cannot, "2.0 or 3.0 Mbit/s",
            "ch341: ch341_get_divisor; data sheet: up to 2 Mbit/s"},
    UsbChip{0x1A86, 0x5523, 0x0000, kAnyRelease, "CH341", 2'000'000, cannot, "2.0 or 3.0 Mbit/s",
            "ch341: ch341_get_divisor; data sheet: up to 2 Mbit/s"},
    UsbChip{0x1A86, 0x55D3, 0x0000, kAnyRelease, "CH343", kTm485Rate, holds,
            "50 bit/s to 6 Mbit/s, error below 1.6 %; its TNOW pin switches the driver",
            "CH343P data sheet; not measured"},
    UsbChip{0x10C4, 0xEA60, 0x0000, kAnyRelease, "CP2102 or CP2102N", 2'400'000, cannot,
            "the CP2102N makes 48 MHz / 20 = 2.4 Mbit/s, the others less than 1",
            "cp210x: cp210x_get_actual_rate"},
    UsbChip{0x10C4, 0xEA70, 0x0000, kAnyRelease, "CP2105", 2'000'000, cannot,
            "2.0 Mbit/s on the enhanced port, 0.92 on the other", "cp210x: cp210x_init_max_speed"},
    UsbChip{0x04D8, 0x00DD, 0x0000, kAnyRelease, "MCP2221", 460'800, cannot,
            "460.8 kbit/s (A) or 115.2 kbit/s at most", kDataSheet},
    UsbChip{0x04E2, 0x1420, 0x0000, kAnyRelease, "XR21B1420", kTm485Rate, holds,
            "used with 2.5 Mbit/s encoders", "cncwiki.org, Mitsubishi OSE104 encoders; not measured"},
};

constexpr std::string_view kEm485 = "kernel 6.1: serial8250_get_divisor; receive time-out of 4 characters";

constexpr std::array kUartDrivers{
    UartDriver{"serial8250", "8250", ClockDivider::whole_16, 40, "clock / 16 / a whole number", kEm485},
    UartDriver{"serial", "8250", ClockDivider::whole_16, 40, "clock / 16 / a whole number", kEm485},
    UartDriver{"of_serial", "8250", ClockDivider::whole_16, 40, "clock / 16 / a whole number", kEm485},
    UartDriver{"uart-pl011", "PL011", ClockDivider::pl011, 32, "clock / 16 / steps of 1/64",
               "kernel 6.1: pl011_set_termios; receive time-out of 32 bits"},
    UartDriver{"omap8250", "8250_omap", ClockDivider::omap, 40,
               "a 48 MHz clock cannot, one of 160 or 192 MHz can",
               "kernel 6.1: omap_8250_get_divisor; TI E2E 705833"},
    UartDriver{"exar_serial", "Exar XR17V35x", ClockDivider::exar, 40,
               "256-byte FIFO, switches the driver itself", "kernel 6.1: xr17v35x_get_divisor"},
    UartDriver{"imx-uart", "i.MX UART", ClockDivider::imx, 32,
               "needs a clock of 40 MHz: the 80 MHz root, not the 24 MHz one",
               "kernel 6.1: imx_uart_set_termios"},
    UartDriver{"stm32-usart", "STM32 USART", ClockDivider::whole_8, 0,
               "drives DE itself; 64 MHz / 26 = 2.46 Mbit/s", "kernel 6.1: stm32_usart_set_termios"},
    UartDriver{"dw-apb-uart", "DesignWare 8250", ClockDivider::unknown, 40,
               "on many boards its clock follows the rate", "kernel 6.1: dw8250_set_termios"},
};

/// clock / divisor for the divisor next to the wish, at least `least`.
std::uint32_t divided(std::uint64_t clock, std::uint64_t bit_rate, std::uint64_t least) noexcept {
  const std::uint64_t divisor = std::max((clock + bit_rate / 2) / bit_rate, least);
  return static_cast<std::uint32_t>((clock + divisor / 2) / divisor);
}

std::uint32_t nearer(std::uint32_t bit_rate, std::uint32_t first, std::uint32_t second) noexcept {
  const auto distance = [bit_rate](std::uint32_t rate) {
    return rate > bit_rate ? rate - bit_rate : bit_rate - rate;
  };
  return distance(second) < distance(first) ? second : first;
}

}  // namespace

std::string_view verdict_name(RateVerdict verdict) noexcept {
  return verdict == holds ? "holds" : verdict == cannot ? "cannot" : "unknown";
}

std::span<const UsbChip> usb_chips() noexcept { return kUsbChips; }

const UsbChip* find_usb_chip(std::uint16_t vendor, std::uint16_t product, std::uint16_t release) noexcept {
  const auto found = std::ranges::find_if(kUsbChips, [&](const UsbChip& chip) {
    return chip.vendor == vendor && chip.product == product && chip.first_release <= release &&
           release <= chip.last_release;
  });
  return found == kUsbChips.end() ? nullptr : &*found;
}

std::span<const UartDriver> uart_drivers() noexcept { return kUartDrivers; }

const UartDriver* find_uart_driver(std::string_view driver) noexcept {
  const auto found = std::ranges::find(kUartDrivers, driver, &UartDriver::driver);
  return found == kUartDrivers.end() ? nullptr : &*found;
}

std::optional<std::uint32_t> nearest_rate(ClockDivider divider, std::uint32_t clock_hz,
                                          std::uint32_t bit_rate) noexcept {
  if (divider == ClockDivider::unknown || clock_hz == 0 || bit_rate == 0) return std::nullopt;
  switch (divider) {
    case ClockDivider::whole_16:
      return divided(clock_hz / 16, bit_rate, 1);
    case ClockDivider::pl011:
      return divided(std::uint64_t{clock_hz} * 4, bit_rate, 64);
    case ClockDivider::omap:
      return nearer(bit_rate, divided(clock_hz / 16, bit_rate, 1), divided(clock_hz / 13, bit_rate, 1));
    case ClockDivider::exar:
      return divided(clock_hz, bit_rate, 16);
    case ClockDivider::whole_8:
      return divided(clock_hz, bit_rate, 8);
    case ClockDivider::imx:
      return std::min(bit_rate, clock_hz / 16);
    case ClockDivider::unknown:
      break;
  }
  return std::nullopt;
}

}  // namespace tm485::linux_hal
