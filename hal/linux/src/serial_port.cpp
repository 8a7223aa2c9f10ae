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
#include <filesystem>

#include "retried.hpp"

namespace tm485::linux_hal {
namespace {

using std::chrono::microseconds;

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
  const int result = retried([fd]() noexcept { return flock(fd, LOCK_EX | LOCK_NB); });
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

PortCapability capability_of(const PortIdentity& identity, const SerialOptions& options) noexcept {
  const PortLimits limits = port_limits(identity, options.bit_rate);
  PortCapability capability;
  capability.shortest_exchange = limits.shortest_exchange;
  capability.jitter_margin = microseconds(20);
  capability.latency_allowance = limits.latency_allowance;
  capability.timing = limits.best_effort ? TimingClass::best_effort : TimingClass::soft;
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
  return {Errc::bad_argument, 0, std::move(what), std::string(kRateRemedy), "rate_refused"};
}

OsError chip_unfit(const PortIdentity& identity, std::uint32_t asked, std::uint32_t nearest) {
  std::string what = "cannot open " + identity.path + ": its chip, " + identity.chip + ", cannot make " +
                     std::to_string(asked) + " bit/s";
  if (nearest != 0) what += ", the nearest is " + std::to_string(nearest) + " bit/s";
  what += " (" + identity.remark + ")";
  return {Errc::bad_argument, 0, std::move(what), std::string(kRateRemedy), "chip_unfit"};
}

std::expected<SerialPort, OsError> SerialPort::open(const std::string& path, const SerialOptions& options) {
  if (!valid(options)) {
    return std::unexpected(OsError{Errc::bad_argument, EINVAL, "cannot open " + path + ": impossible options",
                                   "give a bit rate above 0 and times that are not negative"});
  }
  // O_NONBLOCK also keeps open() from waiting for a carrier.
  posix::FileDescriptor fd(
      retried([&path] { return ::open(path.c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC); }));
  if (!fd.valid()) return std::unexpected(serial_error(path, "open", errno));
  if (const auto terminal = read_settings(fd.get()); !terminal)
    return std::unexpected(serial_error(path, "TCGETS2", terminal.error()));
  if (options.exclusive) {
    if (const int error_number = lock(fd.get()); error_number != 0)
      return std::unexpected(serial_error(path, "flock", error_number));
  }
  PortIdentity identity = identify_port(path, options.system);
  if (is_pseudo(fd.get())) identity.bus = PortBus::pseudo_terminal;
  const RateAbility ability = rate_ability(identity, options.bit_rate);
  if (options.refuse_unfit_chip && ability.verdict == RateVerdict::cannot)
    return std::unexpected(chip_unfit(identity, options.bit_rate, ability.nearest));
  const auto before = read_settings(fd.get());  // again: nobody else changes them any more
  if (!before) return std::unexpected(serial_error(path, "TCGETS2", before.error()));

  const int number = fd.get();
  const bool pseudo_terminal = identity.bus == PortBus::pseudo_terminal;
  const bool low_latency = options.low_latency && set_low_latency(number);
  LatencyTimer timer;
  if (options.low_latency && identity.latency_timer_ms)
    timer = set_latency_timer(identity.name, options.system);
  if (timer.state != LatencyTimer::State::absent) identity.latency_timer_ms = timer.milliseconds;

  // From here on the destructor puts back what was changed.
  const PortCapability capability = capability_of(identity, options);
  SerialPort port(StreamPort(std::move(fd), StreamKind::tty, options.bit_rate, capability), *before,
                  std::move(identity));
  port.pseudo_terminal_ = pseudo_terminal;
  port.low_latency_ = low_latency;
  port.latency_timer_ = timer;
  port.options_ = options;
  std::error_code ignored;
  const bool by_link = std::filesystem::is_symlink(path, ignored);
  port.reopen_path_ = by_link || port.identity_.stable_path.empty() ? path : port.identity_.stable_path;
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
  // What came before, at whatever rate, belongs to nobody.
  if (ioctl(number, TCFLSH, TCIFLUSH) != 0) return std::unexpected(serial_error(path, "TCFLSH", errno));
  (void)port.stream_.line_fault();
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
  latency_timer_ = other.latency_timer_;
  identity_ = std::move(other.identity_);
  options_ = std::move(other.options_);
  reopen_path_ = std::move(other.reopen_path_);
  return *this;
}

void SerialPort::close() noexcept {
  restore();
  stream_.close();
}

std::expected<void, OsError> SerialPort::reopen() {
  close();
  const PortCapability held = capability();
  auto port = open(reopen_path_, options_);
  if (!port) return std::unexpected(std::move(port.error()));
  const PortCapability offered = port->capability();
  if (offered.shortest_exchange > held.shortest_exchange ||
      offered.latency_allowance > held.latency_allowance || offered.timing > held.timing) {
    return std::unexpected(
        OsError{Errc::bad_argument, 0,
                "cannot reopen " + reopen_path_ + ": the device behind it is slower than before",
                "plug the same adapter in again, or start anew", "another_device"});
  }
  port->reopen_path_ = reopen_path_;
  *this = std::move(*port);
  return {};
}

void SerialPort::restore() noexcept {
  const int fd = stream_.descriptor();
  if (fd < 0) return;  // moved from
  // Closing a line that does not drain would wait for up to half a minute.
  if (!pseudo_terminal_) ioctl(fd, TCFLSH, TCOFLUSH);
  write_settings(fd, before_);  // fails if the device is gone: then there is nothing to put back
  if (exclusive_) ioctl(fd, TIOCNXCL);
}

}  // namespace tm485::linux_hal
