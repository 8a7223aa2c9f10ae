// CmsdkUart: the register driver of the APB UART of ARM's Cortex-M System Design Kit (the MPS2 boards), polled
// or by interrupt. Registers: ARM DDI 0479, chapter 4.3. Specification: section 1.
//
// One character each way besides the shift registers, as on Stm32UsartV1. It neither says when the last stop bit has
// left nor notices a missing one: the port waits for a character's time, and the CRC has to find the other. Its receive
// and its transmit interrupt are two lines: both have the priority that the port's interrupt has.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <utility>

#include "tm485/errc.hpp"
#include "tm485/mcu/baud.hpp"
#include "tm485/mcu/interrupt_uart.hpp"
#include "tm485/mcu/polled_uart.hpp"
#include "tm485/mcu/register_access.hpp"

namespace tm485::mcu {

/// One owner. No function waits.
template <RegisterAccess R>
class CmsdkUart {
 public:
  static constexpr BaudFamily kFamily = BaudFamily::cmsdk;
  static constexpr bool kHidesLastCharacter = true;
  static constexpr bool kTellsCompletion = false;

  explicit CmsdkUart(R registers) noexcept : registers_(std::move(registers)) {}

  /// Errors: port_gone if the registers do not keep what is written.
  [[nodiscard]] std::expected<void, Errc> configure(const BaudDivisor& divisor) noexcept {
    shut_down();
    write(kBaudDivisor, divisor.divisor);
    if (read(kBaudDivisor) != divisor.divisor) return std::unexpected(Errc::port_gone);
    write(kControl, kOn);
    (void)read(kData);
    write(kState, kSendOverrun | kReceiveOverrun);
    return {};
  }

  [[nodiscard]] bool try_write(std::uint8_t byte) noexcept {
    if ((read(kState) & kSendFull) != 0) return false;
    write(kData, byte);
    return true;
  }

  /// The buffer is empty: the last character has begun to leave.
  [[nodiscard]] bool transmitter_idle() noexcept { return (read(kState) & kSendFull) == 0; }

  /// The character in the buffer cannot be taken back: the transmitter is switched off and on.
  void drop_unsent() noexcept {
    const std::uint32_t control = read(kControl);
    write(kControl, control & ~kTransmitEnable);
    write(kControl, control);
  }

  [[nodiscard]] ReceivedCharacter try_read() noexcept {
    const std::uint32_t state = read(kState);
    if (state == kNobody) [[unlikely]]
      return {.fault = Errc::port_gone};
    if ((state & kReceiveFull) == 0) [[likely]]
      return {};
    return {.present = true, .byte = static_cast<std::uint8_t>(read(kData) & 0xFFU)};
  }

  [[nodiscard]] bool take_overrun() noexcept {
    if ((read(kState) & kReceiveOverrun) == 0) [[likely]]
      return false;
    write(kState, kReceiveOverrun);
    return true;
  }

  void shut_down() noexcept { write(kControl, 0); }

  // Interrupts, see InterruptUart.
  void listen() noexcept { write(kControl, kOn | kReceiveInterrupt); }

  /// The transmit interrupt is made by the buffer's running empty, so it cannot come before the byte is written.
  void begin(std::uint8_t byte, bool) noexcept {
    write(kInterrupts, kTransmitDue);
    write(kControl, kOn | kReceiveInterrupt | kTransmitInterrupt);
    write(kData, byte);
  }

  [[nodiscard]] TransmitEvents take_events() noexcept {
    const std::uint32_t due = read(kInterrupts) & (kTransmitDue | kReceiveDue);
    if (due != 0) write(kInterrupts, due);
    return {.room = (due & kTransmitDue) != 0};
  }

  void await_completion() noexcept {}

 private:
  // Offsets.
  static constexpr std::size_t kData = 0x00;
  static constexpr std::size_t kState = 0x04;
  static constexpr std::size_t kControl = 0x08;
  static constexpr std::size_t kInterrupts = 0x0C;  // read: which are due; cleared by writing 1
  static constexpr std::size_t kBaudDivisor = 0x10;
  // State; the overruns are cleared by writing 1.
  static constexpr std::uint32_t kSendFull = 1U << 0;
  static constexpr std::uint32_t kReceiveFull = 1U << 1;
  static constexpr std::uint32_t kSendOverrun = 1U << 2;
  static constexpr std::uint32_t kReceiveOverrun = 1U << 3;
  // Control.
  static constexpr std::uint32_t kTransmitEnable = 1U << 0;
  static constexpr std::uint32_t kReceiveEnable = 1U << 1;
  static constexpr std::uint32_t kTransmitInterrupt = 1U << 2;
  static constexpr std::uint32_t kReceiveInterrupt = 1U << 3;
  static constexpr std::uint32_t kOn = kTransmitEnable | kReceiveEnable;
  // Interrupts.
  static constexpr std::uint32_t kTransmitDue = 1U << 0;
  static constexpr std::uint32_t kReceiveDue = 1U << 1;

  static constexpr std::uint32_t kNobody = 0xFFFF'FFFF;

  [[nodiscard]] std::uint32_t read(std::size_t offset) noexcept { return registers_.read32(offset); }
  void write(std::size_t offset, std::uint32_t value) noexcept { registers_.write32(offset, value); }

  R registers_;
};

static_assert(InterruptUart<CmsdkUart<VolatileRegisters>>);

}  // namespace tm485::mcu
