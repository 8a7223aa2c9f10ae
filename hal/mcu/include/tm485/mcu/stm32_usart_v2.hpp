// Stm32UsartV2: the register driver of the USART of STM32F0, F3, F7, G0, G4, H7 and L4, polled or by interrupt. Registers:
// ST RM0440, chapter 37. Specification: section 1.
//
// Its driver-enable output switches the RS-485 driver by itself: on before the start bit, off behind the stop bit, each
// by up to 31 sample times. Use AutomaticDirection and the port's hardware_release with it. The FIFOs (G0, G4,
// H7: 8 or 16 characters) are on if asked for.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <utility>

#include "tm485/errc.hpp"
#include "tm485/mcu/baud.hpp"
#include "tm485/mcu/dma_uart.hpp"
#include "tm485/mcu/interrupt_uart.hpp"
#include "tm485/mcu/polled_uart.hpp"
#include "tm485/mcu/register_access.hpp"
#include "tm485/mcu/stm32_usart_v1.hpp"
#include "tm485/time.hpp"

namespace tm485::mcu {

struct Stm32V2Options {
  bool fifo = false;               ///< only where the chip has them
  bool driver_enable = true;       ///< the DE output (shared with RTS)
  bool driver_enable_low = false;  ///< DE is active low
  std::uint8_t assertion = 16;     ///< DE on before the start bit: 0 to 31 sample times (1/16 or 1/8 bit)
  std::uint8_t deassertion = 0;    ///< DE off behind the stop bit: the same unit
};

/// One owner. No function waits. Clocks and pins are the caller's affair.
template <RegisterAccess R, Oversampling S = Oversampling::by16>
class Stm32UsartV2 {
 public:
  static constexpr BaudFamily kFamily =
      S == Oversampling::by8 ? BaudFamily::stm32_over8 : BaudFamily::stm32_over16;
  static constexpr bool kHidesLastCharacter = false;
  static constexpr bool kTellsCompletion = true;

  explicit Stm32UsartV2(R registers, const Stm32V2Options& options = {}) noexcept
      : registers_(std::move(registers)), options_(options) {}

  /// What to put into the port's hardware_release, rounded up.
  [[nodiscard]] static constexpr Time release_time(const BaudDivisor& divisor,
                                                   const Stm32V2Options& options) noexcept {
    constexpr std::int64_t kSamples = S == Oversampling::by8 ? 80 : 160;  // a character
    return Time{(divisor.character_time.count() * options.deassertion + kSamples - 1) / kSamples};
  }

  /// Errors: port_gone if the registers do not keep what is written (the block's clock is off), bad_argument for times
  /// above 31 sample times, or a FIFO that the chip does not have.
  [[nodiscard]] std::expected<void, Errc> configure(const BaudDivisor& divisor) noexcept {
    if (options_.assertion > kLongest || options_.deassertion > kLongest)
      return std::unexpected(Errc::bad_argument);
    const std::uint32_t rate = stm32_brr(divisor.divisor, S);
    shut_down();
    write(kControl2, dma_ ? kTimeoutEnable : 0U);  // one stop bit
    write(kControl3, (options_.driver_enable ? kDriverEnable : 0U) |
                         (options_.driver_enable_low ? kDriverEnableLow : 0U) |
                         (dma_ ? kDmaSend | kDmaReceive | kErrorInterrupt : 0U));
    if (dma_) write(kTimeout, kSilence);
    write(kBaudRate, rate);
    if (read(kBaudRate) != rate) return std::unexpected(Errc::port_gone);
    const std::uint32_t control = kTransmitEnable | kReceiveEnable | (S == Oversampling::by8 ? kOver8 : 0U) |
                                  (options_.fifo ? kFifoEnable : 0U) |
                                  std::uint32_t{options_.assertion} << kAssertionShift |
                                  std::uint32_t{options_.deassertion} << kDeassertionShift;
    write(kControl1, control);  // the times can be set while it is off only
    on_ = control | kEnable;
    write(kControl1, on_);
    if (read(kControl1) != on_) return std::unexpected(Errc::bad_argument);
    write(kRequest, kDropReceived);
    write(kClear, kAllErrors | kTransmitCompleteClear);
    return {};
  }

  [[nodiscard]] bool try_write(std::uint8_t byte) noexcept {
    if ((read(kStatus) & kRoomToSend) == 0) return false;
    // A transmission-complete of before would be taken for that of this one.
    write(kClear, kTransmitCompleteClear);
    write(kSendData, byte);
    return true;
  }

  [[nodiscard]] bool transmitter_idle() noexcept { return (read(kStatus) & kTransmitComplete) != 0; }

  void drop_unsent() noexcept { write(kRequest, kDropUnsent); }

  [[nodiscard]] ReceivedCharacter try_read() noexcept {
    const std::uint32_t status = read(kStatus);
    if (status == kNobody) [[unlikely]]
      return {.fault = Errc::port_gone};
    if ((status & kReceived) == 0) [[likely]]
      return {};
    ReceivedCharacter character{.present = true};
    if ((status & kFraming) != 0) [[unlikely]] {
      character.fault = Errc::framing_error;
      write(kClear, kFramingClear);
    }
    character.byte = static_cast<std::uint8_t>(read(kReceiveData) & 0xFFU);
    return character;
  }

  [[nodiscard]] bool take_overrun() noexcept {
    if ((read(kStatus) & kOverrun) == 0) [[likely]]
      return false;
    write(kClear, kOverrunClear);
    return true;
  }

  void shut_down() noexcept { write(kControl1, 0); }

