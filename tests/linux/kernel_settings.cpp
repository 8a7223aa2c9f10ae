// Apart from pseudo_terminal.cpp, because the kernel's header and the C library's exclude each other.
#include <asm/termbits.h>
#include <gtest/gtest.h>
#include <sys/ioctl.h>

#include "pseudo_terminal.hpp"

namespace tm485::linux_hal::test {

KernelSettings kernel_settings(int fd) {
  termios2 settings{};
  EXPECT_EQ(ioctl(fd, TCGETS2, &settings), 0);
  return {settings.c_ispeed, settings.c_ospeed, (settings.c_lflag & ICANON) != 0,
          (settings.c_lflag & ECHO) != 0};
}

}  // namespace tm485::linux_hal::test
