#include "tm485/linux/serial_port.hpp"

#include <fcntl.h>
#include <linux/serial.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>
#include <termios.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>

namespace tm485::linux_hal {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

// The kernel's numbers for the slave ends of Unix 98 pseudo-terminals.
constexpr unsigned kFirstPseudoMajor = 136;
constexpr unsigned kLastPseudoMajor = 143;

bool is_pseudo(int fd) noexcept {
  struct stat status{};
  if (fstat(fd, &status) != 0) return false;
  const unsigned number = major(status.st_rdev);
  return number >= kFirstPseudoMajor && number <= kLastPseudoMajor;
}

/// 0, or the errno that means "another program has it". The kernel gives the lock up even if this program is
/// killed, and it holds among processes of root, for whom TIOCEXCL does not count.
int lock(int fd) noexcept {
  int result = flock(fd, LOCK_EX | LOCK_NB);
  for (int again = 0; result != 0 && errno == EINTR && again < StreamPort::kReadAttempts; ++again)
    result = flock(fd, LOCK_EX | LOCK_NB);
  return result != 0 && errno == EWOULDBLOCK ? EBUSY : 0;
}

/// False if the driver does not have the setting, as a pseudo-terminal and most USB drivers.
bool set_low_latency(int fd) noexcept {
  serial_struct serial{};
  if (ioctl(fd, TIOCGSERIAL, &serial) != 0) return false;
  serial.flags |= static_cast<int>(ASYNC_LOW_LATENCY);
  if (ioctl(fd, TIOCSSERIAL, &serial) != 0) return false;
  return ioctl(fd, TIOCGSERIAL, &serial) == 0 &&
         (static_cast<unsigned>(serial.flags) & ASYNC_LOW_LATENCY) != 0;
}

PortCapability capability_of(bool pseudo_terminal, const SerialOptions& options) noexcept {
  PortCapability capability;
  capability.shortest_exchange = pseudo_terminal ? Time{0} : Time{microseconds(100)};
  capability.jitter_margin = microseconds(20);
  capability.latency_allowance = pseudo_terminal ? milliseconds(50) : milliseconds(20);
  capability.timing = pseudo_terminal ? TimingClass::best_effort : TimingClass::soft;
  if (options.latency_allowance) capability.latency_allowance = *options.latency_allowance;
  if (options.shortest_exchange) capability.shortest_exchange = *options.shortest_exchange;
  return capability;
}

OsError serial_error(const std::string& path, std::string_view operation, int error_number) {
  return make_os_error(Resource::serial_port, path, operation, error_number);
}

bool valid(const SerialOptions& options) noexcept {
  return options.bit_rate != 0 && options.latency_allowance.value_or(Time{0}) >= Time{0} &&
         options.shortest_exchange.value_or(Time{0}) >= Time{0};
}

}  // namespace

OsError rate_refused(std::string_view path, std::uint32_t asked, std::uint32_t achieved) {
  std::string what = "cannot open ";
  what.append(path).append(": asked for ").append(std::to_string(asked));
  what.append(" bit/s, the driver has set ").append(std::to_string(achieved));
  what.append(" bit/s, which is outside +/-2 %");
  return {Errc::bad_argument, 0, std::move(what),
          "use a UART or adapter that can make this rate (for 2500000 bit/s: FT232H, FT2232H, CH343, PL011 "
          "at 48 MHz; "
          "not FT232R, CH340, CP2102N), or raise the UART's clock"};
}

std::expected<SerialPort, OsError> SerialPort::open(const std::string& path, const SerialOptions& options) {
  if (!valid(options)) {
    return std::unexpected(OsError{Errc::bad_argument, EINVAL, "cannot open " + path + ": impossible options",
                                   "give a bit rate above 0 and times that are not negative"});
  }
  // O_NONBLOCK also keeps open() from waiting for a carrier.
  FileDescriptor fd(::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  if (!fd.valid()) return std::unexpected(serial_error(path, "open", errno));
  if (isatty(fd.get()) == 0) return std::unexpected(serial_error(path, "isatty", errno));
  if (options.exclusive) {
    if (const int error_number = lock(fd.get()); error_number != 0)
      return std::unexpected(serial_error(path, "flock", error_number));
  }
  const auto before = read_settings(fd.get());
  if (!before) return std::unexpected(serial_error(path, "TCGETS2", before.error()));

  // From here on the destructor puts back what was changed.
  const int number = fd.get();
  const bool pseudo_terminal = is_pseudo(number);
  SerialPort port(
      StreamPort(std::move(fd), StreamKind::tty, options.bit_rate, capability_of(pseudo_terminal, options)),
      *before);
  port.pseudo_terminal_ = pseudo_terminal;
  // A pseudo-terminal keeps TIOCEXCL while its other end is open: a client that was killed would lock it
  // for good.
  if (options.exclusive && !pseudo_terminal) {
    if (ioctl(number, TIOCEXCL) != 0) return std::unexpected(serial_error(path, "TIOCEXCL", errno));
    port.exclusive_ = true;
  }
  const auto achieved = make_raw(number, *before, options.bit_rate);
  if (!achieved) return std::unexpected(serial_error(path, "TCSETS2", achieved.error()));
  if (!rate_acceptable(options.bit_rate, *achieved))
    return std::unexpected(rate_refused(path, options.bit_rate, *achieved));
  port.achieved_rate_ = *achieved;
  if (options.low_latency) port.low_latency_ = set_low_latency(number);
  // What came before, at whatever rate, belongs to nobody.
  if (tcflush(number, TCIFLUSH) != 0) return std::unexpected(serial_error(path, "TCFLSH", errno));
  return port;
}

SerialPort& SerialPort::operator=(SerialPort&& other) noexcept {
  if (this == &other) return *this;
  restore();
  stream_ = std::move(other.stream_);
  before_ = other.before_;
  achieved_rate_ = other.achieved_rate_;
  exclusive_ = other.exclusive_;
  low_latency_ = other.low_latency_;
  pseudo_terminal_ = other.pseudo_terminal_;
  return *this;
}

void SerialPort::restore() noexcept {
  const int fd = stream_.descriptor();
  if (fd < 0) return;           // moved from
  write_settings(fd, before_);  // fails if the device is gone: then there is nothing to put back
  if (exclusive_) ioctl(fd, TIOCNXCL);
}

}  // namespace tm485::linux_hal
