// The system calls that come to the fake kernel first: strong symbols of the executable, found by the linker before
// those of the C library, also for the calls of shared libraries.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdarg>
#include <cstdlib>
#include <cstring>

#include "fake_kernel.hpp"
#include "real_calls.hpp"

namespace tm485::linux_hal::fake {
namespace {

/// The next definition of `name` behind this executable.
template <class Function>
Function* next(const char* name) {
  void* const found = dlsym(RTLD_NEXT, name);
  if (found == nullptr) std::abort();
  return reinterpret_cast<Function*>(found);
}

template <class Value>
Value answer(Value result) {
  if (result >= 0) return result;
  errno = static_cast<int>(-result);
  return -1;
}

bool needs_mode(int flags) { return (flags & O_CREAT) != 0 || (flags & O_TMPFILE) == O_TMPFILE; }

/// Fakes answer at once, real descriptors without waiting if a fake is among them.
std::optional<int> poll_fakes(pollfd* waited, nfds_t count) {
  bool any = false;
  int ready = 0;
  for (nfds_t i = 0; i < count; ++i) any = any || entry::device_of(waited[i].fd) != nullptr;
  if (!any) return std::nullopt;
  for (nfds_t i = 0; i < count; ++i) {
    waited[i].revents = 0;
    if (FakeDevice* const device = entry::device_of(waited[i].fd))
      waited[i].revents = device->on_poll(waited[i].fd, waited[i].events);
    else
      (void)real::poll(&waited[i], 1, 0);
    if (waited[i].revents != 0) ++ready;
  }
  return ready;
}

int stat_path(const char* path, struct stat* status, int (*otherwise)(const char*, struct stat*)) {
  {
    const std::scoped_lock lock(entry::lock());
    if (FakeDevice* const device = entry::device_at(path)) return answer(device->on_stat(*status));
  }
  return otherwise(path, status);
}

}  // namespace

namespace real {
int open(const char* path, int flags, mode_t mode) {
  static const auto call = next<int(const char*, int, ...)>("open");
  return call(path, flags, mode);
}
int openat(int folder, const char* path, int flags, mode_t mode) {
  static const auto call = next<int(int, const char*, int, ...)>("openat");
  return call(folder, path, flags, mode);
}
int close(int fd) {
  static const auto call = next<int(int)>("close");
  return call(fd);
}
int ioctl(int fd, unsigned long request, void* argument) {
  static const auto call = next<int(int, unsigned long, ...)>("ioctl");
  return call(fd, request, argument);
}
ssize_t read(int fd, void* buffer, std::size_t count) {
  static const auto call = next<ssize_t(int, void*, std::size_t)>("read");
  return call(fd, buffer, count);
}
ssize_t write(int fd, const void* buffer, std::size_t count) {
  static const auto call = next<ssize_t(int, const void*, std::size_t)>("write");
  return call(fd, buffer, count);
}
int poll(pollfd* waited, nfds_t count, int timeout_ms) {
  static const auto call = next<int(pollfd*, nfds_t, int)>("poll");
  return call(waited, count, timeout_ms);
}
int ppoll(pollfd* waited, nfds_t count, const timespec* timeout, const sigset_t* mask) {
  static const auto call = next<int(pollfd*, nfds_t, const timespec*, const sigset_t*)>("ppoll");
  return call(waited, count, timeout, mask);
}
int flock(int fd, int operation) {
  static const auto call = next<int(int, int)>("flock");
  return call(fd, operation);
}
int stat(const char* path, struct stat* status) {
  static const auto call = next<int(const char*, struct stat*)>("stat");
  return call(path, status);
}
int lstat(const char* path, struct stat* status) {
  static const auto call = next<int(const char*, struct stat*)>("lstat");
  return call(path, status);
}
int fstat(int fd, struct stat* status) {
  static const auto call = next<int(int, struct stat*)>("fstat");
  return call(fd, status);
}
int access(const char* path, int mode) {
  static const auto call = next<int(const char*, int)>("access");
  return call(path, mode);
}
char* realpath(const char* path, char* resolved) {
  static const auto call = next<char*(const char*, char*)>("realpath");
  return call(path, resolved);
}
}  // namespace real
}  // namespace tm485::linux_hal::fake

namespace fake = tm485::linux_hal::fake;

namespace {

int open_any(int folder, const char* path, int flags, mode_t mode) {
  if (folder == AT_FDCWD || (path != nullptr && path[0] == '/')) {
    const std::scoped_lock lock(fake::entry::lock());
    if (const auto fd = fake::entry::open(path, flags)) return fake::answer(*fd);
  }
  return fake::real::openat(folder, path, flags, mode);
}

}  // namespace

