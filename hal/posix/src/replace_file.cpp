#include "tm485/posix/replace_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdio>
#include <filesystem>
#include <optional>

#include "tm485/posix/file_descriptor.hpp"

namespace tm485::posix {
namespace {

constexpr mode_t kNewFileMode = S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH;
constexpr mode_t kPermissions = 0777;

std::error_code last_error() { return {errno, std::generic_category()}; }

bool write_all(int fd, std::span<const std::uint8_t> rest) {
  while (!rest.empty()) {
    const ssize_t count = ::write(fd, rest.data(), rest.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return false;
    rest = rest.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

/// A new file beside `path`, its name written to `name`. Of no valid descriptor errno says why.
FileDescriptor create_beside(const std::string& path, mode_t mode, std::string& name) {
  constexpr int kMostLeftovers = 16;  // of processes that were killed
  for (int attempt = 0; attempt < kMostLeftovers; ++attempt) {
    name = path + "." + std::to_string(::getpid()) + "." + std::to_string(attempt) + ".new";
    const int file = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
    if (file >= 0 || errno != EEXIST) return FileDescriptor(file);
  }
  return {};
}

/// A new name in a directory lasts once the directory is on the disk.
void sync_directory_of(const std::string& path) {
  const auto parent = std::filesystem::path(path).parent_path();
  const FileDescriptor folder(
      ::open(parent.empty() ? "." : parent.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (folder.valid()) (void)::fsync(folder.get());
}

}  // namespace

std::string without_links(const std::string& path) {
  std::error_code error;
  const auto real = std::filesystem::weakly_canonical(path, error);
  return error ? path : real.string();
}

std::error_code replace_file(const std::string& path, std::span<const std::uint8_t> content) {
  std::optional<mode_t> mode;
  if (struct stat old{}; ::lstat(path.c_str(), &old) == 0 && S_ISREG(old.st_mode))
    mode = old.st_mode & kPermissions;
  std::string fresh;
  FileDescriptor file = create_beside(path, mode.value_or(kNewFileMode), fresh);
  if (!file.valid()) return last_error();
  bool good = write_all(file.get(), content) && (!mode || ::fchmod(file.get(), *mode) == 0) &&
              ::fsync(file.get()) == 0;
  if (good) {
    file.close();  // not every file system renames what is open
    good = ::rename(fresh.c_str(), path.c_str()) == 0;
  }
  if (!good) {
    const std::error_code error = last_error();
    ::unlink(fresh.c_str());
    return error;
  }
  sync_directory_of(path);
  return {};
}

}  // namespace tm485::posix
