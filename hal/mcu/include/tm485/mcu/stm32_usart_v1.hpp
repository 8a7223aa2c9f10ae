// Stm32UsartV1: the register driver of the USART of STM32F1, F2, F4 and L1, polled or by interrupt. Registers: ST
// RM0090, chapter 30. Specification: section 1.
//
// One character each way besides the shift registers: whoever polls it, or its interrupt, must come round within a
// character's time (4 us at 2.5 Mbit/s), or requests get gaps and replies lose bytes. It has no driver-enable output: a
// GPIO does it.
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

namespace tm485::mcu {

/// How many samples the receiver takes of a bit: 8 for clocks below 16 times the rate.
enum class Oversampling : std::uint8_t { by16, by8 };

/// BRR of a divisor: with 8 samples the fraction has three bits, and the fourth stays 0.
[[nodiscard]] constexpr std::uint32_t stm32_brr(std::uint32_t divisor, Oversampling samples) noexcept {
  return samples == Oversampling::by8 ? (divisor >> 3U) << 4U | (divisor & 7U) : divisor;
}

/// One owner. No function waits. Clocks and pins are the caller's affair.
template <RegisterAccess R, Oversampling S = Oversampling::by16>
class Stm32UsartV1 {
 public:
  static constexpr BaudFamily kFamily =
      S == Oversampling::by8 ? BaudFamily::stm32_over8 : BaudFamily::stm32_over16;
  static constexpr bool kHidesLastCharacter = false;
  static constexpr bool kTellsCompletion = true;

  explicit Stm32UsartV1(R registers) noexcept : registers_(std::move(registers)) {}

  /// Errors: port_gone if the registers do not keep what is written: the block's clock is off.
  [[nodiscard]] std::expected<void, Errc> configure(const BaudDivisor& divisor) noexcept {
    const std::uint32_t rate = stm32_brr(divisor.divisor, S);
    shut_down();
    write(kControl2, 0);  // one stop bit
    write(kControl3, dma_ ? kDmaSend | kDmaReceive | kErrorInterrupt : 0U);
    write(kBaudRate, rate);
    if (read(kBaudRate) != rate) return std::unexpected(Errc::port_gone);
    write(kControl1, kOn);
    (void)read(kStatus);
    (void)read(kData);  // what was there before, and its errors
    lost_ = false;
    return {};
  }

  /// The status is read before the data are written: this sequence also clears a transmission-complete of before.
  [[nodiscard]] bool try_write(std::uint8_t byte) noexcept {
    if ((status() & kTransmitEmpty) == 0) return false;
    write(kData, byte);
    return true;
  }

  [[nodiscard]] bool transmitter_idle() noexcept { return (status() & kTransmitComplete) != 0; }

  /// At most one character waits, and it cannot be taken back: the transmitter is switched off, which lets the one that
  /// is leaving finish.
  void drop_unsent() noexcept {
    const std::uint32_t control = read(kControl1);
    write(kControl1, control & ~kTransmitEnable);
    write(kControl1, control);
  }

  [[nodiscard]] ReceivedCharacter try_read() noexcept {
    const std::uint32_t status_now = status();
    if (status_now == kNobody) [[unlikely]]
      return {.fault = Errc::port_gone};
    if ((status_now & kReceived) == 0) [[likely]] {
      if ((status_now & kOverrun) != 0) (void)read(kData);  // came after the last read: only this clears it
      return {};
    }
    // Reading the data behind the status clears the errors.
    ReceivedCharacter character{.present = true, .byte = static_cast<std::uint8_t>(read(kData) & 0xFFU)};
    if ((status_now & kFraming) != 0) [[unlikely]]
      character.fault = Errc::framing_error;
    return character;
  }

  [[nodiscard]] bool take_overrun() noexcept { return std::exchange(lost_, false); }

  void shut_down() noexcept { write(kControl1, 0); }

  // Interrupts, see InterruptUart.
  void listen() noexcept { write(kControl1, kOn | kReceivedInterrupt); }

  /// The status is not read here: that would be half of what clears the receiver's errors. A transmission-complete of
  /// before is cleared by writing 0 to it instead.
  void begin(std::uint8_t byte, bool more) noexcept {
    write(kStatus, ~kTransmitComplete);
    write(kData, byte);
    write(kControl1,
          kOn | kReceivedInterrupt | (more ? kTransmitEmptyInterrupt : kTransmitCompleteInterrupt));
  }

