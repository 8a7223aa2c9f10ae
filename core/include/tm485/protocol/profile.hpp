// Profile: everything about an encoder that the documents leave open or that differs between
// members of the family. Every ambiguous number of the protocol is here and nowhere else.
// Specification: sections 4, 7 and 9.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <expected>
#include <span>
#include <string_view>

#include "tm485/errc.hpp"
#include "tm485/protocol/layout.hpp"
#include "tm485/protocol/request.hpp"
#include "tm485/protocol/status.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// The encoder IDs that a profile accepts: up to four, none means any.
struct EnidSet {
  static constexpr std::size_t kCapacity = 4;
  std::array<std::uint8_t, kCapacity> values{};
  std::uint8_t count = 0;

  [[nodiscard]] constexpr bool accepts(std::uint8_t enid) const noexcept {
    if (count == 0) return true;
    for (std::size_t i = 0; i < count; ++i)
      if (values[i] == enid) return true;
    return false;
  }
};

/// Plain data, so that it can be written down, loaded and compared. Defaults are those of a TM485
/// with 17 bit; `compile` checks it.
struct Profile {
  std::string_view name = "custom";  ///< in static storage, or owned by whoever loaded the profile

  // The shaft.
  std::uint8_t single_turn_bits = 17;  ///< 8..24
  std::uint8_t multi_turn_bits = 16;   ///< 0 (single-turn only) or 8..24; the count wraps and is signed
  EnidSet enids{{0x11}, 1};
  std::uint32_t abm_reserved = 0xFE0000;  ///< ABM bits that are 0; bit 16 is left open (A-1)
  std::int32_t multi_turn_start = 1;      ///< turn count after IDC, and after power-up without battery
  bool battery = false;                   ///< turns survive a power-off

  // The status bits. Those that the document reserves, and those by which a T-format encoder complains of
  // requests (SF.6, SF.7), are counted and follow the policy; they drop nothing.
  StatusSet reserved_status{0xCF, 0x3B};
  AlarmPolicy alarms = kAlarmsWithoutBattery;