  // Interrupts, see InterruptUart.
  void listen() noexcept { write(kControl1, on_ | kReceivedInterrupt); }

  void begin(std::uint8_t byte, bool more) noexcept {
    write(kClear, kTransmitCompleteClear);
    write(kSendData, byte);
    write(kControl1, on_ | kReceivedInterrupt | (more ? kRoomInterrupt : kTransmitCompleteInterrupt));
  }

  [[nodiscard]] TransmitEvents take_events() noexcept {
    const std::uint32_t on = read(kControl1) & (kRoomInterrupt | kTransmitCompleteInterrupt);
    if (on == 0) [[likely]]
      return {};
    const std::uint32_t due = read(kStatus) & on;  // each flag has the place of its switch
    return {.room = (due & kRoomToSend) != 0, .complete = (due & kTransmitComplete) != 0};
  }

  void await_completion() noexcept {
    write(kControl1, on_ | kReceivedInterrupt | kTransmitCompleteInterrupt);
  }

  // With two DMA channels, see DmaCapable. Silence: the receiver's time-out, kSilence bits behind the last stop bit.
  void use_dma() noexcept { dma_ = true; }
  void listen_dma() noexcept { write(kControl1, on_ | kTimeoutInterrupt); }
  void prepare_dma() noexcept { write(kClear, kTransmitCompleteClear); }
  void await_dma() noexcept { write(kControl1, on_ | kTimeoutInterrupt | kTransmitCompleteInterrupt); }

  [[nodiscard]] DmaEvents take_dma_events() noexcept {
    const std::uint32_t on = read(kControl1);
    const std::uint32_t due = read(kStatus);
    const std::uint32_t found = due & (kTimedOut | kFraming | kOverrun);  // each is cleared in its place
    if (found != 0) write(kClear, found);
    return {.complete = (due & on & kTransmitComplete) != 0,
            .framing = (due & kFraming) != 0,
            .overrun = (due & kOverrun) != 0,
            .gone = due == kNobody};
  }

 private:
  // Offsets.
  static constexpr std::size_t kControl1 = 0x00;
  static constexpr std::size_t kControl2 = 0x04;
  static constexpr std::size_t kControl3 = 0x08;
  static constexpr std::size_t kBaudRate = 0x0C;
  static constexpr std::size_t kTimeout = 0x14;
  static constexpr std::size_t kRequest = 0x18;
  static constexpr std::size_t kStatus = 0x1C;
  static constexpr std::size_t kClear = 0x20;
  static constexpr std::size_t kReceiveData = 0x24;
  static constexpr std::size_t kSendData = 0x28;
  // Control 1.
  static constexpr std::uint32_t kEnable = 1U << 0;
  static constexpr std::uint32_t kReceiveEnable = 1U << 2;
  static constexpr std::uint32_t kTransmitEnable = 1U << 3;
  static constexpr std::uint32_t kReceivedInterrupt = 1U << 5;
  static constexpr std::uint32_t kTransmitCompleteInterrupt = 1U << 6;
  static constexpr std::uint32_t kRoomInterrupt = 1U << 7;
  static constexpr std::uint32_t kOver8 = 1U << 15;
  static constexpr unsigned kDeassertionShift = 16;
  static constexpr unsigned kAssertionShift = 21;
  static constexpr std::uint32_t kFifoEnable = 1U << 29;
  static constexpr std::uint32_t kTimeoutInterrupt = 1U << 26;
  // Control 2, and the time-out's bits: one character.
  static constexpr std::uint32_t kTimeoutEnable = 1U << 23;
  static constexpr std::uint32_t kSilence = 10;
  // Control 3.
  static constexpr std::uint32_t kErrorInterrupt = 1U << 0;
  static constexpr std::uint32_t kDmaReceive = 1U << 6;
  static constexpr std::uint32_t kDmaSend = 1U << 7;
  static constexpr std::uint32_t kDriverEnable = 1U << 14;
  static constexpr std::uint32_t kDriverEnableLow = 1U << 15;
  // Request.
  static constexpr std::uint32_t kDropReceived = 1U << 3;
  static constexpr std::uint32_t kDropUnsent = 1U << 4;
  // Status, and what clears it.
  static constexpr std::uint32_t kFraming = 1U << 1;
  static constexpr std::uint32_t kOverrun = 1U << 3;
  static constexpr std::uint32_t kReceived = 1U << 5;
  static constexpr std::uint32_t kTransmitComplete = 1U << 6;
  static constexpr std::uint32_t kRoomToSend = 1U << 7;
  static constexpr std::uint32_t kTimedOut = 1U << 11;
  static constexpr std::uint32_t kFramingClear = 1U << 1;
  static constexpr std::uint32_t kOverrunClear = 1U << 3;
  static constexpr std::uint32_t kTransmitCompleteClear = 1U << 6;
  static constexpr std::uint32_t kAllErrors = 0x0F;

  static constexpr std::uint8_t kLongest = 31;
  static constexpr std::uint32_t kNobody = 0xFFFF'FFFF;

  [[nodiscard]] std::uint32_t read(std::size_t offset) noexcept { return registers_.read32(offset); }
  void write(std::size_t offset, std::uint32_t value) noexcept { registers_.write32(offset, value); }

  R registers_;
  Stm32V2Options options_;
  bool dma_ = false;
  std::uint32_t on_ = 0;  ///< control 1 without interrupts
};

static_assert(DmaCapable<Stm32UsartV2<VolatileRegisters>>);
static_assert(InterruptUart<Stm32UsartV2<VolatileRegisters>>);

}  // namespace tm485::mcu