  [[nodiscard]] TransmitEvents take_events() noexcept {
    const std::uint32_t on = read(kControl1) & (kTransmitEmptyInterrupt | kTransmitCompleteInterrupt);
    if (on == 0) [[likely]]
      return {};
    const std::uint32_t due = status() & on;  // each flag has the place of its switch
    return {.room = (due & kTransmitEmpty) != 0, .complete = (due & kTransmitComplete) != 0};
  }

  void await_completion() noexcept {
    write(kControl1, kOn | kReceivedInterrupt | kTransmitCompleteInterrupt);
  }

  // With two DMA channels, see DmaCapable. Silence: one character's time, which the block calls idle.
  void use_dma() noexcept { dma_ = true; }
  void listen_dma() noexcept { write(kControl1, kOn | kIdleInterrupt); }
  void prepare_dma() noexcept { write(kStatus, ~kTransmitComplete); }
  void await_dma() noexcept { write(kControl1, kOn | kIdleInterrupt | kTransmitCompleteInterrupt); }

  [[nodiscard]] DmaEvents take_dma_events() noexcept {
    const std::uint32_t on = read(kControl1);
    const std::uint32_t due = read(kStatus);
    // Reading the data behind the status clears them. What was received the DMA has taken long ago.
    if ((due & (kIdle | kFraming | kOverrun)) != 0) (void)read(kData);
    return {.complete = (due & on & kTransmitComplete) != 0,
            .framing = (due & kFraming) != 0,
            .overrun = (due & kOverrun) != 0,
            .gone = due == kNobody};
  }

 private:
  // Offsets.
  static constexpr std::size_t kStatus = 0x00;
  static constexpr std::size_t kData = 0x04;
  static constexpr std::size_t kBaudRate = 0x08;
  static constexpr std::size_t kControl1 = 0x0C;
  static constexpr std::size_t kControl2 = 0x10;
  static constexpr std::size_t kControl3 = 0x14;
  // Status.
  static constexpr std::uint32_t kFraming = 1U << 1;
  static constexpr std::uint32_t kOverrun = 1U << 3;
  static constexpr std::uint32_t kIdle = 1U << 4;
  static constexpr std::uint32_t kReceived = 1U << 5;
  static constexpr std::uint32_t kTransmitComplete = 1U << 6;
  static constexpr std::uint32_t kTransmitEmpty = 1U << 7;
  // Control 1.
  static constexpr std::uint32_t kReceiveEnable = 1U << 2;
  static constexpr std::uint32_t kTransmitEnable = 1U << 3;
  static constexpr std::uint32_t kIdleInterrupt = 1U << 4;
  static constexpr std::uint32_t kReceivedInterrupt = 1U << 5;
  static constexpr std::uint32_t kTransmitCompleteInterrupt = 1U << 6;
  static constexpr std::uint32_t kTransmitEmptyInterrupt = 1U << 7;
  static constexpr std::uint32_t kEnable = 1U << 13;
  static constexpr std::uint32_t kOver8 = 1U << 15;
  static constexpr std::uint32_t kOn =
      kEnable | kTransmitEnable | kReceiveEnable | (S == Oversampling::by8 ? kOver8 : 0U);
  // Control 3.
  static constexpr std::uint32_t kErrorInterrupt = 1U << 0;
  static constexpr std::uint32_t kDmaReceive = 1U << 6;
  static constexpr std::uint32_t kDmaSend = 1U << 7;

  static constexpr std::uint32_t kNobody = 0xFFFF'FFFF;

  /// An overrun goes with the next read of the data, whoever asked for the status: it is kept.
  [[nodiscard]] std::uint32_t status() noexcept {
    const std::uint32_t value = read(kStatus);
    if ((value & kOverrun) != 0) [[unlikely]]
      lost_ = true;
    return value;
  }
  [[nodiscard]] std::uint32_t read(std::size_t offset) noexcept { return registers_.read32(offset); }
  void write(std::size_t offset, std::uint32_t value) noexcept { registers_.write32(offset, value); }

  R registers_;
  bool lost_ = false;
  bool dma_ = false;
};

static_assert(DmaCapable<Stm32UsartV1<VolatileRegisters>>);
static_assert(InterruptUart<Stm32UsartV1<VolatileRegisters>>);

}  // namespace tm485::mcu
