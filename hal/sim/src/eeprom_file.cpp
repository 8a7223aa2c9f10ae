#include "eeprom_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <system_error>
#include <utility>

#include "endpoint.hpp"
#include "server_error.hpp"

namespace tm485::sim {
namespace {

constexpr mode_t kNewFileMode = S_IRUSR | S_IWUSR | S_IRGRP | S_IROTH;
constexpr mode_t kPermissions = 0777;

/// Where the links lead, so that a save replaces the file and not the link.
std::string without_links(const std::string& path) {
  std::error_code error;
  const auto real = std::filesystem::weakly_canonical(path, error);
  return error ? path : real.string();
}

bool read_all(int fd, std::span<std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::read(fd, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count == 0) errno = EIO;  // it has become shorter
    if (count <= 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

bool write_all(int fd, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t count = ::write(fd, bytes.data(), bytes.size());
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return false;
    bytes = bytes.subspan(static_cast<std::size_t>(count));
  }
  return true;
}

/// A file of a new name, written to `name`: what lies beside `path` is somebody's, a link or a pipe perhaps, and is left alone.
FileDescriptor create_beside(const std::string& path, mode_t mode, std::string& name) {
  constexpr int kMostLeftovers = 16;  // of processes that were killed
  int file = -1;
  for (int attempt = 0; attempt < kMostLeftovers && file < 0; ++attempt) {
    name = path + "." + std::to_string(::getpid()) + "." + std::to_string(attempt) + ".new";
    file = ::open(name.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, mode);
    if (file < 0 && errno != EEXIST) break;
  }
  return FileDescriptor{file};
}

}  // namespace

EepromFile::EepromFile(const std::string& path) : path_{without_links(path)} {}

std::expected<std::optional<std::vector<std::uint8_t>>, ServerError> EepromFile::load(std::size_t size) {
  const std::string what = "loading the EEPROM from '" + path_ + "'";
  const FileDescriptor file{::open(path_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  if (!file.is_open()) {
    if (errno == ENOENT) return std::nullopt;
    return failed(what, "choose a file that you may read");
  }
  struct stat status{};
  if (::fstat(file.get(), &status) != 0) return failed(what, "check the file system of the path");
  if (!S_ISREG(status.st_mode)) return refused(what, "it is not a regular file", "choose another path");
  if (static_cast<std::size_t>(status.st_size) != size) {
    return refused(what,
                   "it has " + std::to_string(status.st_size) + " bytes, this encoder's EEPROM has " +
                       std::to_string(size),
                   "choose another file; one that does not exist is created");
  }
  std::vector<std::uint8_t> bytes(size);
  if (!read_all(file.get(), bytes)) return failed(what, "check the file system of the path");
  return bytes;
}

std::expected<void, ServerError> EepromFile::save(std::span<const std::uint8_t> bytes) const {
  const std::string what = "saving the EEPROM to '" + path_ + "'";
  const char* const remedy =
      "choose a path in a directory that exists, that you may write, and that has space";
  struct stat old{};
  const bool replaces = ::stat(path_.c_str(), &old) == 0;
  const mode_t mode = old.st_mode & kPermissions;
  std::string fresh;
  const FileDescriptor file = create_beside(path_, replaces ? mode : kNewFileMode, fresh);
  if (!file.is_open()) return failed(what, remedy);
  if (!write_all(file.get(), bytes) || (replaces && ::fchmod(file.get(), mode) != 0) ||
      ::fsync(file.get()) != 0 || ::rename(fresh.c_str(), path_.c_str()) != 0) {
    const auto error = failed(what, remedy);
    ::unlink(fresh.c_str());
    return error;
  }
  return {};
}

}  // namespace tm485::sim
