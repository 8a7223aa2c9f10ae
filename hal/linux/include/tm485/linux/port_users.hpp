// Who has a device open: found in /proc, without opening the device.
#pragma once

#include <string>
#include <vector>

namespace tm485::linux_hal {

struct PortUser {
  int pid = 0;
  std::string program;  ///< its name, as the kernel has it; empty if it has just ended

  friend bool operator==(const PortUser&, const PortUser&) = default;
};

/// The programs that have `path` open or locked, by number. Those of other users are seen by root only, unless they have
/// locked the device, as this library does. Never fails: without /proc nobody is found. Set-up; looks at every process.
[[nodiscard]] std::vector<PortUser> port_users(const std::string& path);

}  // namespace tm485::linux_hal
