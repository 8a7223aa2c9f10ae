// Pl011: the register driver of ARM's PL011 UART (and of those of Raspberry Pi, ST and others that are made after
// it), polled or by interrupt. Registers: ARM DDI 0183, chapter 3. Specification: section 1.
//
// Polled, the FIFOs are on: 16 or 32 characters each way, so a request goes in as a whole and leaves without a gap, and
// a reply waits for a late reader. Each character is there as soon as its stop bit is: FR shows the very first one,
// while the interrupts would wait for half a FIFO or 32 bit times of silence. By interrupt they are off, and the
// interrupt must come round within a character's time. There is none for the end of the last stop bit.
//
// It has no driver-enable output. RTS is an output that software may use as one.
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

/// on: for who polls. off: for interrupts.
enum class Pl011Fifos : std::uint8_t { on, off };

/// One owner. No function waits.
template <RegisterAccess R, Pl011Fifos F = Pl011Fifos::on>
class Pl011 {
 public:
  static constexpr bool kHidesLastCharacter = false;
  static constexpr bool kTellsCompletion = false;
  static constexpr BaudFamily kFamily = BaudFamily::pl011;
  /// Bytes of address space from the block's start.
  static constexpr std::size_t kSpan = 0x1000;

  explicit Pl011(R registers) noexcept : registers_(std::move(registers)) {}

  [[nodiscard]] std::expected<void, Errc> configure(const BaudDivisor& divisor) noexcept {
    shut_down();
    write(kLineControl, 0);  // FIFOs off: empties them
    write(kInterruptMask, 0);
    write(kDmaControl, 0);
    write(kIntegerDivisor, divisor.divisor / kFractions);
    write(kFractionalDivisor, divisor.divisor % kFractions);
    write(kLineControl, kFormat);  // also takes over the divisor
    write(kErrorClear, 0);
    write(kInterruptClear, kAllInterrupts);
    if (read(kIntegerDivisor) != divisor.divisor / kFractions ||
        read(kFractionalDivisor) != divisor.divisor % kFractions || read(kLineControl) != kFormat)
      return std::unexpected(Errc::port_gone);
    control_ = kEnable | kTransmitEnable | kReceiveEnable;
    write(kControl, control_);
    if ((read(kControl) & control_) != control_) return std::unexpected(Errc::port_gone);
    return {};
  }

  [[nodiscard]] bool try_write(std::uint8_t byte) noexcept {
    if ((read(kFlags) & kTransmitFull) != 0) return false;
    write(kData, byte);
    return true;
  }

  /// BUSY covers the FIFO, the shift register and the stop bit.
  [[nodiscard]] bool transmitter_idle() noexcept { return (read(kFlags) & kBusy) == 0; }

  /// Switching the FIFOs off is the only way to empty one, and it empties both.
  void drop_unsent() noexcept {
    write(kLineControl, kEightBits | kFifoEnable);
    write(kLineControl, kEightBits);
    if constexpr (F == Pl011Fifos::on) write(kLineControl, kFormat);
  }

  [[nodiscard]] ReceivedCharacter try_read() noexcept {
    const std::uint32_t flags = read(kFlags);
    if ((flags & kReceiveEmpty) != 0) [[likely]]
      return {.fault = flags == kNobody ? Errc::port_gone : Errc::ok};
    const std::uint32_t data = read(kData);
    if (data == kNobody) [[unlikely]]
      return {.fault = Errc::port_gone};
    ReceivedCharacter character{.present = true, .byte = static_cast<std::uint8_t>(data & 0xFFU)};
    if ((data & (kFraming | kBreak | kParity)) != 0) [[unlikely]]
      character.fault = Errc::framing_error;
    return character;
  }

  /// The mark of an overrun travels with the next character that finds room, which may belong to the next reply. The
  /// raw interrupt status has it at once.
  [[nodiscard]] bool take_overrun() noexcept {
    if ((read(kRawInterrupts) & kOverrunInterrupt) == 0) [[likely]]
      return false;
    write(kErrorClear, 0);
    write(kInterruptClear, kOverrunInterrupt);
    return true;
  }

