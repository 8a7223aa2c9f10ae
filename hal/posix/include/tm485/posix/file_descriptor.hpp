// FileDescriptor: the one owner of a descriptor. Closes it; never copies it.
#pragma once

#include <unistd.h>

#include <utility>

namespace tm485::posix {

/// Any thread, one at a time.
class FileDescriptor {
 public:
  FileDescriptor() noexcept = default;
  /// Takes over `fd`; a negative one owns nothing.
  explicit FileDescriptor(int fd) noexcept : fd_(fd) {}
  FileDescriptor(FileDescriptor&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  FileDescriptor& operator=(FileDescriptor&& other) noexcept {
    if (this != &other) {
      close();
      fd_ = std::exchange(other.fd_, -1);
    }
    return *this;
  }
  FileDescriptor(const FileDescriptor&) = delete;
  FileDescriptor& operator=(const FileDescriptor&) = delete;
  ~FileDescriptor() { close(); }

  /// -1 if nothing is owned.
  [[nodiscard]] int get() const noexcept { return fd_; }
  [[nodiscard]] bool valid() const noexcept { return fd_ >= 0; }

  /// Closes now. Not repeated on EINTR: on Linux the descriptor is gone either way.
  void close() noexcept {
    if (fd_ >= 0) ::close(std::exchange(fd_, -1));
  }

 private:
  int fd_ = -1;
};

}  // namespace tm485::posix
