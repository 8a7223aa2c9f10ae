// PolledUartPort: the port's contract over a UART that is polled, character by character: no interrupt, no wait for a
// receive time-out, no kernel. For a thread that spins on an isolated core, or a microcontroller.
//
//   idle -> leading (driver on, the lead passes) -> sending -> sent | failed
//
// Time comes with each call, so what has to happen later (the first byte after the lead, the release of the driver)
// happens at the first call of any function at or after its instant: the driver is released as late as the owner
// polls late. Specification: sections 1 and 4.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <utility>

#include "tm485/bus/port.hpp"
#include "tm485/errc.hpp"
#include "tm485/mcu/baud.hpp"
#include "tm485/mcu/direction.hpp"
#include "tm485/mcu/polled_uart.hpp"
#include "tm485/time.hpp"

namespace tm485::mcu {

struct PolledPortConfig {
  Time driver_lead{0};          ///< the driver is on this long before the first start bit, at least
  Time stuck_after{1'000'000};  ///< a transmitter not idle this long after its characters' time has failed
  /// With a UART that has a driver-enable output: how long after the last stop bit it is released, at most.
  Time hardware_release{0};
  PortCapability capability{};  ///< as the owner's loop can hold it; it never has wire timestamps
};

/// One owner: the context of the bus. No function waits; each takes a few register accesses a character.
template <PolledUart U, class D = AutomaticDirection>
  requires DirectionFor<D, U>
class PolledUartPort {
 public:
  /// Longest request: what the smallest FIFO of these blocks takes at once.
  static constexpr std::size_t kLongestRequest = 4;

  explicit PolledUartPort(U uart, D direction = {}, const PolledPortConfig& config = {}) noexcept
      : uart_(std::move(uart)), direction_(std::move(direction)), config_(config) {
    config_.capability.wire_timestamps = false;
  }

  /// Sets the UART up and takes the driver off the line. Errors: those of the driver's configure(), send_failed if the
  /// direction cannot be switched.
  [[nodiscard]] std::expected<void, Errc> start(const BaudDivisor& divisor) noexcept {
    character_ = divisor.character_time;
    // In 32 bits, and not in the cycle: some cores divide no more.
    constexpr std::uint32_t kBits = 10;
    bit_ = Time{static_cast<std::uint32_t>(character_.count()) / kBits};
    state_ = {};
    gone_ = false;
    stays_on_ = false;
    if (const auto done = uart_.configure(divisor); !done) return done;
    if (!direction_.drive(uart_, false)) return std::unexpected(Errc::send_failed);
    return {};
  }

  /// Takes the driver off the line and switches the UART off.
  void stop() noexcept {
    (void)direction_.drive(uart_, false);
    uart_.shut_down();
    release();  // switching off has let go of RTS, whatever that meant
    state_ = {};
  }

  [[nodiscard]] PortCapability capability() const noexcept { return config_.capability; }

  /// Switches the driver on and starts `request` (1 to 4 bytes) after the lead. Answers the earliest instant of the
  /// first start bit. Errors: send_failed (wrong length, the request before is still being sent, its driver is still on, the
  /// direction or the transmitter does not obey), port_gone.
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    step(now);
    if (gone_) [[unlikely]]
      return std::unexpected(Errc::port_gone);
    if (request.empty() || request.size() > kLongestRequest || busy() || stays_on_) [[unlikely]]
      return std::unexpected(Errc::send_failed);
    if (state_.state == State::failed && !uart_.transmitter_idle()) [[unlikely]]
      return std::unexpected(Errc::send_failed);
    if (!direction_.drive(uart_, true)) [[unlikely]] {
      fail();
      return std::unexpected(Errc::send_failed);
    }
    std::copy(request.begin(), request.end(), request_.begin());
    count_ = static_cast<std::uint8_t>(request.size());
    written_ = 0;
    state_ = {State::sending, Errc::ok};
    leading_ = true;
    start_ = now + config_.driver_lead;
    const Time start = start_;
    step(now);
    return start;
  }

