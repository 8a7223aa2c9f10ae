#include "tm485/linux/latency_timer.hpp"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <string_view>

#include "retried.hpp"
#include "system_files.hpp"
#include "tm485/posix/file_descriptor.hpp"

namespace tm485::linux_hal {
namespace {

/// 0 or errno.
int write_text(const std::string& path, std::string_view text) {
  const posix::FileDescriptor fd(retried([&] { return ::open(path.c_str(), O_WRONLY | O_CLOEXEC); }));
  if (!fd.valid()) return errno;
  const auto written = retried([&] { return ::write(fd.get(), text.data(), text.size()); });
  if (written < 0) return errno;
  return static_cast<std::size_t>(written) == text.size() ? 0 : EIO;
}

}  // namespace

std::string_view LatencyTimer::remedy() const noexcept {
  if (state != State::refused) return {};
  if (error_number == EACCES || error_number == EPERM || error_number == EROFS)
    return "let a udev rule set it: ACTION==\"add\", SUBSYSTEM==\"usb-serial\", DRIVER==\"ftdi_sio\", "
           "ATTR{latency_timer}=\"1\"; or write 1 to the port's latency_timer in sysfs as root";
  return "write 1 to the port's latency_timer in sysfs as root, and look at the kernel's messages "
         "(journalctl -k)";
}

LatencyTimer set_latency_timer(const std::string& name, const SystemPaths& system) {
  using State = LatencyTimer::State;
  const std::filesystem::path file =
      std::filesystem::path(system.sysfs) / "class/tty" / name / "device/latency_timer";
  const auto before = read_number(file);
  if (!before) return {};
  if (*before <= kShortestLatencyTimer) return {State::set, *before, 0};
  const int error_number = write_text(file.string(), std::to_string(kShortestLatencyTimer) + "\n");
  const unsigned after = read_number(file).value_or(*before);
  if (after <= kShortestLatencyTimer) return {State::set, after, 0};
  return {State::refused, after, error_number};
}

}  // namespace tm485::linux_hal
