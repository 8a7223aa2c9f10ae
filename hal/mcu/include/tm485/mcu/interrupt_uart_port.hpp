// InterruptUartPort: the port's contract over a UART whose interrupt does the work, for a microcontroller.
//
//   idle -> leading (driver on, the lead passes) -> sending -> [finishing] -> sent | failed
//
// Two contexts meet here, on one core:
//   * the owner, which has the bus: start, stop, try_send, transmission, try_receive;
//   * the interrupt: on_interrupt, on_timer. Its priority is the owner's or higher, never lower; the two do not
//     interrupt each other.
// They share a ring of received characters and the phase of the request, by loads and stores only. While a request is
// being sent the transmitter is the interrupt's, otherwise the owner's; one register access hands it over.
//
// The driver is released in the interrupt of transmission-complete. On a block without one a timer does it (T), or, with
// NoTimer, the owner's next call: the driver is then on the line as long as that is late. Specification: sections 1, 4.
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
#include "tm485/mcu/interrupt_atomics.hpp"
#include "tm485/mcu/interrupt_uart.hpp"
#include "tm485/mcu/one_shot_timer.hpp"
#include "tm485/sync/spsc_ring.hpp"
#include "tm485/time.hpp"

namespace tm485::mcu {

struct InterruptPortConfig {
  Time driver_lead{0};          ///< the driver is on this long before the first start bit, at least
  Time stuck_after{1'000'000};  ///< a request not sent this long after its characters' time has failed
  /// With a UART that has a driver-enable output: how long after the last stop bit it is released, at most.
  Time hardware_release{0};
  PortCapability capability{};  ///< as the interrupt latency allows it; it never has wire timestamps
};

/// Neither copied nor moved: an interrupt knows where it is. No function waits.
template <InterruptUart U, class D = AutomaticDirection, OneShotTimerOrNone T = NoTimer,
          class Atomics = InterruptAtomics>
  requires DirectionFor<D, U>
class InterruptUartPort {
 public:
  static constexpr BaudFamily kFamily = U::kFamily;
  static constexpr std::size_t kLongestRequest = 4;
  /// Characters that wait for the owner. The longest exchange, with the echo of its request, has 15.
  static constexpr std::uint32_t kRoom = 16;

  explicit InterruptUartPort(U uart, D direction = {}, const InterruptPortConfig& config = {},
                             T timer = {}) noexcept
      : uart_(std::move(uart)),
        direction_(std::move(direction)),
        config_(config),
        timer_(std::move(timer)),
        consumer_(ring_),
        producer_(ring_) {
    config_.capability.wire_timestamps = false;
  }
  InterruptUartPort(const InterruptUartPort&) = delete;
  InterruptUartPort& operator=(const InterruptUartPort&) = delete;

  /// Sets the UART up, takes the driver off the line and switches the receive interrupt of the block on. Owner, with the
  /// interrupt masked at the interrupt controller; unmask it afterwards. Errors: those of the driver's configure(),
  /// send_failed if the direction cannot be switched.
  [[nodiscard]] std::expected<void, Errc> start(const BaudDivisor& divisor) noexcept {
    character_ = divisor.character_time;
    constexpr std::uint32_t kBits = 10;
    bit_ =
        Time{static_cast<std::uint32_t>(character_.count()) / kBits};  // 32 bits: some cores divide no more
    set_phase(Phase::idle);
    gone_.store(0, Atomics::kRelaxed);
    fault_ = Errc::ok;
    stays_on_ = false;
    if (const auto done = uart_.configure(divisor); !done) return done;
    if (!direction_.drive(uart_, false)) return std::unexpected(Errc::send_failed);
    ReceivedCharacter old;
    while (consumer_.try_pop(old)) {
    }
    lost_seen_ = lost_.load(Atomics::kAcquire);
    uart_.listen();
    return {};
  }

  /// Takes the driver off the line and switches the UART and its interrupts off. Owner, with the interrupt masked at the
  /// interrupt controller.
  void stop() noexcept {
    set_phase(Phase::idle);
    (void)direction_.drive(uart_, false);
    uart_.shut_down();
    release();  // switching off has let go of RTS, whatever that meant
  }

  /// Owner.
  [[nodiscard]] PortCapability capability() const noexcept { return config_.capability; }

  /// Owner. Switches the driver on and starts `request` (1 to 4 bytes) after the lead. Answers the earliest instant of the
  /// first start bit. Errors: send_failed (wrong length, the request before is still being sent, its driver is still on,
  /// the direction or the transmitter does not obey), port_gone.
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    step(now);
    const Phase before = phase();
    if (before == Phase::failed && fault_ == Errc::port_gone) [[unlikely]]
      return std::unexpected(Errc::port_gone);
    if (request.empty() || request.size() > kLongestRequest || busy(before, now) || stays_on_) [[unlikely]]
      return std::unexpected(Errc::send_failed);
    if (before == Phase::failed && !uart_.transmitter_idle()) [[unlikely]]
      return std::unexpected(Errc::send_failed);
    if (!direction_.drive(uart_, true)) [[unlikely]] {
      fail(Errc::send_failed);
      return std::unexpected(Errc::send_failed);
    }
    std::copy(request.begin(), request.end(), request_.begin());
    count_ = static_cast<std::uint8_t>(request.size());
    const Time start = now + config_.driver_lead;
    start_ = start;
    span_ = character_ * static_cast<std::int64_t>(count_);
    deadline_ = start + span_ + config_.stuck_after;
    if (config_.driver_lead == Time{0}) {
      launch(now);
    } else {
      set_phase(Phase::leading);
      arm(config_.driver_lead);
    }
    return start;
  }

