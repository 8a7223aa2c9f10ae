// DmaUart: a UART whose bytes two DMA channels move, as the register driver of an InterruptUartPort. Two interrupts a
// cycle are left: transmission-complete, which releases the driver, and silence behind the reply. Specification: section 1.
//
//   InterruptUartPort<DmaUart<Stm32UsartV2<R>, Tx, Rx>, AutomaticDirection> port(DmaUart(uart, tx, rx));
//
// The reply is known when the line has been silent for a character's time: put that into the port's latency allowance.
// Whoever sends more than kRing bytes without a pause loses bytes unseen, unless the channel's half and full interrupts
// call on_interrupt() as well.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <utility>

#include "tm485/errc.hpp"
#include "tm485/mcu/baud.hpp"
#include "tm485/mcu/dma_channel.hpp"
#include "tm485/mcu/interrupt_uart.hpp"
#include "tm485/mcu/polled_uart.hpp"

namespace tm485::mcu {

/// What was due, all of it acknowledged.
struct DmaEvents {
  bool complete = false;  ///< the last stop bit has left
  bool framing = false;   ///< a character without a stop bit has come
  bool overrun = false;
  bool gone = false;  ///< the block answers no more
};

/// What DmaUart needs from a UART's register driver.
template <class U>
concept DmaCapable = PolledUart<U> && requires(U& uart) {
  requires U::kTellsCompletion;
  /// The next configure() switches the requests of both channels on.
  { uart.use_dma() } noexcept -> std::same_as<void>;
  /// Either context, while nothing is being sent: the interrupts of silence and of errors on, that of completion off.
  { uart.listen_dma() } noexcept -> std::same_as<void>;
  /// Owner: a transmission-complete of before is cleared.
  { uart.prepare_dma() } noexcept -> std::same_as<void>;
  /// Owner, one register access: the interrupt of transmission-complete on as well.
  { uart.await_dma() } noexcept -> std::same_as<void>;
  /// Interrupt.
  { uart.take_dma_events() } noexcept -> std::same_as<DmaEvents>;
};

/// Two contexts, as InterruptUart has them. Neither copied nor moved once it is set up: the DMA writes into it.
template <DmaCapable U, SendDma Tx, ReceiveDma Rx>
class DmaUart {
 public:
  static constexpr BaudFamily kFamily = U::kFamily;
  static constexpr bool kHidesLastCharacter = false;
  static constexpr bool kTellsCompletion = true;
  /// The longest exchange has 15 bytes, with its echo.
  static constexpr std::size_t kRing = 32;

  explicit DmaUart(U uart, Tx send, Rx receive) noexcept
      : uart_(std::move(uart)), send_(std::move(send)), receive_(std::move(receive)) {}

  /// Errors: those of the driver's configure().
  [[nodiscard]] std::expected<void, Errc> configure(const BaudDivisor& divisor) noexcept {
    shut_down();
    uart_.use_dma();
    if (const auto done = uart_.configure(divisor); !done) return done;
    taken_ = 0;
    found_ = {};
    receive_.start(ring_);
    return {};
  }

  /// The DMA has all of the request: nothing is left to write.
  [[nodiscard]] bool try_write(std::uint8_t) noexcept { return false; }
  [[nodiscard]] bool transmitter_idle() noexcept { return uart_.transmitter_idle(); }
  void drop_unsent() noexcept {
    send_.stop();
    uart_.drop_unsent();
  }

  /// Interrupt. The next byte that the DMA has moved, then what is wrong, once.
  [[nodiscard]] ReceivedCharacter try_read() noexcept {
    if (found_.gone) [[unlikely]]
      return {.fault = Errc::port_gone};
    if (taken_ != (kRing - receive_.remaining()) % kRing) {
      const volatile std::uint8_t& moved = ring_[taken_];
      const ReceivedCharacter character{.present = true, .byte = moved};
      taken_ = (taken_ + 1) % kRing;
      return character;
    }
    if (std::exchange(found_.framing, false)) [[unlikely]]
      return {.fault = Errc::framing_error};
    return {};
  }

  [[nodiscard]] bool take_overrun() noexcept { return std::exchange(found_.overrun, false); }

  void shut_down() noexcept {
    uart_.shut_down();
    send_.stop();
    receive_.stop();
  }

  // Interrupts, see InterruptUart.
  void listen() noexcept { uart_.listen_dma(); }

  /// The whole request.
  void begin(std::span<const std::uint8_t> request) noexcept {
    uart_.prepare_dma();
    send_.start(request);
    uart_.await_dma();
  }

  [[nodiscard]] TransmitEvents take_events() noexcept {
    const DmaEvents events = uart_.take_dma_events();
    found_.framing |= events.framing;
    found_.overrun |= events.overrun || receive_.failed();
    found_.gone |= events.gone;
    return {.complete = events.complete};
  }

  void await_completion() noexcept {}

 private:
  U uart_;
  Tx send_;
  Rx receive_;
  std::array<std::uint8_t, kRing> ring_{};
  // Of the interrupt.
  std::size_t taken_ = 0;
  DmaEvents found_;
};

}  // namespace tm485::mcu
