// DirectedPort: a port whose RS-485 driver is switched by this program: on before the request, off when the transmitter
// is empty. Around any port that knows when its request has left (SerialPort).
//
//   idle -> driver on -> bytes to the kernel -> transmitter empty -> driver off -> sent
//
// The release cannot wait for the bus: it has microseconds, and a bus that waits for a reply may sleep until its
// deadline. So try_send() stays until the driver is off, for no longer than the request takes on the line and
// `release_wait` (docs/adr/0011-release-inside-try-send.md). What has not left by then is released by the next call of
// any of the port's functions, or given up after `give_up`. With a direction that needs no switching every call goes
// straight through. Specification: sections 1 and 4.
#pragma once

#include <cerrno>
#include <chrono>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>
#include <utility>

#include "tm485/bus/port.hpp"
#include "tm485/bus/statistics.hpp"
#include "tm485/errc.hpp"
#include "tm485/linux/clock.hpp"
#include "tm485/linux/rs485_direction.hpp"
#include "tm485/linux/time_histogram.hpp"
#include "tm485/time.hpp"

namespace tm485::linux_hal {

struct DirectedOptions {
  std::uint32_t bit_rate = 2'500'000;  ///< bit/s of the port, not 0: how long a request takes on the line
  /// After the request's last stop bit try_send() waits this long at most for the transmitter to be empty.
  Time release_wait = std::chrono::microseconds(50);
  /// A request that takes longer on the line (4 bytes below 80 kbit/s) is not waited for.
  Time longest_wait = std::chrono::microseconds(500);
  /// A transmitter that is not empty this long after the last stop bit will not be: the request is dropped, the driver
  /// released, and the send has failed.
  Time give_up = std::chrono::milliseconds(100);
};

/// Drops what the kernel has not sent yet. One system call.
void discard_output(int fd) noexcept;

/// One owner: the context of the bus. `P` has descriptor() besides the functions of a port; `Direction` and `Clock` are
/// of the kind of Rs485Direction and MonotonicClock, so that a test can have its own.
template <Port P, class Direction = Rs485Direction, class Clock = MonotonicClock>
class DirectedPort {
 public:
  /// `direction` belongs to the descriptor of `port`.
  DirectedPort(P port, Direction direction, const DirectedOptions& options = {}, Clock clock = {})
      : port_(std::move(port)),
        direction_(std::move(direction)),
        options_(options),
        clock_(std::move(clock)) {}

  DirectedPort(DirectedPort&&) noexcept = default;
  /// In this order: the direction is put back while its descriptor is open.
  DirectedPort& operator=(DirectedPort&& other) noexcept {
    if (this == &other) return *this;
    direction_ = std::move(other.direction_);
    port_ = std::move(other.port_);
    options_ = other.options_;
    clock_ = std::move(other.clock_);
    driving_ = other.driving_;
    line_gone_ = other.line_gone_;
    offset_ = other.offset_;
    request_end_ = other.request_end_;
    transmission_ = other.transmission_;
    release_times_ = other.release_times_;
    late_ = other.late_;
    last_errno_ = other.last_errno_;
    return *this;
  }

  /// That of the port behind it, with the direction's release bound; best effort if that is beyond kReleaseLimit.
  [[nodiscard]] PortCapability capability() const noexcept {
    PortCapability capability = port_.capability();
    const ReleaseBound& release = direction_.release_bound();
    if (release.bound > capability.release_bound) capability.release_bound = release.bound;
    if (release.bound > kReleaseLimit) capability.timing = TimingClass::best_effort;
    return capability;
  }

  /// As the port behind it; send_failed also if the driver cannot be switched or is still on, port_gone if its line is
  /// not there any more. Where this program
  /// switches: stays for the request's time on the line and `release_wait` at most.
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    if (line_gone_) [[unlikely]] {
      (void)settle();
      return std::unexpected(Errc::port_gone);
    }
    if (!direction_.by_software()) return port_.try_send(request, now);
    if (driving_ && !settle()) return std::unexpected(obstacle());
    offset_ = now - clock_.now();
    if (const int error_number = direction_.enable(); error_number != 0) {
      // Whether the line took the level is not known: off is the safe side.
      (void)release();
      return std::unexpected(fail(error_number));
    }
    driving_ = true;
    const auto start = port_.try_send(request, at());
    if (!start) {
      transmission_ = {Transmission::State::failed, start.error()};
      discard_output(port_.descriptor());  // what the port may have taken must not leave after the release
      (void)release();
      return start;
    }
    transmission_ = {Transmission::State::sending, Errc::ok};
    request_end_ = *start + Time{static_cast<std::int64_t>(request.size()) * kCharacterBits * kSecond /
                                 std::int64_t{options_.bit_rate}};
    if (request_end_ - *start > options_.longest_wait) return start;
    const Time limit = request_end_ + options_.release_wait;
    for (bool last = false; !settle() && !last;) last = at() >= limit;
    return start;
  }

