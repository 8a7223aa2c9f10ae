// LinkHealth: how good the line to one encoder is: good, degraded or lost, and what fails on it.
//
//   good      fewer than `good_below` failed cycles in a window
//   degraded  `degraded_at` failed cycles within one window; good again only after a whole window below `good_below`
//   lost      `lost_after` failed cycles in a row; degraded again with the first good one
//
// Failures are counted by who is to blame, over windows of cycles, so that no cycle pays for more than a counter.
// Specification: none; design.md, Errors.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "tm485/errc.hpp"

namespace tm485 {

enum class LinkState : std::uint8_t { good, degraded, lost };

/// "good", "degraded", "lost"; static storage.
[[nodiscard]] std::string_view name(LinkState state) noexcept;

/// Who is to blame for a failed cycle.
enum class LinkCause : std::uint8_t {
  silence,      ///< no reply: power, wiring, a lost request
  damage,       ///< bytes that are no frame: noise, reflections, a wrong rate, a second talker
  implausible,  ///< frames that cannot be true: noise that passes the CRC, a wrong profile
  host,         ///< the port, or an owner that came too late
};
inline constexpr std::size_t kLinkCauses = 4;

/// "silence", "damage", ...; static storage.
[[nodiscard]] std::string_view name(LinkCause cause) noexcept;

/// Whom the failure of a cycle is charged to. Any thread or interrupt; constant time.
[[nodiscard]] LinkCause link_cause(Errc code) noexcept;

/// Thresholds, in cycles. The default calls 1 % bad and 0.2 % good.
struct LinkLimits {
  std::uint16_t window = 1000;     ///< 1 or more
  std::uint16_t degraded_at = 10;  ///< failed cycles in a window, 1 or more
  std::uint16_t good_below = 2;    ///< at most degraded_at: the hysteresis
  std::uint8_t lost_after = 3;     ///< failed cycles in a row, 1 or more

  [[nodiscard]] constexpr bool valid() const noexcept {
    return window != 0 && degraded_at != 0 && good_below != 0 && good_below <= degraded_at && lost_after != 0;
  }
};

/// One owner: the bus. Every function: constant time.
class LinkHealth {
 public:
  explicit LinkHealth(const LinkLimits& limits = {}) noexcept : limits_(limits) {}

  /// A cycle was good.
  void on_good() noexcept {
    in_a_row_ = 0;
    if (state_ == LinkState::lost) [[unlikely]]
      state_ = LinkState::degraded;
    if (++cycles_ >= limits_.window) [[unlikely]]
      close_window();
  }
  /// A cycle failed.
  void on_failed(Errc cause) noexcept;
  /// The encoder was given up, or has not been found yet.
  void on_lost() noexcept { state_ = LinkState::lost; }
  /// Start-up found it. `first`: nothing is held against it.
  void on_found(bool first) noexcept;

  [[nodiscard]] LinkState state() const noexcept { return state_; }
  /// Failed cycles by cause in the last whole window.
  [[nodiscard]] std::uint16_t failures(LinkCause cause) const noexcept {
    return last_[static_cast<std::size_t>(cause)];
  }
  /// Those as parts per million of the cycles: 0 .. 1 000 000. Divides; not for the cycle.
  [[nodiscard]] std::uint32_t rate_ppm(LinkCause cause) const noexcept;
  /// Of all causes together.
  [[nodiscard]] std::uint32_t rate_ppm() const noexcept;
  /// True once a whole window has passed: before, the rates say nothing.
  [[nodiscard]] bool measured() const noexcept { return measured_; }

 private:
  using Counts = std::array<std::uint16_t, kLinkCauses>;

  [[nodiscard]] static std::uint32_t total(const Counts& counts) noexcept;
  void close_window() noexcept;

  LinkLimits limits_;
  LinkState state_ = LinkState::lost;
  bool measured_ = false;
  std::uint8_t in_a_row_ = 0;
  std::uint16_t cycles_ = 0;  ///< of this window
  Counts now_{};
  Counts last_{};
};

}  // namespace tm485
