#include "tm485/linux/port_users.hpp"

#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <charconv>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <string_view>
#include <system_error>

#include "system_files.hpp"

namespace tm485::linux_hal {
namespace {

namespace fs = std::filesystem;

template <class Number>
std::optional<Number> number_of(std::string_view text, int base = 10) {
  Number value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// 0 if the folder's name is no number.
int process_of(const fs::path& folder) {
  const std::string name = folder.filename().string();
  if (name.empty() || name.find_first_not_of("0123456789") != std::string::npos) return 0;
  return number_of<int>(name).value_or(0);
}

void add_who_has_it_open(const fs::path& device, std::set<int>& processes) {
  std::error_code error;
  for (fs::directory_iterator process("/proc", error), end; !error && process != end;
       process.increment(error)) {
    const int pid = process_of(process->path());
    if (pid == 0) continue;
    std::error_code closed;
    for (fs::directory_iterator fd(process->path() / "fd", closed); !closed && fd != end;
         fd.increment(closed)) {
      std::error_code vanished;
      if (fs::read_symlink(fd->path(), vanished) == device) processes.insert(pid);
    }
  }
}

/// /proc/locks: "1: FLOCK  ADVISORY  WRITE 1234 00:05:678 0 EOF", the device's file system in hexadecimal and its inode.
void add_who_has_locked_it(const fs::path& device, std::set<int>& processes) {
  struct stat status{};
  if (::stat(device.c_str(), &status) != 0) return;
  std::ifstream locks("/proc/locks");
  for (std::string line; std::getline(locks, line);) {
    std::istringstream words(line);
    std::string number, kind, advisory, access, process, place;
    if (!(words >> number >> kind >> advisory >> access >> process >> place) || kind != "FLOCK") continue;
    const std::size_t colon = place.find(':');
    const std::size_t last = place.rfind(':');
    if (colon == std::string::npos || last == colon) continue;
    const std::string_view parts = place;
    const auto first = number_of<unsigned>(parts.substr(0, colon), 16);
    const auto second = number_of<unsigned>(parts.substr(colon + 1, last - colon - 1), 16);
    const auto inode = number_of<unsigned long>(parts.substr(last + 1));
    const auto pid = number_of<int>(process).value_or(0);
    if (pid > 0 && inode == status.st_ino && first == major(status.st_dev) && second == minor(status.st_dev))
      processes.insert(pid);
  }
}

}  // namespace

std::vector<PortUser> port_users(const std::string& path) {
  const fs::path device = behind_links(path);
  if (device.empty()) return {};
  std::set<int> processes;
  add_who_has_it_open(device, processes);
  add_who_has_locked_it(device, processes);
  std::vector<PortUser> users;
  users.reserve(processes.size());
  for (const int pid : processes)
    users.push_back({pid, read_line(fs::path("/proc") / std::to_string(pid) / "comm").value_or("")});
  return users;
}

}  // namespace tm485::linux_hal