  /// `sent` only after the release.
  [[nodiscard]] Transmission transmission(Time now) noexcept {
    if (!direction_.by_software()) return port_.transmission(now);
    (void)settle();
    return transmission_;
  }

  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    if (driving_) [[unlikely]]
      (void)settle();
    const Reception reception = port_.try_receive(buffer, now);
    if (reception.fault == Errc::port_gone && driving_) [[unlikely]]
      (void)settle();
    return reception;
  }

  /// What the driver has counted since the last call, if the port behind it can tell.
  [[nodiscard]] Errc line_fault() noexcept
    requires requires(P& port) { port.line_fault(); }
  {
    return port_.line_fault();
  }

  /// The port is gone, or the line that switches its driver: reopen() is the way back.
  [[nodiscard]] bool gone() const noexcept
    requires requires(const P& port) { port.gone(); }
  {
    return line_gone_ || port_.gone();
  }

  /// Releases the driver, what switches it and the device, so that they can be opened again. Nothing can be sent until
  /// reopen(). Owner; system calls.
  void let_go() noexcept {
    direction_.let_go();
    if constexpr (requires(P& port) { port.close(); }) port_.close();
    line_gone_ = true;
    driving_ = false;
    transmission_ = {};
  }

  /// As that of the port, with the direction made ready for the new descriptor. Errors: those of both; the port is
  /// closed then, and the next reopen() tries all of it again. Owner; allocates.
  [[nodiscard]] std::expected<void, OsError> reopen()
    requires requires(P& port) { port.reopen(); }
  {
    let_go();
    if (auto opened = port_.reopen(); !opened) return opened;
    auto ready = direction_.open_again(port_.descriptor());
    if (ready)
      line_gone_ = false;
    else
      let_go();
    return ready;
  }

  [[nodiscard]] P& port() noexcept { return port_; }
  [[nodiscard]] const P& port() const noexcept { return port_; }
  [[nodiscard]] const Direction& direction() const noexcept { return direction_; }
  /// True while the driver is on, or could not be switched off.
  [[nodiscard]] bool driving() const noexcept { return driving_; }
  /// From the computed end of the last stop bit until the driver was off, one for each request. The computed end is the
  /// earliest that it can be, so the real time is this or shorter. Empty if this program does not switch.
  [[nodiscard]] const TimeHistogram& release_times() const noexcept { return release_times_; }
  /// How many of them were beyond kReleaseLimit.
  [[nodiscard]] std::uint32_t late_releases() const noexcept { return late_; }
  /// errno of the last failed switching of the driver; 0: none.
  [[nodiscard]] int last_direction_errno() const noexcept { return last_errno_; }
  /// See direction_warning().
  [[nodiscard]] std::optional<std::string> warning() const {
    const bool measured = release_times_.count() != 0;
    return direction_warning(direction_.kind(), direction_.release_bound(),
                             measured ? std::optional(release_times_.maximum()) : std::nullopt);
  }

 private:
  static constexpr std::int64_t kCharacterBits = 10;
  static constexpr std::int64_t kSecond = 1'000'000'000;

  /// Now, in the time of whoever called try_send() last.
  [[nodiscard]] Time at() const noexcept { return clock_.now() + offset_; }

  /// The driver could not be switched; a line that is not there any more is as a port that is gone.
  Errc fail(int error_number) noexcept {
    last_errno_ = error_number;
    const bool gone = error_number == ENODEV || error_number == ENXIO || error_number == EBADF;
    line_gone_ = line_gone_ || gone;
    transmission_ = {Transmission::State::failed, gone ? Errc::port_gone : Errc::send_failed};
    return transmission_.fault;
  }

  /// Why nothing can be sent while the driver is on.
  [[nodiscard]] Errc obstacle() const noexcept {
    return transmission_.state == Transmission::State::failed ? transmission_.fault : Errc::send_failed;
  }

  [[nodiscard]] bool release() noexcept {
    const int error_number = direction_.release();
    driving_ = error_number != 0;
    if (driving_) fail(error_number);
    return !driving_;
  }

  /// Releases the driver if the request has left, has failed, or will not leave any more. True: the driver is off.
  [[nodiscard]] bool settle() noexcept {
    if (!driving_) return true;
    if (transmission_.state == Transmission::State::failed) return release();  // tried before
    const Transmission inner = port_.transmission(at());
    switch (inner.state) {
      case Transmission::State::sending:
        if (at() - request_end_ < options_.give_up) return false;
        discard_output(port_.descriptor());
        transmission_ = {Transmission::State::failed, Errc::send_failed};
        return release();
      case Transmission::State::sent: {
        if (!release()) return false;
        const Time after = at() - request_end_;
        release_times_.add(after);
        if (after > kReleaseLimit) saturating_increment(late_);
        transmission_ = inner;
        return true;
      }
      case Transmission::State::idle:
      case Transmission::State::failed:
        break;
    }
    transmission_ = {Transmission::State::failed, inner.fault == Errc::ok ? Errc::send_failed : inner.fault};
    return release();
  }

  P port_;
  Direction direction_;  ///< behind the port: it ends before the descriptor is closed
  DirectedOptions options_;
  Clock clock_;
  bool driving_ = false;
  bool line_gone_ = false;
  Time offset_{0};
  Time request_end_{0};
  Transmission transmission_;
  TimeHistogram release_times_;
  std::uint32_t late_ = 0;
  int last_errno_ = 0;
};

}  // namespace tm485::linux_hal