  // The line.
  std::uint32_t bit_rate = 2'500'000;  ///< bit/s, 9600..10000000
  bool echo = false;                   ///< the port receives its own requests
  std::array<Time, kDataIdCount> t1 = default_t1(std::chrono::milliseconds(10));  ///< by index_of(id)
  Time t2_min{2'000};  ///< acceptance window of the reply's start bit
  Time t2_max{6'000};
  Time latch_offset{0};         ///< position latched this long after the request's last stop bit
  Time latch_uncertainty{500};  ///< ± of the latch instant

  // The life of the encoder.
  Time power_up_time = std::chrono::seconds(1);        ///< answers at the latest this long after power-up
  Time boot_time_min = std::chrono::milliseconds(50);  ///< and not earlier than this

  // Reset runs.
  std::uint8_t reset_count = 10;
  Time reset_spacing{62'500};
  Time reset_zero_settle = std::chrono::milliseconds(100);  ///< ID8 takes effect

  // EEPROM.
  std::uint8_t eeprom_pages = 7;
  std::uint8_t eeprom_page_bytes = 127;
  Time eeprom_write_time = std::chrono::milliseconds(10);
  Time eeprom_page_time = std::chrono::milliseconds(18);
  bool eeprom_holds_bus = true;  ///< nothing else is sent while a write or page change takes place (A-8)

  /// T1 per ID in the order of kDataIds: 40 µs, 62.5 µs for ID3 and the reset runs.
  [[nodiscard]] static constexpr std::array<Time, kDataIdCount> default_t1(Time after_write) noexcept {
    constexpr Time kShort{40'000};
    constexpr Time kLong{62'500};
    return {kShort, kShort, kShort, kLong, after_write, kLong, kLong, kLong, kShort};
  }
};

/// Why a profile was refused. Texts in static storage.
struct ProfileError {
  Errc code = Errc::bad_profile;
  std::string_view field;
  std::string_view why;
};

/// A reply's fixed bits as words: `(word & mask) == expected`. Bytes 0..7 of the reply are `low`,
/// the rest is `high`, both little endian.
struct ReplyRule {
  std::uint64_t low_mask = 0;
  std::uint64_t low_expected = 0;
  std::uint32_t high_mask = 0;
  std::uint32_t high_expected = 0;
  std::uint8_t length = 0;
  bool enid_listed = false;  ///< the words cannot say which ENIDs are good: look at the list as well
};

/// A profile that was checked and turned into what the cycle needs. Immutable; may live in flash.
class CompiledProfile {
 public:
  /// Checks and compiles. Any thread; a few hundred operations, so not in the cycle.
  [[nodiscard]] static constexpr std::expected<CompiledProfile, ProfileError> compile(
      const Profile& profile) noexcept;

  [[nodiscard]] constexpr const Profile& profile() const noexcept { return profile_; }
  [[nodiscard]] constexpr const ReplyRule& rule(DataId id) const noexcept { return rules_[index_of(id)]; }
  /// One character on the wire: start bit, eight data bits, stop bit.
  [[nodiscard]] constexpr Time character_time() const noexcept { return characters(1); }
  /// So many of them, 0 to 100.
  [[nodiscard]] constexpr Time characters(std::uint32_t count) const noexcept {
    return Time{character_ns_ * count};  // 32 bits hold more than 4000 of the slowest
  }
  /// First start bit to last stop bit of a request.
  [[nodiscard]] constexpr Time request_time(DataId id) const noexcept {
    return characters(layout(id).request_length);
  }
  /// First start bit to last stop bit of a reply.
  [[nodiscard]] constexpr Time reply_time(DataId id) const noexcept {
    return characters(layout(id).reply_length);
  }
  /// Shortest time from a request's start to the end of the first `bytes` of its reply.
  [[nodiscard]] constexpr Time exchange_min(DataId id, std::size_t bytes) const noexcept {
    return profile_.t2_min + characters(layout(id).request_length + static_cast<std::uint32_t>(bytes));
  }
  /// Shortest time from a request's start to the end of its reply.
  [[nodiscard]] constexpr Time exchange_min(DataId id) const noexcept {
    return exchange_min(id, layout(id).reply_length);
  }
  /// Longest time from a request's start to the end of its reply.
  [[nodiscard]] constexpr Time exchange_max(DataId id) const noexcept {
    const Layout& row = layout(id);
    return profile_.t2_max + characters(std::uint32_t{row.request_length} + row.reply_length);
  }
  /// Minimum time from this request's start to the next one's.
  [[nodiscard]] constexpr Time t1(DataId id) const noexcept { return profile_.t1[index_of(id)]; }
  /// The same for a request: where EEPROM writes and page changes hold the bus, for as long as they take.
  [[nodiscard]] constexpr Time t1(const Request& request) const noexcept {
    const Time shortest = t1(request.id());
    if (request.id() != DataId::eeprom_write || !profile_.eeprom_holds_bus) return shortest;
    const Time held =
        request.address() == kPageRegister ? profile_.eeprom_page_time : profile_.eeprom_write_time;
    return held > shortest ? held : shortest;
  }

 private:
  constexpr explicit CompiledProfile(const Profile& profile) noexcept;

  Profile profile_;
  std::uint32_t character_ns_;
  std::array<ReplyRule, kDataIdCount> rules_{};
};

/// The presets: tm485_17 (default), tm485_23, tformat_17, tformat_23, each also `_battery`; tm485_17_st, which has
/// no turns; and `any`, which holds only what every member of the family shares.
[[nodiscard]] std::span<const Profile> profile_presets() noexcept;

/// The preset of that name, or bad_argument.
[[nodiscard]] std::expected<Profile, Errc> find_profile(std::string_view name) noexcept;

}  // namespace tm485

#include "tm485/protocol/profile_compile.hpp"  // IWYU pragma: export