  /// Owner. `sent`: the last stop bit has left and the driver is off the line.
  [[nodiscard]] Transmission transmission(Time now) noexcept {
    step(now);
    const Phase at = phase();
    if (busy(at, now)) return {State::sending, Errc::ok};
    if (at == Phase::sent) return {State::sent, Errc::ok};
    if (at == Phase::failed) return {State::failed, fault_};
    return {};
  }

  /// Owner. What the interrupt has received, in order, up to the first character with a fault. Faults: framing_error (a
  /// break too), overrun (of the UART: where it happened; of this port's ring: at once), port_gone.
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    step(now);
    if (gone_.load(Atomics::kAcquire) != 0) [[unlikely]]
      return {.fault = Errc::port_gone};
    Reception reception;
    ReceivedCharacter character;
    while (reception.count < buffer.size() && consumer_.try_pop(character)) {
      if (character.present) buffer[reception.count++] = character.byte;
      reception.fault = character.fault;
      if (character.fault != Errc::ok) [[unlikely]]
        return reception;
    }
    // acquire: pairs with the release in lose().
    const std::uint32_t lost = lost_.load(Atomics::kAcquire);
    if (lost != lost_seen_) [[unlikely]] {
      lost_seen_ = lost;
      reception.fault = Errc::overrun;
    }
    return reception;
  }

  /// Interrupt: the body of the UART's. Releases the driver, feeds the transmitter, takes what was received: some ten
  /// register accesses and those of each character. `now` is read at its beginning. A call without cause is harmless, so
  /// the owner may call it where interrupts do not come, with the UART's interrupt masked.
  void on_interrupt(Time now) noexcept {
    const TransmitEvents events = uart_.take_events();
    if (events.room || events.complete) serve(events, now);
    receive();
  }

  /// Interrupt: the body of the one-shot timer's. A call without cause is harmless.
  void on_timer(Time now) noexcept
    requires OneShotTimer<T>
  {
    on_instant(now);
  }

  /// Owner, after `sent`. From the earliest end of the last request's stop bit to the call that has released the driver.
  [[nodiscard]] Time last_release() const noexcept { return last_release_; }
  /// Owner, for what does not touch the block while it is under way.
  [[nodiscard]] U& uart() noexcept { return uart_; }
  [[nodiscard]] D& direction() noexcept { return direction_; }
  [[nodiscard]] T& timer() noexcept { return timer_; }

 private:
  using State = Transmission::State;

  enum class Phase : std::uint32_t {
    idle,
    leading,    // the lead passes; of the timer, or without one of the owner
    sending,    // of the interrupt
    finishing,  // the last character leaves, unobserved; of the timer, or without one of the owner
    releasing,  // the direction has refused to release the driver; of the owner
    sent,       // of the owner from here on
    failed,
  };

  static constexpr bool kHasTimer = OneShotTimer<T>;
  static constexpr bool kTellsCompletion = U::kTellsCompletion;

  // acquire and release: whoever sees a phase sees what was written before it was set.
  [[nodiscard]] Phase phase() const noexcept { return static_cast<Phase>(phase_.load(Atomics::kAcquire)); }
  void set_phase(Phase phase) noexcept { phase_.store(static_cast<std::uint32_t>(phase), Atomics::kRelease); }

  /// On its way, or the hardware has yet to let go of the driver.
  [[nodiscard]] bool busy(Phase at, Time now) const noexcept {
    if (at == Phase::sent) return now < released_at_;
    return at != Phase::idle && at != Phase::failed;
  }

  /// Owner: what is due.
  void step(Time now) noexcept {
    if (gone_.load(Atomics::kAcquire) != 0 && (phase() != Phase::failed || fault_ != Errc::port_gone))
        [[unlikely]]
      fail(Errc::port_gone);
    if (stays_on_) [[unlikely]]
      release();
    const Phase at = phase();
    if (at == Phase::idle || at == Phase::sent || at == Phase::failed) return;
    if constexpr (!kHasTimer) on_instant(now);
    if (at == Phase::releasing) [[unlikely]]
      finish(now);
    if (now >= deadline_) [[unlikely]]
      give_up();
  }

  /// The timer, or without one the owner.
  void on_instant(Time now) noexcept {
    const Phase at = phase();
    if (at == Phase::leading) {
      if (now < start_) return arm(start_ - now);
      launch(now);
    } else if (at == Phase::finishing) {
      if (now < start_) return arm(start_ - now);
      if (!U::kHidesLastCharacter && !uart_.transmitter_idle()) {
        start_ = now + bit_;
        return arm(bit_);
      }
      finish(now);
    }
  }

  void arm([[maybe_unused]] Time span) noexcept {
    if constexpr (kHasTimer) timer_.arm(span);
  }

  /// Hands the transmitter to the interrupt: by the last access of begin(), to which the compiler must not defer
  /// anything that the interrupt reads.
  void launch(Time now) noexcept {
    end_ = now + span_;
    written_ = SendsRequests<U> ? count_ : 1;
    set_phase(Phase::sending);
    Atomics::fence();
    if constexpr (SendsRequests<U>) {
      uart_.begin(std::span<const std::uint8_t>(request_.data(), count_));
    } else {
      uart_.begin(request_[0], count_ > 1);
    }
  }

  /// Interrupt.
  void serve(TransmitEvents events, Time now) noexcept {
    if (phase() != Phase::sending) [[unlikely]]
      return uart_.listen();  // given up meanwhile
    while (written_ != count_ && uart_.try_write(request_[written_])) ++written_;
    if (written_ != count_) return;
    if constexpr (kTellsCompletion) {
      if (!events.complete) return uart_.await_completion();
      uart_.listen();
      finish(now);
    } else {
      // A block that tells when its buffer is empty only: the last character has begun at the earliest when it is.
      if (U::kHidesLastCharacter && !uart_.transmitter_idle()) return;
      uart_.listen();
      // One bit more, since the answer is younger than `now`.
      const Time span = U::kHidesLastCharacter ? character_ + bit_ : character_;
      start_ = now + span;
      set_phase(Phase::finishing);
      arm(span);
    }
  }

  /// The last stop bit has left. Interrupt, timer or owner, whoever the phase belongs to.
  void finish(Time now) noexcept {
    if (!direction_.drive(uart_, false)) [[unlikely]]
      return set_phase(Phase::releasing);
    last_release_ = now - end_;
    released_at_ = now + config_.hardware_release;
    set_phase(Phase::sent);
  }

  /// Interrupt. Bounded; a DMA channel may have moved more than the ring has room for.
  void receive() noexcept {
    for (std::uint32_t pass = 0; pass != 2 * kRoom; ++pass) {
      const ReceivedCharacter character = uart_.try_read();
      if (character.fault == Errc::port_gone) [[unlikely]]
        return gone_.store(1, Atomics::kRelease);
      if (!character.present && character.fault == Errc::ok) break;
      keep(character);
    }
    if (uart_.take_overrun()) [[unlikely]]
      keep({.fault = Errc::overrun});
  }

  void keep(const ReceivedCharacter& character) noexcept {
    if (!producer_.try_push(character)) [[unlikely]]
      lost_.store(++lost_count_, Atomics::kRelease);  // pairs with the acquire in try_receive()
  }

  /// Owner. The phase first: from then on the interrupt does no more than switch its transmit part off.
  void give_up() noexcept {
    set_phase(Phase::failed);
    Atomics::fence();
    uart_.listen();
    uart_.drop_unsent();
    fail(Errc::send_failed);
  }

  /// Owner. Whatever went wrong, the line must not stay occupied.
  void fail(Errc cause) noexcept {
    fault_ = cause;
    set_phase(Phase::failed);
    release();
  }

  /// Owner. If the direction refuses, the next call tries again.
  void release() noexcept { stays_on_ = !direction_.drive(uart_, false); }

  using Word = typename Atomics::template Atomic<std::uint32_t>;
  using Ring = SpscRing<ReceivedCharacter, kRoom, Atomics>;

  U uart_;
  D direction_;
  InterruptPortConfig config_;
  T timer_;
  // Set by start().
  Time character_{4'000};
  Time bit_{400};
  // Shared.
  Word phase_{static_cast<std::uint32_t>(Phase::idle)};
  Word gone_{0};
  Word lost_{0};  // characters that found no room in the ring
  Ring ring_;
  // Of the owner.
  Errc fault_ = Errc::ok;
  bool stays_on_ = false;  // the direction has refused to take the driver off the line
  std::uint32_t lost_seen_ = 0;
  Time deadline_{0};
  typename Ring::Consumer consumer_;
  // Of the interrupt.
  std::uint32_t lost_count_ = 0;
  typename Ring::Producer producer_;
  // Of whoever has the phase.
  std::uint8_t count_ = 0;
  std::uint8_t written_ = 0;
  std::array<std::uint8_t, kLongestRequest> request_{};
  Time span_{0};         // of the request's characters
  Time start_{0};        // when the first byte may leave; while finishing: when to look again
  Time end_{0};          // earliest end of the last stop bit
  Time released_at_{0};  // when hardware has released the driver as well
  Time last_release_{0};
};

}  // namespace tm485::mcu
