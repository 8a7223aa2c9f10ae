// tm485_vm_claim_clock TTY RATE: tells the driver of a 16550 that its clock makes RATE bit/s with a divisor of 1, as
// setserial's baud_base does. QEMU's 16550 has a clock of 1.8432 MHz, and does not mind.
#include <fcntl.h>
#include <linux/serial.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>

#include "tm485/posix/file_descriptor.hpp"

int main(int count, char** arguments) {
  if (count != 3) return 2;
  const tm485::posix::FileDescriptor tty(::open(arguments[1], O_RDWR | O_NOCTTY | O_NONBLOCK));
  serial_struct settings{};
  if (!tty.valid() || ioctl(tty.get(), TIOCGSERIAL, &settings) != 0) {
    std::perror(arguments[1]);
    return 1;
  }
  const int before = settings.baud_base;
  settings.baud_base = std::atoi(arguments[2]);
  if (ioctl(tty.get(), TIOCSSERIAL, &settings) != 0) {
    std::perror("TIOCSSERIAL");
    return 1;
  }
  std::printf("%s: baud_base %d, was %d\n", arguments[1], settings.baud_base, before);
  return 0;
}
