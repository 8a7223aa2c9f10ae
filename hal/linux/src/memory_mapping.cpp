#include "tm485/linux/memory_mapping.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <csetjmp>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <optional>
#include <string_view>
#include <system_error>

namespace tm485::linux_hal {
namespace {

namespace fs = std::filesystem;

OsError mapping_error(const std::string& path, std::string_view step, int error_number) {
  return make_os_error(Resource::mapped_uart, path, step, error_number);
}

/// A number as sysfs writes it: "0x9000000" or "4096".
std::optional<std::uint64_t> read_number(const fs::path& path) {
  std::ifstream file(path);
  std::string text;
  if (!(file >> text)) return std::nullopt;
  const bool hexadecimal = text.starts_with("0x") || text.starts_with("0X");
  const std::string_view digits = std::string_view(text).substr(hexadecimal ? 2 : 0);
  std::uint64_t number = 0;
  const auto [end, error] =
      std::from_chars(digits.data(), digits.data() + digits.size(), number, hexadecimal ? 16 : 10);
  if (error != std::errc{} || end != digits.data() + digits.size()) return std::nullopt;
  return number;
}

std::string name_behind(const fs::path& link) {
  std::error_code error;
  const fs::path target = fs::read_symlink(link, error);
  return error ? std::string() : target.filename().string();
}

// A read where no device answers ends on many processors as SIGBUS. At set-up, and only there, that is an answer.
// volatile: the handler reads it between two accesses of which the compiler knows nothing.
thread_local sigjmp_buf* volatile bus_error_target = nullptr;

extern "C" void on_bus_error(int number) {
  if (bus_error_target != nullptr) siglongjmp(*bus_error_target, 1);
  (void)signal(number, SIG_DFL);  // not ours: the access is repeated and ends the program as it would have
}

template <class T>
void read_as(const volatile void* where) noexcept {
  (void)*static_cast<const volatile T*>(where);
}

void read_one(const volatile std::byte* where, std::size_t width) noexcept {
  if (width == 4) return read_as<std::uint32_t>(where);
  if (width == 2) return read_as<std::uint16_t>(where);
  read_as<std::uint8_t>(where);
}

/// True if both ends of the range can be read.
bool answers(const void* registers, const RegisterRange& range) noexcept {
  const auto* const first = static_cast<const volatile std::byte*>(registers);
  struct sigaction ours{};
  struct sigaction before{};
  ours.sa_handler = on_bus_error;
  sigemptyset(&ours.sa_mask);
  if (sigaction(SIGBUS, &ours, &before) != 0) return true;
  sigjmp_buf target;
  volatile bool good = false;
  if (sigsetjmp(target, 1) == 0) {
    bus_error_target = &target;
    read_one(first, range.width);
    read_one(first + (range.length - range.width), range.width);
    good = true;
  }
  bus_error_target = nullptr;
  sigaction(SIGBUS, &before, nullptr);
  return good;
}

/// 0, or the errno that means "another program has it". The lock belongs to this open file, goes with it, and covers
/// this range only, so that two UARTs of one /dev/mem do not exclude each other.
int lock(int fd, std::uint64_t offset, std::size_t length) noexcept {
  struct flock range{};
  range.l_type = F_WRLCK;
  range.l_whence = SEEK_SET;
  range.l_start = static_cast<off_t>(offset);
  range.l_len = static_cast<off_t>(length);
  if (fcntl(fd, F_OFD_SETLK, &range) == 0) return 0;
  return errno == EAGAIN || errno == EACCES ? EBUSY : 0;  // a file that knows no locks is no reason to refuse
}

}  // namespace

int MemoryMapping::map(const std::string& path, std::uint64_t offset, std::size_t length, const char*& step) {
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  const std::size_t inside = static_cast<std::size_t>(offset % page);
  // O_SYNC: not through the cache.
  step = "open";
  fd_ = posix::FileDescriptor(::open(path.c_str(), O_RDWR | O_SYNC | O_CLOEXEC | O_NOCTTY));
  if (!fd_.valid()) return errno;
  step = "lock";
  if (const int error_number = lock(fd_.get(), offset, length); error_number != 0) return error_number;
  step = "mmap";
  const std::size_t mapped = (inside + length + page - 1) / page * page;
  void* const base = mmap(nullptr, mapped, PROT_READ | PROT_WRITE, MAP_SHARED, fd_.get(),
                          static_cast<off_t>(offset - inside));
  if (base == MAP_FAILED) return errno;
  base_ = static_cast<std::byte*>(base);
  mapped_ = mapped;
  offset_ = inside;
  return 0;
}

MemoryMapping& MemoryMapping::operator=(MemoryMapping&& other) noexcept {
  if (this == &other) return *this;
  unmap();
  fd_ = std::move(other.fd_);
  base_ = std::exchange(other.base_, nullptr);
  mapped_ = std::exchange(other.mapped_, 0);
  offset_ = std::exchange(other.offset_, 0);
  return *this;
}

void MemoryMapping::unmap() noexcept {
  if (base_ != nullptr) munmap(std::exchange(base_, nullptr), mapped_);
}

std::expected<MemoryMapping, OsError> MemoryMapping::physical(const std::string& path,
                                                              const RegisterRange& range) {
  MemoryMapping mapping;
  const char* step = "";
  if (const int error_number = mapping.map(path, range.address, range.length, step); error_number != 0)
    return std::unexpected(mapping_error(path, step, error_number));
  if (!answers(mapping.registers(), range)) return std::unexpected(mapping_error(path, "read", EFAULT));
  return mapping;
}

std::expected<MemoryMapping, OsError> MemoryMapping::uio(const std::string& path, const std::string& sysfs,
                                                         const RegisterRange& range) {
  // The device first: a path that is not there has a better error than a description that is not there.
  if (::access(path.c_str(), F_OK) != 0) return std::unexpected(mapping_error(path, "access", errno));
  const fs::path region = fs::path(sysfs) / "class/uio" / fs::path(path).filename() / "maps/map0";
  const auto size = read_number(region / "size");
  if (!size) return std::unexpected(mapping_error(path, "read " + (region / "size").string(), ENOTTY));
  const std::uint64_t offset = read_number(region / "offset").value_or(0);
  const std::uint64_t address = read_number(region / "addr").value_or(0);
  const auto page = static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
  if (*size < range.length || offset >= page)
    return std::unexpected(mapping_error(path, "region 0 is too short", EINVAL));
  // Older kernels give the page of the region, newer ones its first byte.
  if (range.address != 0 && address != 0 && range.address != address && range.address != address + offset)
    return std::unexpected(mapping_error(path, "region 0 has another address", EINVAL));
  MemoryMapping mapping;
  const char* step = "";
  if (const int error_number = mapping.map(path, offset, range.length, step); error_number != 0)
    return std::unexpected(mapping_error(path, step, error_number));
  if (!answers(mapping.registers(), range)) return std::unexpected(mapping_error(path, "read", EFAULT));
  return mapping;
}

BoundDriver find_bound_driver(const std::string& sysfs, std::uint64_t address) {
  std::error_code error;
  for (const fs::directory_entry& entry : fs::directory_iterator(fs::path(sysfs) / "class/tty", error)) {
    if (read_number(entry.path() / "iomem_base") != address) continue;
    BoundDriver found;
    found.tty = entry.path().filename().string();
    // Newer kernels put devices of their own between the tty and the UART.
    fs::path device = fs::canonical(entry.path() / "device", error);
    while (!error && device.has_relative_path() &&
           (name_behind(device / "driver").empty() || name_behind(device / "subsystem") == "serial-base"))
      device = device.parent_path();
    if (error || !device.has_relative_path()) return found;
    found.device = device.filename().string();
    found.bus = name_behind(device / "subsystem");
    found.driver = name_behind(device / "driver");
    return found;
  }
  return {};
}

}  // namespace tm485::linux_hal
