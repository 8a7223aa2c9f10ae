#include "safe_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>

namespace tm485::cli {
namespace {

constexpr mode_t kNewFileMode = S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH;

class Descriptor {
 public:
  explicit Descriptor(int fd) : fd_(fd) {}
  Descriptor(const Descriptor&) = delete;
  Descriptor& operator=(const Descriptor&) = delete;
  ~Descriptor() {
    if (fd_ >= 0) ::close(fd_);
  }
  [[nodiscard]] int get() const noexcept { return fd_; }
  [[nodiscard]] bool is_open() const noexcept { return fd_ >= 0; }

 private:
  int fd_;
};

Problem file_problem(std::string_view what, const std::string& path, std::string_view why, int exit_code) {
  return {"file_failed", fmt::format("{} '{}': {}", what, path, why),
          "check the path, its permissions and the space on the disk", exit_code};
}

Problem system_problem(std::string_view what, const std::string& path, int exit_code) {
  return file_problem(what, path, std::generic_category().message(errno), exit_code);
}

bool write_all(int fd, std::string_view rest) {
  while (!rest.empty()) {
    const ssize_t count = ::write(fd, rest.data(), rest.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return false;
    rest.remove_prefix(static_cast<std::size_t>(count));
  }
  return true;
}

/// Where the links lead, so that the file is replaced and not the link.
std::string without_links(const std::string& path) {
  std::error_code error;
  const auto real = std::filesystem::weakly_canonical(path, error);
  return error ? path : real.string();
}

/// A new name in a directory lasts once the directory is on the disk.
void sync_directory_of(const std::string& path) {
  const auto parent = std::filesystem::path(path).parent_path();
  const Descriptor folder(::open(parent.empty() ? "." : parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder.is_open()) (void)::fsync(folder.get());
}

/// Writes a file beside `path`, under a name of this process. False with errno, and it is gone again.
bool write_beside(const std::string& name, std::string_view content) {
  const Descriptor file(
      ::open(name.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_NOFOLLOW | O_CLOEXEC, kNewFileMode));
  if (!file.is_open()) return false;
  if (write_all(file.get(), content) && ::fsync(file.get()) == 0) return true;
  const int error = errno;
  ::unlink(name.c_str());
  errno = error;
  return false;
}

}  // namespace

std::expected<std::string, Problem> read_whole_file(const std::string& path, std::size_t most) {
  constexpr std::string_view kWhat = "reading";
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!file.is_open()) return std::unexpected(system_problem(kWhat, path, kExitUsage));
  struct stat status{};
  if (::fstat(file.get(), &status) != 0) return std::unexpected(system_problem(kWhat, path, kExitUsage));
  if (!S_ISREG(status.st_mode))
    return std::unexpected(file_problem(kWhat, path, "it is not a regular file", kExitUsage));
  std::string content(most + 1, '\0');
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

std::expected<void, Problem> replace_file(const std::string& path, std::string_view content) {
  const std::string real = without_links(path);
  if (struct stat status{}; ::stat(real.c_str(), &status) == 0 && !S_ISREG(status.st_mode))
    return std::unexpected(file_problem("writing", path, "it is not a regular file", kExitFailure));
  const std::string fresh = fmt::format("{}.{}.new", real, ::getpid());
  if (!write_beside(fresh, content)) return std::unexpected(system_problem("writing", path, kExitFailure));
  if (::rename(fresh.c_str(), real.c_str()) != 0) {
    const Problem problem = system_problem("writing", path, kExitFailure);
    ::unlink(fresh.c_str());
    return std::unexpected(problem);
  }
  sync_directory_of(real);
  return {};
}

std::expected<void, Problem> create_file(const std::string& path, std::string_view content) {
  {
    // Takes the name; not every file system of a memory stick knows link() or a rename that replaces nothing.
    const Descriptor taken(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, kNewFileMode));
    if (!taken.is_open() && errno == EEXIST)
      return std::unexpected(usage_problem("file_exists", fmt::format("'{}' exists already", path),
                                           "choose another name, or move the file away"));
    if (!taken.is_open()) return std::unexpected(system_problem("writing", path, kExitFailure));
  }
  auto written = replace_file(path, content);
  if (!written) ::unlink(path.c_str());
  return written;
}

}  // namespace tm485::cli
