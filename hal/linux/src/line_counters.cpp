#include "tm485/linux/line_counters.hpp"

#include <linux/serial.h>
#include <sys/ioctl.h>

#include <cerrno>

namespace tm485::linux_hal {

std::expected<LineCounters, int> read_line_counters(int fd) noexcept {
  serial_icounter_struct kernel{};
  if (ioctl(fd, TIOCGICOUNT, &kernel) != 0) return std::unexpected(errno);
  return LineCounters{static_cast<std::uint32_t>(kernel.overrun),
                      static_cast<std::uint32_t>(kernel.buf_overrun),
                      static_cast<std::uint32_t>(kernel.frame), static_cast<std::uint32_t>(kernel.parity),
                      static_cast<std::uint32_t>(kernel.brk)};
}

}  // namespace tm485::linux_hal
