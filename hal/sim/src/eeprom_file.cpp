#include "eeprom_file.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "server_error.hpp"
#include "tm485/posix/file_descriptor.hpp"
#include "tm485/posix/replace_file.hpp"

namespace tm485::sim {
namespace {

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

}  // namespace

EepromFile::EepromFile(const std::string& path) : path_{posix::without_links(path)} {}

std::expected<std::optional<std::vector<std::uint8_t>>, ServerError> EepromFile::load(std::size_t size) {
  const std::string what = "loading the EEPROM from '" + path_ + "'";
  const posix::FileDescriptor file{::open(path_.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)};
  if (!file.valid()) {
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
  const std::error_code error = posix::replace_file(path_, bytes);
  if (!error) return {};
  errno = error.value();
  return failed(what, "choose a path in a directory that exists, that you may write, and that has space");
}

}  // namespace tm485::sim