// NOLINTBEGIN(cert-dcl50-cpp): the C library's interface.
extern "C" {

int open(const char* path, int flags, ...) {
  mode_t mode = 0;
  if (fake::needs_mode(flags)) {
    va_list arguments;
    va_start(arguments, flags);
    mode = va_arg(arguments, mode_t);
    va_end(arguments);
  }
  return open_any(AT_FDCWD, path, flags, mode);
}

int open64(const char* path, int flags, ...) {
  mode_t mode = 0;
  if (fake::needs_mode(flags)) {
    va_list arguments;
    va_start(arguments, flags);
    mode = va_arg(arguments, mode_t);
    va_end(arguments);
  }
  return open_any(AT_FDCWD, path, flags | O_LARGEFILE, mode);
}

int openat(int folder, const char* path, int flags, ...) {
  mode_t mode = 0;
  if (fake::needs_mode(flags)) {
    va_list arguments;
    va_start(arguments, flags);
    mode = va_arg(arguments, mode_t);
    va_end(arguments);
  }
  return open_any(folder, path, flags, mode);
}

int close(int fd) {
  {
    const std::scoped_lock lock(fake::entry::lock());
    fake::entry::close(fd);
  }
  return fake::real::close(fd);
}

int ioctl(int fd, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  // The kernel takes 32 bits; a caller that keeps the number in an int extends its sign.
  const unsigned long kernel_request = static_cast<std::uint32_t>(request);
  {
    const std::scoped_lock lock(fake::entry::lock());
    if (fake::FakeDevice* const device = fake::entry::device_of(fd))
      return fake::answer(device->on_ioctl(fd, kernel_request, argument));
  }
  return fake::real::ioctl(fd, request, argument);
}

ssize_t read(int fd, void* buffer, std::size_t count) {
  {
    const std::scoped_lock lock(fake::entry::lock());
    if (fake::FakeDevice* const device = fake::entry::device_of(fd))
      return fake::answer(device->on_read(fd, {static_cast<std::byte*>(buffer), count}));
  }
  return fake::real::read(fd, buffer, count);
}

ssize_t write(int fd, const void* buffer, std::size_t count) {
  {
    const std::scoped_lock lock(fake::entry::lock());
    if (fake::FakeDevice* const device = fake::entry::device_of(fd))
      return fake::answer(device->on_write(fd, {static_cast<const std::byte*>(buffer), count}));
  }
  return fake::real::write(fd, buffer, count);
}

int poll(pollfd* waited, nfds_t count, int timeout_ms) {
  {
    const std::scoped_lock lock(fake::entry::lock());
    if (const auto ready = fake::poll_fakes(waited, count)) return *ready;
  }
  return fake::real::poll(waited, count, timeout_ms);
}

int ppoll(pollfd* waited, nfds_t count, const timespec* timeout, const sigset_t* mask) {
  {
    const std::scoped_lock lock(fake::entry::lock());
    if (const auto ready = fake::poll_fakes(waited, count)) return *ready;
  }
  return fake::real::ppoll(waited, count, timeout, mask);
}

int flock(int fd, int operation) noexcept {
  {
    const std::scoped_lock lock(fake::entry::lock());
    if (fake::FakeDevice* const device = fake::entry::device_of(fd))
      return fake::answer(device->on_flock(fd, operation));
  }
  return fake::real::flock(fd, operation);
}

int stat(const char* path, struct stat* status) noexcept {
  return fake::stat_path(path, status, fake::real::stat);
}

int lstat(const char* path, struct stat* status) noexcept {
  {
    // A symbolic link to a fake path is what it is.
    struct stat here{};
    if (fake::real::lstat(path, &here) == 0 && S_ISLNK(here.st_mode)) {
      *status = here;
      return 0;
    }
  }
  return fake::stat_path(path, status, fake::real::lstat);
}

int fstat(int fd, struct stat* status) noexcept {
  {
    const std::scoped_lock lock(fake::entry::lock());
    if (fake::FakeDevice* const device = fake::entry::device_of(fd))
      return fake::answer(device->on_stat(*status));
  }
  return fake::real::fstat(fd, status);
}

int access(const char* path, int mode) noexcept {
  {
    const std::scoped_lock lock(fake::entry::lock());
    if (fake::entry::device_at(path) != nullptr) return 0;
  }
  return fake::real::access(path, mode);
}

char* realpath(const char* path, char* resolved) noexcept {
  {
    const std::scoped_lock lock(fake::entry::lock());
    if (const char* const target = fake::entry::link_at(path))
      return resolved == nullptr ? strdup(target) : std::strcpy(resolved, target);
  }
  if (char* const real = fake::real::realpath(path, resolved)) return real;
  const int error_number = errno;
  {
    const std::scoped_lock lock(fake::entry::lock());
    if (fake::entry::device_at(path) == nullptr) {
      errno = error_number;
      return nullptr;
    }
  }
  return resolved == nullptr ? strdup(path) : std::strcpy(resolved, path);
}

}  // extern "C"
// NOLINTEND(cert-dcl50-cpp)
