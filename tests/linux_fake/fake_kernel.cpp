#include "fake_kernel.hpp"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/sysmacros.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <climits>
#include <cstdlib>
#include <cstring>
#include <mutex>
#include <optional>

#include "real_calls.hpp"

namespace tm485::linux_hal::fake {
namespace {

struct Failure {
  int error_number;
  int times;
};

struct State {
  std::map<std::string, FakeDevice*> paths;
  std::map<std::string, std::string> links;
  std::map<std::string, Failure> failures;
  std::map<int, FakeDevice*> descriptors;
  std::uint64_t opened = 0;
};

std::recursive_mutex& mutex() {
  static std::recursive_mutex instance;
  return instance;
}

State& state() {
  static State instance;
  return instance;
}

int allocate(FakeDevice& device, int flags) {
  const int fd = real::open("/dev/null", (flags & ~(O_CREAT | O_TRUNC | O_EXCL)) | O_CLOEXEC);
  if (fd < 0) return -errno;
  state().descriptors[fd] = &device;
  ++state().opened;
  return fd;
}

}  // namespace

int FakeDevice::on_open(int, int) { return 0; }
int FakeDevice::on_ioctl(int, unsigned long, void*) { return -ENOTTY; }
ssize_t FakeDevice::on_read(int, std::span<std::byte>) { return -EINVAL; }
ssize_t FakeDevice::on_write(int, std::span<const std::byte>) { return -EINVAL; }
short FakeDevice::on_poll(int, short events) { return static_cast<short>(events & (POLLIN | POLLOUT)); }
void FakeDevice::on_close(int fd) {
  if (locked_by_ == fd) locked_by_ = -1;
}

int FakeDevice::on_flock(int fd, int operation) {
  if ((operation & LOCK_UN) != 0) {
    if (locked_by_ == fd) locked_by_ = -1;
    return 0;
  }
  if (locked_by_ >= 0 && locked_by_ != fd) return -EWOULDBLOCK;
  if ((operation & LOCK_EX) != 0) locked_by_ = fd;
  return 0;
}

int FakeDevice::on_stat(struct stat& status) {
  status = {};
  status.st_mode = S_IFCHR | S_IRUSR | S_IWUSR | S_IRGRP | S_IWGRP;
  status.st_rdev = number_;
  status.st_nlink = 1;
  return 0;
}

void FakeDevice::set_device_number(unsigned major_number, unsigned minor_number) {
  number_ = makedev(major_number, minor_number);
}

ssize_t FakeFile::on_read(int fd, std::span<std::byte> buffer) {
  std::size_t& at = at_[fd];
  const std::size_t count = std::min(buffer.size(), text_.size() - at);
  std::memcpy(buffer.data(), text_.data() + at, count);
  at += count;
  return static_cast<ssize_t>(count);
}

int FakeFile::on_stat(struct stat& status) {
  status = {};
  status.st_mode = S_IFREG | S_IRUSR | S_IRGRP;
  status.st_size = static_cast<off_t>(text_.size());
  return 0;
}

FakeKernel::FakeKernel() {
  const std::scoped_lock lock(mutex());
  state() = {};
}

FakeKernel::~FakeKernel() {
  const std::scoped_lock lock(mutex());
  state() = {};
}

void FakeKernel::add(const std::string& path, FakeDevice& device) {
  const std::scoped_lock lock(mutex());
  state().paths[path] = &device;
}

void FakeKernel::add_link(const std::string& path, const std::string& target) {
  const std::scoped_lock lock(mutex());
  state().links[path] = target;
}

void FakeKernel::remove(const std::string& path) {
  const std::scoped_lock lock(mutex());
  state().paths.erase(path);
}

void FakeKernel::fail_open(const std::string& path, int error_number, int times) {
  const std::scoped_lock lock(mutex());
  state().failures[path] = {error_number, times};
}

int FakeKernel::make_descriptor(FakeDevice& device, int flags) {
  const std::scoped_lock lock(mutex());
  return allocate(device, flags);
}

std::size_t FakeKernel::open_descriptors() const {
  const std::scoped_lock lock(mutex());
  return state().descriptors.size();
}

std::uint64_t FakeKernel::opened() const {
  const std::scoped_lock lock(mutex());
  return state().opened;
}

// What the interposed calls ask.
namespace entry {

std::recursive_mutex& lock() { return mutex(); }

FakeDevice* device_of(int fd) {
  const auto found = state().descriptors.find(fd);
  return found == state().descriptors.end() ? nullptr : found->second;
}

FakeDevice* device_at(const char* path) {
  if (path == nullptr || state().paths.empty()) return nullptr;
  if (const auto found = state().paths.find(path); found != state().paths.end()) return found->second;
  char resolved[PATH_MAX];
  if (real::realpath(path, resolved) == nullptr) return nullptr;
  const auto found = state().paths.find(resolved);
  return found == state().paths.end() ? nullptr : found->second;
}

const char* link_at(const char* path) {
  const auto found = state().links.find(path == nullptr ? "" : path);
  return found == state().links.end() ? nullptr : found->second.c_str();
}

std::optional<int> open(const char* path, int flags) {
  if (path == nullptr) return std::nullopt;
  if (const auto failure = state().failures.find(path);
      failure != state().failures.end() && failure->second.times > 0) {
    --failure->second.times;
    return -failure->second.error_number;
  }
  FakeDevice* const device = device_at(path);
  if (device == nullptr) return std::nullopt;
  const int fd = allocate(*device, flags);
  if (fd < 0) return fd;
  if (const int result = device->on_open(fd, flags); result < 0) {
    state().descriptors.erase(fd);
    --state().opened;
    real::close(fd);
    return result;
  }
  return fd;
}

void close(int fd) {
  FakeDevice* const device = device_of(fd);
  if (device == nullptr) return;
  device->on_close(fd);
  device->FakeDevice::on_close(fd);
  state().descriptors.erase(fd);
}

}  // namespace entry
}  // namespace tm485::linux_hal::fake
