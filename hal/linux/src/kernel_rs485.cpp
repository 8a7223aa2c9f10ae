// TIOCSRS485: the RS-485 mode of a tty's driver.
#include <linux/serial.h>
#include <sys/ioctl.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <utility>

#include "tm485/linux/rs485_direction.hpp"

namespace tm485::linux_hal {
namespace {

OsError rs485_error(const std::string& path, std::string_view operation, int error_number) {
  return make_os_error(Resource::rs485_mode, path, operation, error_number);
}

/// What must be as it was asked for, and what to do if it is not.
struct Flag {
  std::uint32_t bit;
  std::string_view name;
  std::string_view remedy;
};
constexpr std::array kFlags{
    Flag{SER_RS485_ENABLED, "SER_RS485_ENABLED",
         "this driver only pretends to have an RS-485 mode: use --direction auto or gpio"},
    Flag{SER_RS485_RTS_ON_SEND, "SER_RS485_RTS_ON_SEND",
         "the driver has the other polarity of RTS only: swap --direction kernel and kernel:low, and invert "
         "the line "
         "in the device tree (rs485-rts-active-low) or in hardware"},
    Flag{SER_RS485_RTS_AFTER_SEND, "SER_RS485_RTS_AFTER_SEND",
         "the driver has the other polarity of RTS only: swap --direction kernel and kernel:low, and invert "
         "the line "
         "in the device tree (rs485-rts-active-low) or in hardware"},
    Flag{SER_RS485_RX_DURING_TX, "SER_RS485_RX_DURING_TX",
         "the driver decides itself whether it receives while it sends: swap --direction kernel and "
         "kernel:mute"},
};

std::expected<void, OsError> compare(const std::string& path, const serial_rs485& asked,
                                     const serial_rs485& kept) {
  for (const Flag& flag : kFlags) {
    if (((asked.flags ^ kept.flags) & flag.bit) == 0) continue;
    std::string what = "cannot open " + path + ": TIOCSRS485: asked for ";
    what.append(flag.name).append((asked.flags & flag.bit) != 0 ? " on" : " off");
    what.append(", the driver has kept the opposite");
    return std::unexpected(OsError{Errc::bad_argument, 0, std::move(what), std::string(flag.remedy)});
  }
  if (kept.delay_rts_before_send == 0 && kept.delay_rts_after_send == 0) return {};
  return std::unexpected(
      OsError{Errc::bad_argument, 0,
              "cannot open " + path + ": TIOCSRS485: the driver insists on delays of " +
                  std::to_string(kept.delay_rts_before_send) + " and " +
                  std::to_string(kept.delay_rts_after_send) + " ms around a request",
              "remove rs485-rts-delay from the device tree: the driver must be off within 2.8 us"});
}

}  // namespace

std::expected<KernelRs485, OsError> KernelRs485::set(int fd, const std::string& path, bool rts_low,
                                                     bool mute) {
  static_assert(sizeof(serial_rs485) == sizeof(Mode));
  serial_rs485 before{};
  if (ioctl(fd, TIOCGRS485, &before) != 0) return std::unexpected(rs485_error(path, "TIOCGRS485", errno));
  Mode mode;
  std::memcpy(mode.words, &before, sizeof before);

  serial_rs485 asked{};  // delays 0: they are milliseconds
  asked.flags = SER_RS485_ENABLED | (rts_low ? SER_RS485_RTS_AFTER_SEND : SER_RS485_RTS_ON_SEND) |
                (mute ? 0U : SER_RS485_RX_DURING_TX);
  serial_rs485 answered = asked;
  if (ioctl(fd, TIOCSRS485, &answered) != 0) return std::unexpected(rs485_error(path, "TIOCSRS485", errno));
  KernelRs485 set(fd, mode);  // from here on its end puts back what was before
  serial_rs485 kept{};
  if (ioctl(fd, TIOCGRS485, &kept) != 0) return std::unexpected(rs485_error(path, "TIOCGRS485", errno));
  if (auto same = compare(path, asked, kept); !same) return std::unexpected(std::move(same.error()));
  return set;
}

KernelRs485::KernelRs485(KernelRs485&& other) noexcept
    : fd_(std::exchange(other.fd_, -1)), before_(other.before_) {}

KernelRs485& KernelRs485::operator=(KernelRs485&& other) noexcept {
  if (this == &other) return *this;
  restore();
  fd_ = std::exchange(other.fd_, -1);
  before_ = other.before_;
  return *this;
}

void KernelRs485::restore() noexcept {
  if (fd_ < 0) return;
  serial_rs485 before{};
  std::memcpy(&before, before_.words, sizeof before);
  (void)ioctl(fd_, TIOCSRS485, &before);  // fails if the device is gone: then there is nothing to put back
}

}  // namespace tm485::linux_hal
