// CmsdkUart: the register driver of the APB UART of ARM's Cortex-M System Design Kit (the MPS2 boards), polled.
// Registers: ARM DDI 0479, chapter 4.3. Specification: section 1.
//
// One character each way besides the shift registers, as on Stm32UsartV1. It neither says when the last stop bit has
// left nor notices a missing one: the port waits for a character's time, and the CRC has to find the other.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <utility>

#include "tm485/errc.hpp"
#include "tm485/mcu/baud.hpp"
#include "tm485/mcu/polled_uart.hpp"
#include "tm485/mcu/register_access.hpp"

namespace tm485::mcu {

/// One owner. No function waits.
template <RegisterAccess R>
class CmsdkUart {
 public:
  static constexpr BaudFamily kFamily = BaudFamily::cmsdk;
  static constexpr bool kHidesLastCharacter = true;

  explicit CmsdkUart(R registers) noexcept : registers_(std::move(registers)) {}

  /// Errors: port_gone if the registers do not keep what is written.
  [[nodiscard]] std::expected<void, Errc> configure(const BaudDivisor& divisor) noexcept {
    shut_down();
    write(kBaudDivisor, divisor.divisor);
    if (read(kBaudDivisor) != divisor.divisor) return std::unexpected(Errc::port_gone);
    write(kControl, kTransmitEnable | kReceiveEnable);
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
    write(kControl, kReceiveEnable);
    write(kControl, kTransmitEnable | kReceiveEnable);
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

 private:
  // Offsets.
  static constexpr std::size_t kData = 0x00;
  static constexpr std::size_t kState = 0x04;
  static constexpr std::size_t kControl = 0x08;
  static constexpr std::size_t kBaudDivisor = 0x10;
  // State; the overruns are cleared by writing 1.
  static constexpr std::uint32_t kSendFull = 1U << 0;
  static constexpr std::uint32_t kReceiveFull = 1U << 1;
  static constexpr std::uint32_t kSendOverrun = 1U << 2;
  static constexpr std::uint32_t kReceiveOverrun = 1U << 3;
  // Control.
  static constexpr std::uint32_t kTransmitEnable = 1U << 0;
  static constexpr std::uint32_t kReceiveEnable = 1U << 1;

  static constexpr std::uint32_t kNobody = 0xFFFF'FFFF;

  [[nodiscard]] std::uint32_t read(std::size_t offset) noexcept { return registers_.read32(offset); }
  void write(std::size_t offset, std::uint32_t value) noexcept { registers_.write32(offset, value); }

  R registers_;
};

static_assert(PolledUart<CmsdkUart<VolatileRegisters>>);

}  // namespace tm485::mcu
