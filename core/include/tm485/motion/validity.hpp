// SampleValidity: whether a loop may act on what it reads. Specification: none; design.md, Sample.
//
//   fresh -> extrapolated, up to max_hold -> invalid
//
// Invalid is latched: what was lost once is not found again by itself, however good the next reply is. It is left by
// a command only (resume), because a drive that has let go of its motor must not take hold of it unasked.
#pragma once

#include <cstdint>

#include "tm485/time.hpp"

namespace tm485 {

enum class SampleValidity : std::uint8_t {
  invalid,       ///< do not use: no sample yet, or it was lost and nobody has resumed
  extrapolated,  ///< the newest reply is missing; use the estimate, not for long
  fresh,         ///< the newest reply is here
};

/// Called in the bus's context, once each time that validity is lost: bring the torque to zero. Must return soon.
struct InvalidCallback {
  void (*call)(void* context, Time now) = nullptr;  ///< null: nobody wants to know
  void* context = nullptr;
};

/// The latch. One owner (the bus's context). Every function: constant time.
class ValidityLatch {
 public:
  explicit ValidityLatch(const InvalidCallback& on_invalid = {}) noexcept : on_invalid_(on_invalid) {}

  /// A usable sample is there. The first one, and the first after resume(), makes the loop's data valid.
  void on_good() noexcept {
    if (!latched_) valid_ = true;
  }
  /// There is none any more.
  void on_lost(Time now) noexcept {
    if (!valid_) return;
    valid_ = false;
    latched_ = true;
    if (on_invalid_.call != nullptr) on_invalid_.call(on_invalid_.context, now);
  }
  /// The command. True if something was latched.
  bool resume() noexcept {
    const bool was = latched_;
    latched_ = false;
    return was;
  }

  /// True while the loop may use what it reads.
  [[nodiscard]] bool valid() const noexcept { return valid_; }
  [[nodiscard]] bool latched() const noexcept { return latched_; }

 private:
  InvalidCallback on_invalid_;
  bool valid_ = false;
  bool latched_ = false;
};

}  // namespace tm485
