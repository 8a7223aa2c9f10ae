// StreamPort: the port's contract over a byte stream that the kernel buffers: a tty, a pseudo-terminal or a
// stream socket. SerialPort and UnixPort open one and own it.
//
// The bytes are fetched by a non-blocking read() each time the bus asks: on a tty this read waits for
// the kernel's own hand-over of characters, which makes it the fastest way, faster than poll or epoll.
//
// Direction control: none here. The driver is switched by hardware (an adapter or UART that does it itself), by the
// kernel's driver (rs485_direction.hpp), or by the port around this one (directed_port.hpp).
// Specification: sections 1 and 4.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <utility>

#include "tm485/bus/port.hpp"
#include "tm485/errc.hpp"
#include "tm485/linux/line_counters.hpp"
#include "tm485/posix/file_descriptor.hpp"
#include "tm485/time.hpp"

namespace tm485::linux_hal {

enum class StreamKind : std::uint8_t { tty, socket };

/// One owner: the context of the bus. A tty's faults are counted from the construction on. After the other end is gone every function answers port_gone at once,
/// without a system call.
class StreamPort {
 public:
  /// Takes over an open, non-blocking descriptor. `bit_rate` (not 0): when a request is off the line.
  StreamPort(posix::FileDescriptor fd, StreamKind kind, std::uint32_t bit_rate,
             const PortCapability& capability) noexcept;

  [[nodiscard]] PortCapability capability() const noexcept { return capability_; }

  /// Hands the whole request to the kernel, as a rule in one write(). Answers `now`: an estimate of the first
  /// start bit, the earliest that it can be. Errors: send_failed (empty request, or the kernel has no room:
  /// what it has not taken is dropped, on a tty what it has taken too), port_gone. At most kSendAttempts system calls
  /// and one.
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept;

  /// `sent` once the characters' time has passed since try_send() and, on a tty, neither the driver's buffer nor the
  /// transmitter holds any. A driver that cannot tell of its transmitter and still had bytes in its buffer gets the
  /// characters' time once more from when the buffer was seen empty. `failed` after an error of try_send() or when the
  /// port is gone. At most two system calls while it is sending, none before and after.
  [[nodiscard]] Transmission transmission(Time now) noexcept;

  /// What the kernel has: one read(), repeated only if a signal interrupts it (at most kReadAttempts). Fault:
  /// port_gone on a hang-up, an end of stream or an error that a stream does not recover from.
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept;

  /// What the driver has counted since the last call, as the cause of the exchange that failed meanwhile: overrun,
  /// framing_error, or ok (nothing, or the driver does not count). For the cold path: one system call, and only on a
  /// tty whose driver counts.
  [[nodiscard]] Errc line_fault() noexcept;
  /// The faults since the port was made; a system call. Errors: ENOTTY or EINVAL (this driver does not count; the
  /// same answer from then on without a call), EIO and others when the port is gone.
  [[nodiscard]] std::expected<LineCounters, int> line_counters() const noexcept;

  /// Gives the descriptor up: from now on every function answers port_gone. A vanished device keeps its name as long
  /// as anybody has it open.
  void close() noexcept {
    mark_gone(last_errno_);
    fd_.close();
  }

  /// errno of the last failed system call; 0 if there was none, or if the other end closed in good order.
  [[nodiscard]] int last_errno() const noexcept { return last_errno_; }
  [[nodiscard]] bool gone() const noexcept { return gone_; }
  /// Stays owned by the port; -1 after a move.
  [[nodiscard]] int descriptor() const noexcept { return fd_.get(); }

  static constexpr int kSendAttempts = 8;
  static constexpr int kReadAttempts = 4;

 private:
  [[nodiscard]] std::ptrdiff_t write_some(std::span<const std::uint8_t> bytes) const noexcept;
  [[nodiscard]] bool line_is_idle(Time now) noexcept;
  [[nodiscard]] Errc fail_send(Errc fault) noexcept;
  void mark_gone(int error_number) noexcept;

  static constexpr std::int64_t kCharacterBits = 10;
  static constexpr std::int64_t kSecond = 1'000'000'000;

  posix::FileDescriptor fd_;
  StreamKind kind_;
  bool gone_ = false;
  int last_errno_ = 0;
  PortCapability capability_;
  Time character_;
  Time request_span_{0};  ///< of the request on the line
  Time request_end_{0};
  bool queued_ = false;  ///< the driver's buffer held bytes when last looked at
  Transmission transmission_;
  int not_counted_ = 0;  ///< the errno of a driver that does not count
  LineCounters at_start_;
  LineCounters seen_;
};

static_assert(Port<StreamPort>);

}  // namespace tm485::linux_hal
