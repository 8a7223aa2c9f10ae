#include "tm485/linux/unix_port.hpp"

#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <cstring>

#include "tm485/linux/clock.hpp"

namespace tm485::linux_hal {
namespace {

constexpr Time kRetryInterval = std::chrono::milliseconds(5);

/// 0 or errno. A non-blocking connect of this domain is complete at once, or the server's queue is full
/// (EAGAIN).
int connect_within(int fd, const sockaddr_un& address, Time limit) noexcept {
  const MonotonicClock clock;
  for (;;) {
    if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return 0;
    const int error_number = errno;
    if (error_number != EAGAIN && error_number != EINTR) return error_number;
    const Time now = clock.now();
    if (now >= limit) return error_number;
    clock.wait_until(std::min(now + kRetryInterval, limit));
  }
}

OsError socket_error(const std::string& path, std::string_view operation, int error_number) {
  return make_os_error(Resource::unix_socket, path, operation, error_number);
}

PortCapability capability_of(const UnixOptions& options) noexcept {
  PortCapability capability;
  capability.shortest_exchange = options.shortest_exchange.value_or(Time{0});
  capability.jitter_margin = std::chrono::microseconds(20);
  capability.latency_allowance = options.latency_allowance.value_or(std::chrono::milliseconds(50));
  capability.timing = TimingClass::best_effort;
  return capability;
}

bool valid(const UnixOptions& options) noexcept {
  return options.bit_rate != 0 && options.latency_allowance.value_or(Time{0}) >= Time{0} &&
         options.shortest_exchange.value_or(Time{0}) >= Time{0};
}

}  // namespace

std::expected<UnixPort, OsError> UnixPort::connect(const std::string& path, const UnixOptions& options) {
  if (!valid(options)) {
    return std::unexpected(OsError{Errc::bad_argument, EINVAL, "cannot open " + path + ": impossible options",
                                   "give a bit rate above 0 and times that are not negative"});
  }
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty()) return std::unexpected(socket_error("(no path)", "connect", EINVAL));
  if (path.size() >= sizeof address.sun_path)
    return std::unexpected(socket_error(path, "connect", ENAMETOOLONG));
  std::memcpy(address.sun_path, path.data(), path.size());
  posix::FileDescriptor fd(::socket(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0));
  if (!fd.valid()) return std::unexpected(socket_error(path, "socket", errno));
  if (const int error_number = connect_within(fd.get(), address, options.connect_time); error_number != 0)
    return std::unexpected(socket_error(path, "connect", error_number));
  return UnixPort(StreamPort(std::move(fd), StreamKind::socket, options.bit_rate, capability_of(options)));
}

}  // namespace tm485::linux_hal
