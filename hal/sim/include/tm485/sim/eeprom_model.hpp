// The EEPROM of the simulated encoder: pages of 127 bytes, the page register, busy times, what a power loss leaves.
// Specification: section 5.
//
// Busy times and intervals run from the start bit of a request to that of another, as T1 does. While a write is under
// way nobody can read, so its byte is replaced at once; only a power loss before its end shows the difference.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "tm485/sim/random.hpp"
#include "tm485/time.hpp"

namespace tm485::sim {

/// Fixed once the model is built.
struct EepromConfig {
  unsigned pages = 7;                                   ///< 1..7; pages above read FF and ignore writes
  Time write_time_min = std::chrono::milliseconds{10};  ///< busy after a write: uniform in write_time_min..
  Time write_time_max = std::chrono::milliseconds{10};  ///< ..write_time_max; less than 4 s above it
  std::optional<Time> page_time = {};  ///< busy after a page select; none: 18 ms, T-format not at all
  std::optional<bool> write_reply_busy =
      {};                          ///< the reply to an accepted write has ADF.7; none: T-format only
  bool deaf_while_busy = false;    ///< requests other than those of the EEPROM get no reply while it is busy
  bool page_volatile = true;       ///< false: the page register survives a power cycle
  std::uint8_t power_up_page = 0;  ///< page after power-up; if it is not volatile, after the first
  double failed_writes = 0.0;      ///< probability 0..1 that a write leaves the old value, with no other sign
  Time write_interval =
      std::chrono::milliseconds{10};  ///< least span from a write to the next write, judged only
  Time page_interval = std::chrono::milliseconds{18};  ///< the same from a page select
  Time busy_at_start{0};   ///< busy until this instant, at whatever power-up before it
  std::uint64_t seed = 1;  ///< of busy times, failed writes, what a power loss leaves
};

/// One owner; nothing blocks or allocates; constant time unless it says otherwise.
class EepromModel {
 public:
  static constexpr std::size_t kPages = 7;
  static constexpr std::size_t kBytesPerPage = 127;
  static constexpr std::size_t kBytes = kPages * kBytesPerPage;
  static constexpr std::uint8_t kPageRegister = 127;
  using Image = std::array<std::uint8_t, kBytes>;

  /// Erased: every byte FF.
  explicit EepromModel(const EepromConfig& config = {}) noexcept;

  /// The byte at `address` 0..127 of the selected page, whether or not it is busy; 127 reads the page register.
  [[nodiscard]] std::uint8_t read(std::uint8_t address) const noexcept {
    if (address >= kPageRegister) return page_;
    return page_ < config_.pages ? image_[index(page_, address)] : std::uint8_t{0xFF};
  }

  /// Stores a byte at `address` 0..127, or selects a page. `start` is the first start bit of the request. Returns
  /// false, and does nothing, while busy. On a page that is not there it does nothing either, and is not busy.
  bool write(std::uint8_t address, std::uint8_t value, Time start) noexcept;

  /// Whether a request that starts at `start` finds it busy.
  [[nodiscard]] bool busy(Time start) const noexcept { return start < busy_until_; }
  [[nodiscard]] Time busy_until() const noexcept { return busy_until_; }

  /// The supply fails: a byte that is being written becomes garbage, a page register that is not volatile and is
  /// being changed has either value. Everything else is intact.
  void on_power_off(Time at) noexcept;

  /// Power-up: the bytes stay, a volatile page register does not; not busy, unless EepromConfig::busy_at_start says so.
  void on_power_up() noexcept;

  /// All bytes, page after page, `pages` * 127 of them. A write under way counts as done.
  [[nodiscard]] std::span<const std::uint8_t> image() const noexcept {
    return std::span{image_}.first(config_.pages * kBytesPerPage);
  }

  /// Replaces all bytes; a write under way is forgotten. Counts no writes. False, and nothing is changed, unless
  /// `bytes` has `pages` * 127. Linear in that.
  bool set_image(std::span<const std::uint8_t> bytes) noexcept;

  /// The bytes as they were when the last write that was complete at `now` was: one under way is not in it. The first
  /// `pages` * 127 count.
  [[nodiscard]] Image settled_image(Time now) const noexcept;

  /// Rises with every change of settled_image(now): whoever keeps a copy compares this instead of the bytes.
  [[nodiscard]] std::uint64_t generation(Time now) const noexcept {
    return generation_ - (written_ != kNone && busy(now) ? 1 : 0);
  }

  /// Endurance: how often the byte at `page` 0..6, `address` 0..126 was written, and all of them together. Writes that
  /// failed count, those that were refused or ignored do not.
  [[nodiscard]] std::uint32_t writes(std::size_t page, std::size_t address) const noexcept {
    return writes_[index(page, address)];
  }
  [[nodiscard]] std::uint64_t writes() const noexcept { return all_writes_; }
  [[nodiscard]] std::uint64_t page_selects() const noexcept { return page_selects_; }
  [[nodiscard]] std::uint64_t failed_writes() const noexcept { return failed_writes_; }
  [[nodiscard]] std::uint64_t spoiled_bytes() const noexcept { return spoiled_bytes_; }  ///< by power losses

  /// Writes and page selects, refused ones included, that began less than `write_interval` after the start of an
  /// accepted write, or `page_interval` after that of a page select.
  [[nodiscard]] std::uint64_t interval_violations() const noexcept { return interval_violations_; }

 private:
  static constexpr std::size_t kNone = kBytes;  // no byte

  static constexpr std::size_t index(std::size_t page, std::size_t address) noexcept {
    return page * kBytesPerPage + address;
  }
  void store(std::size_t at, std::uint8_t value) noexcept;
  [[nodiscard]] Time draw_write_time() noexcept;

  EepromConfig config_;
  Random random_;
  std::uint8_t page_;
  std::uint8_t page_before_;      // the last select
  std::uint8_t byte_before_ = 0;  // the last write, at written_
  std::size_t written_ = kNone;   // byte that the busy time, if it still runs, belongs to
  Time busy_until_ = -kNever;
  Time next_allowed_ = -kNever;
  std::uint64_t generation_ = 0;
  std::uint64_t all_writes_ = 0;
  std::uint64_t page_selects_ = 0;
  std::uint64_t failed_writes_ = 0;
  std::uint64_t spoiled_bytes_ = 0;
  std::uint64_t interval_violations_ = 0;
  Image image_;
  std::array<std::uint32_t, kBytes> writes_{};
};

}  // namespace tm485::sim
