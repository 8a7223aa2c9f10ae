// A fake kernel for the tests of hal/linux: the real code runs, and its system calls meet fake devices.
//
// This executable defines open, ioctl, read, write, poll, close and their like, so that calls from the code under test
// and from shared libraries (libgpiod) come here first. A path or a descriptor that belongs to no fake device goes on to
// the C library. Calls that the C library makes itself (isatty, tcflush, tcgetattr, fopen, std::ifstream) do not come
// here.
//
// A fake descriptor is a real one of /dev/null: its number is its own, and it counts in /proc/self/fd if it leaks.
#pragma once

#include <poll.h>
#include <sys/stat.h>
#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace tm485::linux_hal::fake {

/// A device behind a path. Every answer is that of a driver: 0 or more, or -errno. Called under the kernel's lock, which
/// the same thread may take again (a device may call the FakeKernel).
class FakeDevice {
 public:
  FakeDevice() = default;
  FakeDevice(const FakeDevice&) = delete;
  FakeDevice& operator=(const FakeDevice&) = delete;
  virtual ~FakeDevice() = default;

  /// 0 or -errno. `fd` is the number that open() will answer.
  virtual int on_open(int fd, int flags);
  virtual int on_ioctl(int fd, unsigned long request, void* argument);  ///< -ENOTTY unless overridden
  virtual ssize_t on_read(int fd, std::span<std::byte> buffer);         ///< -EINVAL unless overridden
  virtual ssize_t on_write(int fd, std::span<const std::byte> bytes);   ///< -EINVAL unless overridden
  /// What poll() reports of `events` (and POLLERR, POLLHUP); 0: not ready. A fake kernel does not wait: if nothing is
  /// ready, poll() answers 0 at once.
  virtual short on_poll(int fd, short events);
  virtual void on_close(int fd);
  /// flock(): an exclusive lock is held by one descriptor at a time.
  virtual int on_flock(int fd, int operation);
  /// stat(), lstat(), fstat(): a character device 0660 of `device_number()` unless overridden.
  virtual int on_stat(struct stat& status);

  [[nodiscard]] dev_t device_number() const { return number_; }
  void set_device_number(unsigned major_number, unsigned minor_number);

 private:
  dev_t number_ = 0;
  int locked_by_ = -1;
};

/// A file with a fixed text, such as one of sysfs that a library opens by its absolute path.
class FakeFile : public FakeDevice {
 public:
  explicit FakeFile(std::string text) : text_(std::move(text)) {}
  ssize_t on_read(int fd, std::span<std::byte> buffer) override;
  int on_stat(struct stat& status) override;
  void on_close(int fd) override { at_.erase(fd); }

 private:
  std::string text_;
  std::map<int, std::size_t> at_;
};

/// The one kernel of a test. Made at its beginning; at its end every path and descriptor is forgotten.
class FakeKernel {
 public:
  FakeKernel();
  ~FakeKernel();
  FakeKernel(const FakeKernel&) = delete;
  FakeKernel& operator=(const FakeKernel&) = delete;

  /// `device` is behind `path` from now on; it must outlive the kernel or its removal. A symbolic link of the real file
  /// system that leads to `path` leads to the device too, if a (real, empty) file is there.
  void add(const std::string& path, FakeDevice& device);
  /// realpath() of `path` answers `target`, as for a symbolic link of sysfs.
  void add_link(const std::string& path, const std::string& target);
  /// The path is gone: ENOENT (or what is really there). Descriptors stay, as after an unplugging.
  void remove(const std::string& path);
  /// The next `times` opens of `path` fail with `error_number`, before the device is asked.
  void fail_open(const std::string& path, int error_number, int times = 1);

  /// A further descriptor of a device, for an ioctl that answers one (a line request of a gpiochip), or -errno.
  [[nodiscard]] int make_descriptor(FakeDevice& device, int flags = 0);

  /// Fake descriptors that are open now: 0 unless something leaks.
  [[nodiscard]] std::size_t open_descriptors() const;
  /// Descriptors that have ever been handed out.
  [[nodiscard]] std::uint64_t opened() const;
};

}  // namespace tm485::linux_hal::fake
