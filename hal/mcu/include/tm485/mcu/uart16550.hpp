// Uart16550: the register driver of 16550-compatible UARTs, polled. Registers: National PC16550D, chapter 8.
// Specification: section 1.
//
// LSR is cleared by reading it, whoever asks: what it said is kept until the character that it belongs to is read.
// The standard has no driver-enable output; RTS is an output that software may use as one.
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

/// How the block lies in the address space.
struct Layout16550 {
  std::uint8_t shift = 0;  ///< register n is at n << shift: 0, 1 or 2
  std::uint8_t width = 1;  ///< bytes an access: 1, 2 or 4, not more than 1 << shift

  [[nodiscard]] constexpr bool valid() const noexcept {
    return shift <= 2 && (width == 1 || width == 2 || width == 4) && width <= (1U << shift);
  }
  [[nodiscard]] constexpr std::size_t span() const noexcept { return std::size_t{8} << shift; }
};

/// One owner. No function waits.
template <RegisterAccess R>
class Uart16550 {
 public:
  static constexpr bool kHidesLastCharacter = false;
  static constexpr BaudFamily kFamily = BaudFamily::ns16550;

  /// `layout` must be valid.
  explicit Uart16550(R registers, Layout16550 layout = {}) noexcept
      : registers_(std::move(registers)), layout_(layout) {}

  /// Refuses a block without working FIFOs (a 16450, or a 16550 without A) with bad_argument: it would lose bytes.
  [[nodiscard]] std::expected<void, Errc> configure(const BaudDivisor& divisor) noexcept {
    const auto low = static_cast<std::uint8_t>(divisor.divisor & 0xFFU);
    const auto high = static_cast<std::uint8_t>(divisor.divisor >> 8U);
    write(kLineControl, kEightBits);
    write(kInterruptEnable, 0);
    write(kFifoControl, kFifoEnable | kClearReceiver | kClearTransmitter);
    modem_ = 0;
    write(kModemControl, modem_);
    write(kLineControl, kEightBits | kDivisorAccess);
    write(kDivisorLow, low);
    write(kDivisorHigh, high);
    const bool taken = read(kDivisorLow) == low && read(kDivisorHigh) == high;
    write(kLineControl, kEightBits);
    if (!taken || read(kLineControl) != kEightBits) return std::unexpected(Errc::port_gone);
    if ((read(kInterruptIdentity) & kFifosWork) != kFifosWork) return std::unexpected(Errc::bad_argument);
    (void)read(kLineStatus);
    said_ = 0;
    return {};
  }

  /// FIFOs have 16 characters or more, and the standard has no flag for a full one: the first byte waits until the
  /// FIFO is empty, those behind it are counted.
  [[nodiscard]] bool try_write(std::uint8_t byte) noexcept {
    if (room_ == 0) {
      if ((line_status() & kHoldingEmpty) == 0) return false;
      room_ = kDepth;
    }
    --room_;
    write(kData, byte);
    return true;
  }

  [[nodiscard]] bool transmitter_idle() noexcept {
    const bool idle = (line_status() & kTransmitterEmpty) != 0;
    if (idle) room_ = kDepth;
    return idle;
  }

  void drop_unsent() noexcept {
    write(kFifoControl, kFifoEnable | kClearTransmitter);
    room_ = 0;
  }

  [[nodiscard]] ReceivedCharacter try_read() noexcept {
    const std::uint8_t status = line_status();
    if (status == kNobody) [[unlikely]]
      return {.fault = Errc::port_gone};
    if ((status & kDataReady) == 0) [[likely]]
      return {};
    ReceivedCharacter character{.present = true, .byte = read(kData)};
    if ((said_ & (kFraming | kBreak | kParity)) != 0) [[unlikely]]
      character.fault = Errc::framing_error;
    said_ = static_cast<std::uint8_t>(said_ & kOverrun);
    return character;
  }

  [[nodiscard]] bool take_overrun() noexcept {
    const bool lost = (said_ & kOverrun) != 0;
    said_ = static_cast<std::uint8_t>(said_ & ~kOverrun);
    return lost;
  }

  void set_rts(bool on) noexcept {
    modem_ = on ? kRequestToSend : std::uint8_t{0};
    write(kModemControl, modem_);
  }

  /// The block has no switch for that: RTS off, and the FIFOs emptied.
  void shut_down() noexcept {
    set_rts(false);
    write(kFifoControl, kFifoEnable | kClearReceiver | kClearTransmitter);
  }

 private:
  // Numbers of the registers.
  static constexpr std::size_t kData = 0;
  static constexpr std::size_t kDivisorLow = 0;
  static constexpr std::size_t kInterruptEnable = 1;
  static constexpr std::size_t kDivisorHigh = 1;
  static constexpr std::size_t kFifoControl = 2;        // written
  static constexpr std::size_t kInterruptIdentity = 2;  // read
  static constexpr std::size_t kLineControl = 3;
  static constexpr std::size_t kModemControl = 4;
  static constexpr std::size_t kLineStatus = 5;
  // FIFO control.
  static constexpr std::uint8_t kFifoEnable = 1U << 0;
  static constexpr std::uint8_t kClearReceiver = 1U << 1;
  static constexpr std::uint8_t kClearTransmitter = 1U << 2;
  // Interrupt identity.
  static constexpr std::uint8_t kFifosWork = 3U << 6;
  // Line control.
  static constexpr std::uint8_t kEightBits = 3;
  static constexpr std::uint8_t kDivisorAccess = 1U << 7;
  // Modem control.
  static constexpr std::uint8_t kRequestToSend = 1U << 1;
  // Line status.
  static constexpr std::uint8_t kDataReady = 1U << 0;
  static constexpr std::uint8_t kOverrun = 1U << 1;
  static constexpr std::uint8_t kParity = 1U << 2;
  static constexpr std::uint8_t kFraming = 1U << 3;
  static constexpr std::uint8_t kBreak = 1U << 4;
  static constexpr std::uint8_t kHoldingEmpty = 1U << 5;
  static constexpr std::uint8_t kTransmitterEmpty = 1U << 6;
  static constexpr std::uint8_t kNobody = 0xFF;

  static constexpr std::uint8_t kDepth = 16;

  [[nodiscard]] std::uint8_t line_status() noexcept {
    const std::uint8_t status = read(kLineStatus);
    said_ = static_cast<std::uint8_t>(said_ | (status & (kOverrun | kParity | kFraming | kBreak)));
    return status;
  }

  [[nodiscard]] std::uint8_t read(std::size_t number) noexcept {
    const std::size_t offset = number << layout_.shift;
    if (layout_.width == 4) return static_cast<std::uint8_t>(registers_.read32(offset) & 0xFFU);
    if (layout_.width == 2) return static_cast<std::uint8_t>(registers_.read16(offset) & 0xFFU);
    return registers_.read8(offset);
  }
  void write(std::size_t number, std::uint8_t value) noexcept {
    const std::size_t offset = number << layout_.shift;
    if (layout_.width == 4) return registers_.write32(offset, value);
    if (layout_.width == 2) return registers_.write16(offset, value);
    registers_.write8(offset, value);
  }

  R registers_;
  Layout16550 layout_;
  std::uint8_t modem_ = 0;
  std::uint8_t said_ = 0;  ///< error bits of LSR that no character has taken
  std::uint8_t room_ = 0;  ///< characters that the transmit FIFO has room for, at least
};

static_assert(PolledUart<Uart16550<VolatileRegisters>>);

}  // namespace tm485::mcu
