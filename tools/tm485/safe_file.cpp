#include "safe_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <optional>
#include <system_error>

namespace tm485::cli {
namespace {

constexpr mode_t kNewFileMode = S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH;
constexpr mode_t kPermissions = 0777;

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

/// Makes a new file beside `path`, never what somebody has put there before: a link, a pipe, a file that they own. Nothing
/// with errno. `mode`: that of an old file.
std::optional<std::string> write_beside(const std::string& path, std::string_view content,
                                        std::optional<mode_t> mode) {
  constexpr int kMostLeftovers = 16;  // of processes that were killed
  for (int attempt = 0; attempt < kMostLeftovers; ++attempt) {
    std::string name = fmt::format("{}.{}.{}.new", path, ::getpid(), attempt);
    const Descriptor file(
        ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode.value_or(kNewFileMode)));
    if (!file.is_open() && errno == EEXIST) continue;
    if (!file.is_open()) return std::nullopt;
    if (write_all(file.get(), content) && (!mode || ::fchmod(file.get(), *mode) == 0) &&
        ::fsync(file.get()) == 0)
      return name;
    const int error = errno;
    ::unlink(name.c_str());
    errno = error;
    return std::nullopt;
  }
  errno = EEXIST;
  return std::nullopt;
}

}  // namespace

std::expected<std::string, Problem> read_whole_file(const std::string& path, std::size_t most, Links links) {
  constexpr std::string_view kWhat = "reading";
  const int follow = links == Links::refuse ? O_NOFOLLOW : 0;
  const Descriptor file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK | follow));
  if (!file.is_open() && errno == ELOOP && links == Links::refuse)
    return std::unexpected(file_problem(kWhat, path, "it is a symbolic link", kExitUsage));
  if (!file.is_open()) return std::unexpected(system_problem(kWhat, path, kExitUsage));
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
  const std::string real = links == Links::follow ? without_links(path) : path;
  std::optional<mode_t> mode;
  if (struct stat status{}; ::lstat(real.c_str(), &status) == 0) {
    const bool link = S_ISLNK(status.st_mode);
    if (!S_ISREG(status.st_mode))
      return std::unexpected(file_problem(
          "writing", path, link ? "it is a symbolic link" : "it is not a regular file", kExitFailure));
    mode = status.st_mode & kPermissions;
  }
  const auto fresh = write_beside(real, content, mode);
  if (!fresh) return std::unexpected(system_problem("writing", path, kExitFailure));
  if (::rename(fresh->c_str(), real.c_str()) != 0) {
    const Problem problem = system_problem("writing", path, kExitFailure);
    ::unlink(fresh->c_str());
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
  auto written = replace_file(path, content, Links::refuse);
  if (!written) ::unlink(path.c_str());
  return written;
}

}  // namespace tm485::cli
