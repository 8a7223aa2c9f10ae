// MemoryMapping: the registers of a device in this process's address space, by UIO or by /dev/mem.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <string>
#include <utility>

#include "tm485/linux/os_error.hpp"
#include "tm485/posix/file_descriptor.hpp"

namespace tm485::linux_hal {

/// Which registers.
struct RegisterRange {
  std::uint64_t address = 0;  ///< physical, of the first register
  std::size_t length = 0;     ///< bytes, a multiple of `width`, not 0
  std::size_t width = 4;      ///< bytes an access: 1, 2 or 4; some blocks answer to no other
};

/// The one owner of a mapping. Any thread, one at a time.
class MemoryMapping {
 public:
  /// Maps physical memory through `path`, /dev/mem as a rule; any file of the same shape does. Errors: an OsError with
  /// the failed step, its errno and a remedy; EBUSY if another program has mapped this range by this function, EFAULT
  /// if nothing answers there. Nothing stays open. Set-up.
  [[nodiscard]] static std::expected<MemoryMapping, OsError> physical(const std::string& path,
                                                                      const RegisterRange& range);

  /// Maps region 0 of a UIO device such as /dev/uio0. `sysfs` is where its description lies: SYSFS/class/uio. An
  /// address of 0 takes what the device has; any other must be the device's. Errors: as above, and EINVAL if the
  /// region is another one or too short.
  [[nodiscard]] static std::expected<MemoryMapping, OsError> uio(const std::string& path,
                                                                 const std::string& sysfs,
                                                                 const RegisterRange& range);

  MemoryMapping() noexcept = default;
  MemoryMapping(MemoryMapping&& other) noexcept
      : fd_(std::move(other.fd_)),
        base_(std::exchange(other.base_, nullptr)),
        mapped_(std::exchange(other.mapped_, 0)),
        offset_(std::exchange(other.offset_, 0)) {}
  MemoryMapping& operator=(MemoryMapping&& other) noexcept;
  MemoryMapping(const MemoryMapping&) = delete;
  MemoryMapping& operator=(const MemoryMapping&) = delete;
  ~MemoryMapping() { unmap(); }

  [[nodiscard]] bool valid() const noexcept { return base_ != nullptr; }
  /// The first register; null if nothing is mapped.
  [[nodiscard]] void* registers() const noexcept { return base_ == nullptr ? nullptr : base_ + offset_; }

 private:
  /// Opens, locks and maps `length` bytes at `offset` of the file. 0 or errno; `step` says where.
  [[nodiscard]] int map(const std::string& path, std::uint64_t offset, std::size_t length, const char*& step);
  void unmap() noexcept;

  posix::FileDescriptor fd_;  ///< holds the lock
  std::byte* base_ = nullptr;
  std::size_t mapped_ = 0;  ///< bytes, whole pages
  std::size_t offset_ = 0;  ///< of the first register in the first page
};

/// The kernel driver that has the UART at a physical address, if it shows itself as a tty.
struct BoundDriver {
  std::string tty;     ///< "ttyAMA0"
  std::string device;  ///< "9000000.pl011"
  std::string bus;     ///< "amba"; empty if it is not known
  std::string driver;  ///< "uart-pl011"; empty if it is not known
};

/// Looks in SYSFS/class/tty. Nothing found: `tty` is empty. Set-up.
[[nodiscard]] BoundDriver find_bound_driver(const std::string& sysfs, std::uint64_t address);

}  // namespace tm485::linux_hal