  void set_rts(bool on) noexcept {
    control_ = on ? control_ | kRequestToSend : control_ & ~kRequestToSend;
    write(kControl, control_);
  }

  void shut_down() noexcept {
    control_ = 0;
    write(kControl, 0);
  }

  // Interrupts, see InterruptUart.
  void listen() noexcept
    requires(F == Pl011Fifos::off)
  {
    write(kInterruptMask, kReceiveInterrupt);
  }

  /// The transmit interrupt is made by the holding register's running empty, so it cannot come before the byte is written.
  void begin(std::uint8_t byte, bool) noexcept
    requires(F == Pl011Fifos::off)
  {
    write(kInterruptClear, kTransmitInterrupt);
    write(kInterruptMask, kReceiveInterrupt | kTransmitInterrupt);
    write(kData, byte);
  }

  /// The receive interrupt goes with the read of the data.
  [[nodiscard]] TransmitEvents take_events() noexcept
    requires(F == Pl011Fifos::off)
  {
    if ((read(kMaskedInterrupts) & kTransmitInterrupt) == 0) [[likely]]
      return {};
    write(kInterruptClear, kTransmitInterrupt);
    return {.room = true};
  }

  void await_completion() noexcept
    requires(F == Pl011Fifos::off)
  {}

 private:
  // Offsets.
  static constexpr std::size_t kData = 0x00;
  static constexpr std::size_t kErrorClear = 0x04;
  static constexpr std::size_t kFlags = 0x18;
  static constexpr std::size_t kIntegerDivisor = 0x24;
  static constexpr std::size_t kFractionalDivisor = 0x28;
  static constexpr std::size_t kLineControl = 0x2C;
  static constexpr std::size_t kControl = 0x30;
  static constexpr std::size_t kInterruptMask = 0x38;
  static constexpr std::size_t kRawInterrupts = 0x3C;
  static constexpr std::size_t kMaskedInterrupts = 0x40;
  static constexpr std::size_t kInterruptClear = 0x44;
  static constexpr std::size_t kDmaControl = 0x48;
  // Data: what came with the character.
  static constexpr std::uint32_t kFraming = 1U << 8;
  static constexpr std::uint32_t kParity = 1U << 9;
  static constexpr std::uint32_t kBreak = 1U << 10;
  // Flags.
  static constexpr std::uint32_t kBusy = 1U << 3;
  static constexpr std::uint32_t kReceiveEmpty = 1U << 4;
  static constexpr std::uint32_t kTransmitFull = 1U << 5;
  // Line control.
  static constexpr std::uint32_t kFifoEnable = 1U << 4;
  static constexpr std::uint32_t kEightBits = 3U << 5;
  static constexpr std::uint32_t kFormat = kEightBits | (F == Pl011Fifos::on ? kFifoEnable : 0U);
  // Control.
  static constexpr std::uint32_t kEnable = 1U << 0;
  static constexpr std::uint32_t kTransmitEnable = 1U << 8;
  static constexpr std::uint32_t kReceiveEnable = 1U << 9;
  static constexpr std::uint32_t kRequestToSend = 1U << 11;
  // Interrupts.
  static constexpr std::uint32_t kReceiveInterrupt = 1U << 4;
  static constexpr std::uint32_t kTransmitInterrupt = 1U << 5;
  static constexpr std::uint32_t kOverrunInterrupt = 1U << 10;
  static constexpr std::uint32_t kAllInterrupts = 0x7FF;

  static constexpr std::uint32_t kFractions = 64;
  static constexpr std::uint32_t kNobody = 0xFFFF'FFFF;  ///< what a bus reads where nothing answers

  [[nodiscard]] std::uint32_t read(std::size_t offset) noexcept { return registers_.read32(offset); }
  void write(std::size_t offset, std::uint32_t value) noexcept { registers_.write32(offset, value); }

  R registers_;
  std::uint32_t control_ = 0;
};

static_assert(PolledUart<Pl011<VolatileRegisters>>);
static_assert(InterruptUart<Pl011<VolatileRegisters, Pl011Fifos::off>>);

}  // namespace tm485::mcu
