#include "tm485/linux/stream_port.hpp"

#include <sys/ioctl.h>
#include <sys/socket.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>

namespace tm485::linux_hal {
namespace {

/// The other end or the device is not there any more, and will not come back on this descriptor.
constexpr bool is_gone(int error_number) noexcept {
  switch (error_number) {
    case EIO:
    case ENXIO:
    case ENODEV:
    case EPIPE:
    case EBADF:
    case ECONNRESET:
    case ENOTCONN:
      return true;
    default:
      return false;
  }
}

constexpr bool is_full_or_empty(int error_number) noexcept {
  return error_number == EAGAIN || error_number == EWOULDBLOCK;
}

}  // namespace

StreamPort::StreamPort(posix::FileDescriptor fd, StreamKind kind, std::uint32_t bit_rate,
                       const PortCapability& capability) noexcept
    : fd_(std::move(fd)),
      kind_(kind),
      capability_(capability),
      character_(kCharacterBits * kSecond / std::int64_t{bit_rate}) {
  if (kind == StreamKind::socket) {
    not_counted_ = ENOTTY;
    return;
  }
  const auto counters = read_line_counters(fd_.get());
  if (counters)
    at_start_ = seen_ = *counters;
  else
    not_counted_ = counters.error();
}

std::expected<Time, Errc> StreamPort::try_send(std::span<const std::uint8_t> request, Time now) noexcept {
  if (gone_) return std::unexpected(Errc::port_gone);
  std::span<const std::uint8_t> rest = request;
  for (int attempt = 0; attempt < kSendAttempts && !rest.empty(); ++attempt) {
    const std::ptrdiff_t count = write_some(rest);
    if (count > 0) {
      rest = rest.subspan(static_cast<std::size_t>(count));
      continue;
    }
    const int error_number = count < 0 ? errno : EAGAIN;
    if (error_number == EINTR) continue;
    last_errno_ = error_number;
    if (is_gone(error_number)) {
      mark_gone(error_number);
      return std::unexpected(Errc::port_gone);
    }
    // Part of a request is of no use: try to complete it. One of which nothing has left is better dropped.
    if (!is_full_or_empty(error_number) || rest.size() == request.size()) break;
  }
  // The part that a tty has taken must not leave by itself; what a socket has taken is at the other end.
  if (!rest.empty() && rest.size() != request.size() && kind_ == StreamKind::tty)
    (void)ioctl(fd_.get(), TCFLSH, TCOFLUSH);
  if (!rest.empty() || request.empty()) return std::unexpected(fail_send(Errc::send_failed));
  transmission_ = {Transmission::State::sending, Errc::ok};
  request_span_ = character_ * static_cast<std::int64_t>(request.size());
  request_end_ = now + request_span_;
  queued_ = false;
  return now;
}

std::ptrdiff_t StreamPort::write_some(std::span<const std::uint8_t> bytes) const noexcept {
  if (kind_ == StreamKind::socket) return ::send(fd_.get(), bytes.data(), bytes.size(), MSG_NOSIGNAL);
  return ::write(fd_.get(), bytes.data(), bytes.size());
}

Transmission StreamPort::transmission(Time now) noexcept {
  if (transmission_.state == Transmission::State::sending && line_is_idle(now))
    transmission_.state = Transmission::State::sent;
  return transmission_;
}

bool StreamPort::line_is_idle(Time now) noexcept {
  if (kind_ == StreamKind::socket) return now >= request_end_;
  int queued = 0;
  if (ioctl(fd_.get(), TIOCOUTQ, &queued) != 0) {
    if (is_gone(errno)) mark_gone(errno);
    return !gone_ && now >= request_end_;  // a driver that cannot tell: the computed time has to do
  }
  if (queued > 0) {
    queued_ = true;
    return false;
  }
  // The queue does not count what is in the transmitter; drivers that can tell do so here.
  unsigned status = 0;
  if (ioctl(fd_.get(), TIOCSERGETLSR, &status) == 0)
    return (status & TIOCSER_TEMT) != 0 && now >= request_end_;
  // All of it may have gone from the buffer to the transmitter just now.
  if (queued_) request_end_ = now + request_span_;
  queued_ = false;
  return now >= request_end_;
}

Reception StreamPort::try_receive(std::span<std::uint8_t> buffer, Time) noexcept {
  if (gone_) return {.fault = Errc::port_gone};
  if (buffer.empty()) return {};  // read() would answer 0, which means the end of the stream
  for (int attempt = 0; attempt < kReadAttempts; ++attempt) {
    const std::ptrdiff_t count = ::read(fd_.get(), buffer.data(), buffer.size());
    if (count > 0) [[likely]]
      return {.count = static_cast<std::size_t>(count)};
    const int error_number = count == 0 ? 0 : errno;
    if (count < 0 && is_full_or_empty(error_number)) [[likely]]
      return {};
    if (error_number == EINTR) continue;
    mark_gone(error_number);
    return {.fault = Errc::port_gone};
  }
  return {};
}

Errc StreamPort::line_fault() noexcept {
  if (gone_ || not_counted_ != 0) return Errc::ok;
  const auto counters = read_line_counters(fd_.get());
  if (!counters) return Errc::ok;
  const LineCounters added = counters->since(seen_);
  seen_ = *counters;
  return added.cause();
}

std::expected<LineCounters, int> StreamPort::line_counters() const noexcept {
  if (not_counted_ != 0) return std::unexpected(not_counted_);
  const auto counters = read_line_counters(fd_.get());
  if (!counters) return std::unexpected(counters.error());
  return counters->since(at_start_);
}

Errc StreamPort::fail_send(Errc fault) noexcept {
  transmission_ = {Transmission::State::failed, fault};
  return fault;
}

void StreamPort::mark_gone(int error_number) noexcept {
  gone_ = true;
  last_errno_ = error_number;
  transmission_ = {Transmission::State::failed, Errc::port_gone};
}

}  // namespace tm485::linux_hal
