// The referee of T1, request start to request start. Specification: section 4.
#pragma once

#include <cstdint>

#include "tm485/time.hpp"

namespace tm485::sim {

/// Sees the start bit of every request and checks the span since the one before against the minimum T1 of
/// the one before. One owner; constant time.
class T1Judge {
 public:
  /// A request whose start bit fell at `start`; the next one must not start before `start + required`.
  void on_request(Time start, Time required) noexcept {
    if (armed_) {
      last_margin_ = start - earliest_;
      if (last_margin_ < smallest_margin_) smallest_margin_ = last_margin_;
      if (last_margin_ < Time{0}) [[unlikely]] {
        if (violations_ == 0) first_violation_ = start;
        ++violations_;
      }
    }
    armed_ = true;
    earliest_ = start + required;
  }

  /// Forgets the last request, so that the next one is not judged: after a power cycle, or after a
  /// request that is no evidence of what the host did.
  void disarm() noexcept { armed_ = false; }

  [[nodiscard]] std::uint64_t violations() const noexcept { return violations_; }

  /// Start of the first request that came too early, or kNever.
  [[nodiscard]] Time first_violation() const noexcept { return first_violation_; }

  /// T1 seen - T1 required of the last request that was judged; kNever before.
  [[nodiscard]] Time last_margin() const noexcept { return last_margin_; }

  /// Smallest (T1 seen - T1 required), negative after a violation; kNever before the second request.
  [[nodiscard]] Time smallest_margin() const noexcept { return smallest_margin_; }

 private:
  Time earliest_{0};
  Time smallest_margin_ = kNever;
  Time last_margin_ = kNever;
  Time first_violation_ = kNever;
  std::uint64_t violations_ = 0;
  bool armed_ = false;
};

}  // namespace tm485::sim
