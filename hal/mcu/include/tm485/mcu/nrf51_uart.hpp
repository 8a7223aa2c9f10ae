// Nrf51Uart: the register driver of the UART of Nordic's nRF51, polled. Registers: nRF51 Reference Manual 3.0, chapter 29.
// Specification: section 1.
//
// Its top rate is 1 Mbit/s, so in silicon it cannot talk to a TM485 encoder at 2.5 Mbit/s. It is here because QEMU's
// microbit has it: the machine to run Cortex-M0 code on, with a UART that knows no rate there. It is also the driver that
// docs/porting.md was made from.
//
// The receiver keeps six characters; the transmitter takes a byte only when the one before has left, so the characters of
// a longer request stand as far apart as the owner polls.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <utility>

#include "tm485/errc.hpp"
#include "tm485/mcu/baud.hpp"
#include "tm485/mcu/polled_uart.hpp"
#include "tm485/mcu/register_access.hpp"
#include "tm485/time.hpp"

namespace tm485::mcu {

/// One owner. No function waits. Pins (PSELTXD, PSELRXD) are the caller's affair, and are to be chosen before configure().
template <RegisterAccess R>
class Nrf51Uart {
 public:
  static constexpr bool kHidesLastCharacter = false;

  explicit Nrf51Uart(R registers) noexcept : registers_(std::move(registers)) {}

  /// The rates that the manual lists, as values of BAUDRATE: there is no divisor to be solved. The refusal names the
  /// nearest rate. Any context, also at compile time.
  [[nodiscard]] static constexpr std::expected<BaudDivisor, BaudRefusal> divisor_for(
      std::uint32_t bit_rate) noexcept {
    struct Row {
      std::uint32_t rate, value;
    };
    constexpr std::array<Row, 4> kRows{
        {{115'200, 0x01D7E000}, {460'800, 0x075F7000}, {921'600, 0x0EBEDFA4}, {1'000'000, 0x10000000}}};
    std::uint32_t nearest = 0;
    for (const Row& row : kRows) {
      if (row.rate == bit_rate) {
        constexpr std::uint32_t kBits = 1'000'000'000U;
        return BaudDivisor{.divisor = row.value,
                           .rate = row.rate,
                           .error_ppm = 0,
                           .character_time = Time{(10 * std::int64_t{kBits} + row.rate - 1) / row.rate}};
      }
      const auto away = [bit_rate](std::uint32_t rate) {
        return rate > bit_rate ? rate - bit_rate : bit_rate - rate;
      };
      if (nearest == 0 || away(row.rate) < away(nearest)) nearest = row.rate;
    }
    return std::unexpected(BaudRefusal{Errc::bad_argument, nearest});
  }

  /// `divisor` is one of divisor_for(). Errors: port_gone if the registers do not keep what is written.
  [[nodiscard]] std::expected<void, Errc> configure(const BaudDivisor& divisor) noexcept {
    shut_down();
    write(kEnable, kOn);  // first: QEMU's takes nothing else while it is off
    write(kInterruptsOff, ~std::uint32_t{0});
    write(kConfig, 0);  // no parity, no flow control
    write(kBaudRate, divisor.divisor);
    if (read(kBaudRate) != divisor.divisor) return std::unexpected(Errc::port_gone);
    write(kErrorSource, kAllErrors);
    write(kSent, 0);
    write(kReceived, 0);
    write(kStartReceiving, 1);
    write(kStartSending, 1);
    leaving_ = false;
    lost_ = false;
    return {};
  }

  [[nodiscard]] bool try_write(std::uint8_t byte) noexcept {
    if (!transmitter_idle()) return false;
    leaving_ = true;
    write(kTransmitData, byte);
    return true;
  }

  [[nodiscard]] bool transmitter_idle() noexcept {
    if (leaving_ && read(kSent) != 0) {
      write(kSent, 0);
      leaving_ = false;
    }
    return !leaving_;
  }

  /// Nothing ever waits behind the character that is leaving.
  void drop_unsent() noexcept {}

  [[nodiscard]] ReceivedCharacter try_read() noexcept {
    const std::uint32_t received = read(kReceived);
    if (received == kNobody) [[unlikely]]
      return {.fault = Errc::port_gone};
    if (received == 0) [[likely]] {
      (void)take_errors();
      return {};
    }
    // Before the byte: reading it brings the next one and its event.
    write(kReceived, 0);
    const std::uint32_t errors = take_errors();
    ReceivedCharacter character{.present = true,
                                .byte = static_cast<std::uint8_t>(read(kReceiveData) & 0xFFU)};
    if ((errors & kFraming) != 0) [[unlikely]]
      character.fault = Errc::framing_error;
    return character;
  }

  [[nodiscard]] bool take_overrun() noexcept { return std::exchange(lost_, false); }

  void shut_down() noexcept {
    write(kStopReceiving, 1);
    write(kStopSending, 1);
    write(kEnable, 0);
    leaving_ = false;
  }

 private:
  // Offsets.
  static constexpr std::size_t kStartReceiving = 0x000;
  static constexpr std::size_t kStopReceiving = 0x004;
  static constexpr std::size_t kStartSending = 0x008;
  static constexpr std::size_t kStopSending = 0x00C;
  static constexpr std::size_t kReceived = 0x108;
  static constexpr std::size_t kSent = 0x11C;
  static constexpr std::size_t kInterruptsOff = 0x308;
  static constexpr std::size_t kErrorSource = 0x480;
  static constexpr std::size_t kEnable = 0x500;
  static constexpr std::size_t kReceiveData = 0x518;
  static constexpr std::size_t kTransmitData = 0x51C;
  static constexpr std::size_t kBaudRate = 0x524;
  static constexpr std::size_t kConfig = 0x56C;
  // Error source; writing 1 clears.
  static constexpr std::uint32_t kOverrun = 1U << 0;
  static constexpr std::uint32_t kFraming = 1U << 2 | 1U << 3;  // a break too
  static constexpr std::uint32_t kAllErrors = 0xF;
  static constexpr std::uint32_t kOn = 4;

  static constexpr std::uint32_t kNobody = 0xFFFF'FFFF;

  /// The errors stand beside the characters and not in them: a framing error is told with the character that is read
  /// next, which is its own unless the owner polls late.
  [[nodiscard]] std::uint32_t take_errors() noexcept {
    const std::uint32_t errors = read(kErrorSource);
    if (errors != 0) [[unlikely]] {
      write(kErrorSource, errors);
      if ((errors & kOverrun) != 0) lost_ = true;
    }
    return errors;
  }
  [[nodiscard]] std::uint32_t read(std::size_t offset) noexcept { return registers_.read32(offset); }
  void write(std::size_t offset, std::uint32_t value) noexcept { registers_.write32(offset, value); }

  R registers_;
  bool leaving_ = false;  ///< a byte was written whose event has not come yet
  bool lost_ = false;
};

static_assert(PolledUart<Nrf51Uart<VolatileRegisters>>);

}  // namespace tm485::mcu
