#include "tm485/linux/os_error.hpp"

#include <array>
#include <cerrno>
#include <span>
#include <system_error>
#include <utility>

namespace tm485::linux_hal {
namespace {

struct Remedy {
  int error_number;
  std::string_view text;
};

constexpr std::array kSerialRemedies{
    Remedy{ENOENT, "check the name and that the device is plugged in (ls /dev/tty*, journalctl -k)"},
    Remedy{ENODEV, "the device node has no driver behind it: plug the adapter in again, or load its driver"},
    Remedy{ENXIO, "the device behind this node is gone: plug the adapter in again"},
    Remedy{EACCES,
           "join the group that owns the device, usually 'sudo adduser $USER dialout', and log in again"},
    Remedy{EPERM, "the system forbids this access: in a container, pass the device through"},
    Remedy{EBUSY,
           "another program uses the port: stop it (fuser -v on the path names it; "
           "ModemManager and getty are usual suspects)"},
    Remedy{ENOTTY, "this is not a serial port: give a path such as /dev/ttyUSB0, /dev/ttyAMA0 or /dev/pts/3"},
    Remedy{EISDIR, "this is a folder: give the path of the device itself"},
    Remedy{EIO,
           "no hardware answers behind this port: a /dev/ttyS* that the machine does not have, "
           "or an adapter that was unplugged"},
    Remedy{EROFS, "the file system is read-only and this is not a device: give the path of a serial port"},
    Remedy{EINVAL, "the driver refuses 8N1 at this rate: choose another rate or another adapter"},
    Remedy{EMFILE, "this program has too many files open: close some, or raise 'ulimit -n'"},
};

constexpr std::array kSocketRemedies{
    Remedy{ENOENT, "no server has made this socket: is 'tm485 sim --unix' running, with this path?"},
    Remedy{ECONNREFUSED,
           "nothing listens on this path: is 'tm485 sim --unix' still running? "
           "A socket file outlives its server"},
    Remedy{EACCES, "the socket belongs to another user: run both ends as the same one, or change its mode"},
    Remedy{EAGAIN, "the server does not accept: another client has it, or it is stopped"},
    Remedy{EPROTOTYPE, "this is another kind of socket: give the path of a stream socket"},
    Remedy{ENAMETOOLONG, "a socket's path has at most 107 bytes: choose a shorter one"},
    Remedy{EINVAL, "give the path of the socket"},
    Remedy{EMFILE, "this program has too many files open: close some, or raise 'ulimit -n'"},
};

constexpr std::array kMappingRemedies{
    Remedy{ENOENT,
           "check the name; a kernel without /dev/mem needs UIO (uio=/dev/uioN, 'modprobe uio_pdrv_genirq')"},
    Remedy{EACCES, "run as root, or give the group of this program the UIO device (uio=/dev/uioN)"},
    Remedy{
        EPERM,
        "the kernel keeps this memory for itself: boot with iomem=relaxed (and without lockdown), or use UIO "
        "(uio=/dev/uioN)"},
    Remedy{EBUSY, "another program has mapped this UART: stop it"},
    Remedy{EFAULT, "nothing answers at this address: check it against the device tree or the manual"},
    Remedy{ENOTTY, "this is no UIO device: give a path such as /dev/uio0 (ls /sys/class/uio)"},
    Remedy{EINVAL,
           "check the address against the device's own (/sys/class/uio/*/maps/map0, or the device tree)"},
    Remedy{EISDIR, "this is a folder: give the path of the device itself"},
    Remedy{ENXIO, "the device behind this node is gone"},
    Remedy{ENODEV, "this file cannot be mapped: give /dev/mem or a UIO device"},
    Remedy{EMFILE, "this program has too many files open: close some, or raise 'ulimit -n'"},
};

constexpr std::array kGpioRemedies{
    Remedy{ENOSYS, "this program was built without libgpiod: install libgpiod-dev and build again"},
    Remedy{ENOENT,
           "there is no such GPIO chip: 'gpiodetect' (package gpiod) lists those of this machine; on some "
           "boards "
           "the device tree has to enable it"},
    Remedy{ENODEV,
           "this is no GPIO chip, or its device is gone: 'gpiodetect' (package gpiod) lists the chips"},
    Remedy{ENXIO, "the GPIO chip's device is gone"},
    Remedy{ENOTTY, "this is no GPIO chip: 'gpiodetect' (package gpiod) lists the chips"},
    Remedy{EACCES,
           "join the group that owns the chip, often 'sudo adduser $USER gpio', and log in again, or give "
           "the device "
           "a udev rule"},
    Remedy{EPERM, "the system forbids this access: in a container, pass the chip's device through"},
    Remedy{EBUSY,
           "a line belongs to one program at a time: stop the other one, or free the line in the device tree "
           "if a "
           "driver has it ('gpioinfo' names it)"},
    Remedy{EINVAL, "the chip does not take this line as an output: choose another one"},
    Remedy{EMFILE, "this program has too many files open: close some, or raise 'ulimit -n'"},
};

constexpr std::array kRs485Remedies{
    Remedy{
        ENOTTY,
        "this port's driver cannot switch the direction: use a transceiver or adapter that does it by itself "
        "(--direction auto), a GPIO line (--direction gpio:CHIP:LINE), or a UART whose driver can"},
    Remedy{EINVAL,
           "the driver refuses this RS-485 setting: the device tree must give the port an RTS line, and some "
           "drivers "
           "have one polarity only (--direction kernel:low)"},
    Remedy{EPERM, "the system forbids this access: in a container, pass the device through"},
    Remedy{EIO, "the device does not answer: was it unplugged?"},
};

constexpr std::span<const Remedy> remedies_of(Resource resource) noexcept {
  switch (resource) {
    case Resource::serial_port:
      return kSerialRemedies;
    case Resource::unix_socket:
      return kSocketRemedies;
    case Resource::mapped_uart:
      return kMappingRemedies;
    case Resource::gpio_line:
      return kGpioRemedies;
    case Resource::rs485_mode:
      break;
  }
  return kRs485Remedies;
}

constexpr std::string_view kOther = "not expected here: look at the kernel's messages (journalctl -k)";

constexpr bool is_absent(int error_number) noexcept {
  return error_number == ENOENT || error_number == ENODEV || error_number == ENXIO;
}

}  // namespace

std::string_view remedy_for(Resource resource, int error_number) noexcept {
  for (const Remedy& remedy : remedies_of(resource))
    if (remedy.error_number == error_number) return remedy.text;
  return kOther;
}

OsError make_os_error(Resource resource, std::string_view path, std::string_view operation,
                      int error_number) {
  std::string what = "cannot open ";
  what.append(path).append(": ").append(operation).append(": ");
  what += std::generic_category().message(error_number);
  what += " (errno " + std::to_string(error_number) + ")";
  return {is_absent(error_number) ? Errc::port_gone : Errc::bad_argument, error_number, std::move(what),
          std::string(remedy_for(resource, error_number))};
}

}  // namespace tm485::linux_hal
