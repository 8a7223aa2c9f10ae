// The C library's own calls, behind those that interpose.cpp defines.
#pragma once

#include <poll.h>
#include <sys/stat.h>
#include <sys/types.h>

#include <cstddef>
#include <ctime>
#include <mutex>
#include <optional>

namespace tm485::linux_hal::fake {

class FakeDevice;

namespace real {
int open(const char* path, int flags, mode_t mode = 0);
int openat(int folder, const char* path, int flags, mode_t mode);
int close(int fd);
int ioctl(int fd, unsigned long request, void* argument);
ssize_t read(int fd, void* buffer, std::size_t count);
ssize_t write(int fd, const void* buffer, std::size_t count);
int poll(pollfd* waited, nfds_t count, int timeout_ms);
int ppoll(pollfd* waited, nfds_t count, const timespec* timeout, const sigset_t* mask);
int flock(int fd, int operation);
int stat(const char* path, struct stat* status);
int lstat(const char* path, struct stat* status);
int fstat(int fd, struct stat* status);
int access(const char* path, int mode);
char* realpath(const char* path, char* resolved);
}  // namespace real

/// How the interposed calls reach the kernel of the test. Only while lock() is held.
namespace entry {
std::recursive_mutex& lock();
FakeDevice* device_of(int fd);
FakeDevice* device_at(const char* path);
/// Where a link leads that the test has made, or null.
const char* link_at(const char* path);
/// The descriptor or -errno; nothing if the path is not a fake one.
std::optional<int> open(const char* path, int flags);
void close(int fd);
}  // namespace entry

}  // namespace tm485::linux_hal::fake
