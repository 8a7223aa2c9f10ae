#include "tm485/linux/termios2.hpp"

#include <asm/termbits.h>
#include <sys/ioctl.h>

#include <cerrno>
#include <cstring>

namespace tm485::linux_hal {
namespace {

static_assert(sizeof(termios2) <= sizeof(TerminalSettings),
              "TerminalSettings must hold the kernel's structure");

termios2 unpack(const TerminalSettings& settings) noexcept {
  termios2 kernel{};
  std::memcpy(&kernel, settings.bytes.data(), sizeof kernel);
  return kernel;
}

}  // namespace

std::expected<TerminalSettings, int> read_settings(int fd) noexcept {
  termios2 kernel{};
  if (ioctl(fd, TCGETS2, &kernel) != 0) return std::unexpected(errno);
  TerminalSettings settings;
  std::memcpy(settings.bytes.data(), &kernel, sizeof kernel);
  return settings;
}

std::expected<std::uint32_t, int> make_raw(int fd, const TerminalSettings& before,
                                           std::uint32_t bit_rate) noexcept {
  termios2 kernel = unpack(before);
  // A character with a bad stop bit and a break come through as bytes: a fault must be seen, and the CRC
  // drops it.
  kernel.c_iflag = 0;
  kernel.c_oflag = 0;
  kernel.c_lflag = 0;
  kernel.c_cflag &=
      ~static_cast<tcflag_t>(CSIZE | CSTOPB | PARENB | PARODD | CMSPAR | CRTSCTS | CBAUD | CIBAUD);
  kernel.c_cflag |= static_cast<tcflag_t>(CS8 | CREAD | CLOCAL | BOTHER | (BOTHER << IBSHIFT));
  kernel.c_ispeed = bit_rate;
  kernel.c_ospeed = bit_rate;
  // With VMIN 0 a non-blocking read of an empty port returns 0, as after a hang-up; with 1 it fails with
  // EAGAIN.
  kernel.c_cc[VMIN] = 1;
  kernel.c_cc[VTIME] = 0;
  if (ioctl(fd, TCSETS2, &kernel) != 0) return std::unexpected(errno);
  if (ioctl(fd, TCGETS2, &kernel) != 0) return std::unexpected(errno);
  return std::uint32_t{kernel.c_ospeed};
}

int write_settings(int fd, const TerminalSettings& settings) noexcept {
  const termios2 kernel = unpack(settings);
  return ioctl(fd, TCSETS2, &kernel) == 0 ? 0 : errno;
}

}  // namespace tm485::linux_hal
