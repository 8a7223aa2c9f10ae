// Register access as a policy: a driver is written once and runs on real registers, or on a model of them that
// keeps character time. Specification: section 1.
#pragma once

#include <concepts>
#include <cstddef>
#include <cstdint>

namespace tm485::mcu {

/// Reads and writes of a block of registers, `offset` in bytes from its start, naturally aligned. Every access
/// reaches the registers, once, in program order.
template <class R>
concept RegisterAccess =
    requires(R& registers, std::size_t offset, std::uint8_t byte, std::uint16_t half, std::uint32_t word) {
      { registers.read8(offset) } noexcept -> std::same_as<std::uint8_t>;
      { registers.read16(offset) } noexcept -> std::same_as<std::uint16_t>;
      { registers.read32(offset) } noexcept -> std::same_as<std::uint32_t>;
      { registers.write8(offset, byte) } noexcept -> std::same_as<void>;
      { registers.write16(offset, half) } noexcept -> std::same_as<void>;
      { registers.write32(offset, word) } noexcept -> std::same_as<void>;
    };

/// Registers that are mapped into the address space. The mapping must outlive every access. Any context that
/// owns the block.
class VolatileRegisters {
 public:
  /// Of a microcontroller: the address that its manual gives.
  // NOLINTNEXTLINE(performance-no-int-to-ptr): an address of hardware is a number.
  explicit VolatileRegisters(std::uintptr_t base) noexcept : base_(reinterpret_cast<std::byte*>(base)) {}
  /// Of a mapping.
  explicit VolatileRegisters(void* base) noexcept : base_(static_cast<std::byte*>(base)) {}

  [[nodiscard]] std::uint8_t read8(std::size_t offset) const noexcept { return *at<std::uint8_t>(offset); }
  [[nodiscard]] std::uint16_t read16(std::size_t offset) const noexcept { return *at<std::uint16_t>(offset); }
  [[nodiscard]] std::uint32_t read32(std::size_t offset) const noexcept { return *at<std::uint32_t>(offset); }
  void write8(std::size_t offset, std::uint8_t value) const noexcept { *at<std::uint8_t>(offset) = value; }
  void write16(std::size_t offset, std::uint16_t value) const noexcept { *at<std::uint16_t>(offset) = value; }
  void write32(std::size_t offset, std::uint32_t value) const noexcept { *at<std::uint32_t>(offset) = value; }

 private:
  template <class T>
  [[nodiscard]] volatile T* at(std::size_t offset) const noexcept {
    return reinterpret_cast<volatile T*>(base_ + offset);
  }

  std::byte* base_;
};

static_assert(RegisterAccess<VolatileRegisters>);

}  // namespace tm485::mcu
