#include "tm485/linux/directed_port.hpp"

#include <sys/ioctl.h>
#include <termios.h>

#include "tm485/linux/serial_port.hpp"

namespace tm485::linux_hal {

void discard_output(int fd) noexcept { (void)ioctl(fd, TCFLSH, TCOFLUSH); }

static_assert(Port<DirectedPort<SerialPort>>);

}  // namespace tm485::linux_hal
