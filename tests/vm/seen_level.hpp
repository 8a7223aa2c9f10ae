// The level of a line as others than our code see it: a file of gpio-sim in sysfs, or the data register of a PL061.
#pragma once

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <string>

#include "tm485/posix/file_descriptor.hpp"

namespace tm485::vm {

/// "/sys/.../value", which holds 0 or 1; or "0x90300a0", the physical address of a byte that is 0 while the line is.
class SeenLevel {
 public:
  explicit SeenLevel(const std::string& where) {
    if (where.starts_with("0x")) {
      const auto address = static_cast<off_t>(std::strtoull(where.c_str(), nullptr, 16));
      const off_t page = address & ~off_t{kPage - 1};
      file_ = posix::FileDescriptor(::open("/dev/mem", O_RDONLY | O_SYNC | O_CLOEXEC));
      void* const memory = ::mmap(nullptr, kPage, PROT_READ, MAP_SHARED, file_.get(), page);
      if (memory != MAP_FAILED)
        register_ = static_cast<const volatile std::uint8_t*>(memory) + (address - page);
    } else {
      file_ = posix::FileDescriptor(::open(where.c_str(), O_RDONLY | O_CLOEXEC));
    }
  }

  /// 0 or 1; -1 if it cannot be seen.
  [[nodiscard]] int level() const {
    if (register_ != nullptr) return *register_ != 0 ? 1 : 0;
    char text = 0;
    if (::pread(file_.get(), &text, 1, 0) != 1) return -1;
    return text == '0' ? 0 : text == '1' ? 1 : -1;
  }

 private:
  static constexpr std::size_t kPage = 4096;
  posix::FileDescriptor file_;
  const volatile std::uint8_t* register_ = nullptr;  ///< mapped until the program ends
};

}  // namespace tm485::vm