  /// `sent`: the characters' time has passed, the transmitter says that the last stop bit has left, and the driver is
  /// off the line.
  [[nodiscard]] Transmission transmission(Time now) noexcept {
    step(now);
    return state_;
  }

  /// What the receiver has, in order. Faults: overrun, framing_error (a break too), port_gone.
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    step(now);
    if (gone_) [[unlikely]]
      return {.fault = Errc::port_gone};
    Reception reception;
    while (reception.count < buffer.size()) {
      const ReceivedCharacter character = uart_.try_read();
      if (character.fault != Errc::ok) [[unlikely]] {
        reception.fault = character.fault;
        if (character.fault == Errc::port_gone) {
          mark_gone();
          return reception;
        }
      }
      if (!character.present) break;
      buffer[reception.count++] = character.byte;
    }
    if (reception.count != 0 && uart_.take_overrun()) [[unlikely]]
      reception.fault = Errc::overrun;
    return reception;
  }

  /// From the earliest end of the last request's stop bit to the call that has released the driver: what the polling
  /// costs, an upper bound of the release time.
  [[nodiscard]] Time last_release() const noexcept { return last_release_; }
  [[nodiscard]] U& uart() noexcept { return uart_; }
  [[nodiscard]] D& direction() noexcept { return direction_; }

 private:
  using State = Transmission::State;

  [[nodiscard]] bool busy() const noexcept { return state_.state == State::sending; }

  void step(Time now) noexcept {
    if (stays_on_) [[unlikely]]
      release();
    if (busy()) advance(now);
  }

  /// Takes the driver off the line; if the direction refuses, the next call tries again.
  void release() noexcept { stays_on_ = !direction_.drive(uart_, false); }

  void advance(Time now) noexcept {
    if (leading_) {
      if (now < start_) return;
      leading_ = false;
      idle_since_ = kNever;
      end_ = now + character_ * static_cast<std::int64_t>(count_);
    }
    while (written_ != count_ && uart_.try_write(request_[written_])) ++written_;
    if (written_ == count_ && off_the_line(now) && direction_.drive(uart_, false)) {
      last_release_ = now - end_;
      state_ = {State::sent, Errc::ok};
      return;
    }
    if (now - end_ < config_.stuck_after) [[likely]]
      return;
    uart_.drop_unsent();
    fail();
  }

  /// True once the last stop bit has left and hardware, if it switches the driver, has released it.
  [[nodiscard]] bool off_the_line(Time now) noexcept {
    // A transmitter that says the truth need not be asked before the characters' time has passed.
    if (!U::kHidesLastCharacter && now < end_) return false;
    if (idle_since_ == kNever && uart_.transmitter_idle()) idle_since_ = now;
    // One bit more, since the answer is younger than `now`.
    const Time last = U::kHidesLastCharacter ? character_ + bit_ : Time{0};
    return idle_since_ != kNever && now >= end_ && now - idle_since_ >= last + config_.hardware_release;
  }

  /// Whatever went wrong, the line must not stay occupied.
  void fail() noexcept {
    release();
    state_ = {State::failed, Errc::send_failed};
  }

  void mark_gone() noexcept {
    gone_ = true;
    release();
    state_ = {State::failed, Errc::port_gone};
  }

  U uart_;
  D direction_;
  PolledPortConfig config_;
  Time character_{4'000};
  Time bit_{400};
  Transmission state_;
  bool leading_ = false;
  bool gone_ = false;
  bool stays_on_ = false;  ///< the direction has refused to take the driver off the line
  std::uint8_t count_ = 0;
  std::uint8_t written_ = 0;
  std::array<std::uint8_t, kLongestRequest> request_{};
  Time start_{0};             ///< while leading: when the first byte may leave
  Time idle_since_ = kNever;  ///< when the transmitter was first seen idle
  Time end_{0};               ///< earliest end of the last stop bit
  Time last_release_{0};
};

}  // namespace tm485::mcu
