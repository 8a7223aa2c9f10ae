// The EEPROM of the simulated encoder: seven pages of 127 bytes and the page register.
// Specification: section 5. A write is stored at once; the time that it takes is judged by
// `interval_violations`, not simulated as a busy time.
#pragma once

#include <array>
#include <cstdint>

#include "tm485/time.hpp"

namespace tm485::sim {

class EepromModel {
 public:
  static constexpr std::size_t kPages = 7;
  static constexpr std::size_t kBytesPerPage = 127;
  static constexpr std::uint8_t kPageRegister = 127;

  EepromModel() noexcept {
    for (auto& page : pages_) page.fill(0xFF);
  }

  /// The byte at `address` 0..127 of the selected page; 127 reads the page register.
  [[nodiscard]] std::uint8_t read(std::uint8_t address) const noexcept {
    return address >= kPageRegister ? page_ : pages_[page_][address];
  }

  /// Stores a byte at `address` 0..127, or selects a page; a page above 6 is ignored. `start` is the first
  /// start bit of the request, for the judgement of the interval between writes.
  void write(std::uint8_t address, std::uint8_t value, Time start) noexcept {
    if (start < next_allowed_) ++interval_violations_;
    if (address >= kPageRegister) {
      if (value < kPages) page_ = value;
      next_allowed_ = start + kPageChangeTime;
    } else {
      pages_[page_][address] = value;
      next_allowed_ = start + kWriteTime;
    }
  }

  /// Power-up: the bytes stay, the page register is volatile.
  void on_power_up() noexcept { page_ = 0; }

  /// Writes that began less than 10 ms after the start of a write, or 18 ms after that of a page change.
  [[nodiscard]] std::uint64_t interval_violations() const noexcept { return interval_violations_; }

 private:
  static constexpr Time kWriteTime = std::chrono::milliseconds{10};
  static constexpr Time kPageChangeTime = std::chrono::milliseconds{18};

  std::array<std::array<std::uint8_t, kBytesPerPage>, kPages> pages_;
  std::uint8_t page_ = 0;
  Time next_allowed_{0};
  std::uint64_t interval_violations_ = 0;
};

}  // namespace tm485::sim
