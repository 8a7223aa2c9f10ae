#include "safe_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <span>
#include <system_error>

#include "tm485/posix/file_descriptor.hpp"
#include "tm485/posix/replace_file.hpp"

namespace tm485::cli {
namespace {

constexpr mode_t kNewFileMode = S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH;

Problem file_problem(std::string_view what, const std::string& path, std::string_view why, int exit_code) {
  return {"file_failed", fmt::format("{} '{}': {}", what, path, why),
          "check the path, its permissions and the space on the disk", exit_code};
}

Problem system_problem(std::string_view what, const std::string& path, int exit_code) {
  return file_problem(what, path, std::generic_category().message(errno), exit_code);
}

}  // namespace

std::expected<std::string, Problem> read_whole_file(const std::string& path, std::size_t most, Links links) {
  constexpr std::string_view kWhat = "reading";
  const int follow = links == Links::refuse ? O_NOFOLLOW : 0;
  const posix::FileDescriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | follow));
  if (!file.valid() && errno == ELOOP && links == Links::refuse)
    return std::unexpected(file_problem(kWhat, path, "it is a symbolic link", kExitUsage));
  if (!file.valid()) return std::unexpected(system_problem(kWhat, path, kExitUsage));
  struct stat status{};
  if (::fstat(file.get(), &status) != 0) return std::unexpected(system_problem(kWhat, path, kExitUsage));
  if (!S_ISREG(status.st_mode))
    return std::unexpected(file_problem(kWhat, path, "it is not a regular file", kExitUsage));
  if (static_cast<std::uint64_t>(status.st_size) > most)
    return std::unexpected(
        file_problem(kWhat, path, fmt::format("it has more than {} bytes", most), kExitUsage));
  std::string content(most + 1, '\0');  // it may grow meanwhile, and files of /proc have no size
  std::size_t filled = 0;
  while (filled < content.size()) {
    const ssize_t count = ::read(file.get(), content.data() + filled, content.size() - filled);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return std::unexpected(system_problem(kWhat, path, kExitUsage));
    if (count == 0) break;
    filled += static_cast<std::size_t>(count);
  }
  if (filled > most)
    return std::unexpected(
        file_problem(kWhat, path, fmt::format("it has more than {} bytes", most), kExitUsage));
  content.resize(filled);
  return content;
}

std::expected<void, Problem> replace_file(const std::string& path, std::string_view content, Links links) {
  const std::string real = links == Links::follow ? posix::without_links(path) : path;
  if (struct stat status{}; ::lstat(real.c_str(), &status) == 0 && !S_ISREG(status.st_mode)) {
    const bool link = S_ISLNK(status.st_mode);
    return std::unexpected(file_problem(
        "writing", path, link ? "it is a symbolic link" : "it is not a regular file", kExitFailure));
  }
  const std::span bytes(reinterpret_cast<const std::uint8_t*>(content.data()), content.size());
  const std::error_code error = posix::replace_file(real, bytes);
  if (error) return std::unexpected(file_problem("writing", path, error.message(), kExitFailure));
  return {};
}

std::expected<void, Problem> create_file(const std::string& path, std::string_view content) {
  {
    // Takes the name; not every file system of a memory stick knows link() or a rename that replaces nothing.
    const posix::FileDescriptor taken(
        ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kNewFileMode));
    if (!taken.valid() && errno == EEXIST)
      return std::unexpected(usage_problem("file_exists", fmt::format("'{}' exists already", path),
                                           "choose another name, or move the file away"));
    if (!taken.valid()) return std::unexpected(system_problem("writing", path, kExitFailure));
  }
  auto written = replace_file(path, content, Links::refuse);
  if (!written) ::unlink(path.c_str());
  return written;
}

}  // namespace tm485::cli
