// Startup: from an unknown line to an encoder whose samples may be believed.
//
//   quiet       the line is silent for the time of the longest reply
//   answer      ID2 until a frame comes back, at most power_up_time
//   identify    ID2: ENID is among those of the profile
//   cross_check ID3: the same ENID, ABS within the profile's resolution
//   consistent  N frames that one shaft can have produced
//
// Each stage ends with its own error, and then the sequence begins again. Until it is through,
// nothing is fresh. Specification: sections 4 and 7.
#pragma once

#include <cstdint>
#include <optional>

#include "tm485/bus/port.hpp"
#include "tm485/errc.hpp"
#include "tm485/motion/position_tracker.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// Where a bus stands.
enum class BusState : std::uint8_t { stopped, startup, running };

enum class StartupStage : std::uint8_t { quiet, answer, identify, cross_check, consistent, done };

/// "quiet", "answer", ...; static storage.
[[nodiscard]] std::string_view name(StartupStage stage) noexcept;

/// Where and why a start-up sequence failed.
struct StartupError {
  StartupStage stage = StartupStage::quiet;
  Errc cause = Errc::ok;
};

/// The sequence without its I/O. One owner: the bus. Every function: constant time.
class Startup {
 public:
  /// `frames`: how many mutually consistent frames are wanted (2..255).
  /// They seed `tracker`, which the owner has made forget before begin().
  Startup(const CompiledProfile& profile, PositionTracker& tracker, std::uint8_t frames) noexcept;

  /// Begins at `now`, from the first stage. `latency`: the port's latency allowance.
  void begin(Time now, Time latency) noexcept;

  [[nodiscard]] StartupStage stage() const noexcept { return stage_; }
  /// When next_id() is to be sent, or on_quiet_time() to be called in stage quiet.
  [[nodiscard]] Time due() const noexcept { return due_; }
  /// What to ask next.
  [[nodiscard]] DataId next_id() const noexcept {
    return stage_ <= StartupStage::identify ? DataId::encoder_id : DataId::everything;
  }

  /// Bytes or a fault arrived in stage quiet: `cause` says which.
  void on_noise(Errc cause, Time now) noexcept;
  /// due() of stage quiet has come.
  void on_quiet_time(Time now) noexcept;
  /// An exchange brought a frame that was latched at `latch`, give or take `uncertainty`.
  void on_frame(const Frame& frame, Time latch, Time uncertainty, Time now) noexcept;
  /// An exchange failed.
  void on_error(Errc cause, Time now) noexcept;

  /// The error of the sequence, once, when it has failed. The sequence stands still until begin().
  [[nodiscard]] std::optional<StartupError> take_failure() noexcept;

 private:
  void fail(Errc cause) noexcept;
  void check_consistency(const Reply& reply, Time latch, Time uncertainty) noexcept;
  void enter(StartupStage stage) noexcept;

  static constexpr std::uint8_t kRetries = 3;  ///< failed exchanges that a stage after `answer` forgives

  const CompiledProfile* profile_;
  PositionTracker* tracker_;
  std::uint8_t frames_wanted_;
  std::uint8_t frames_seen_ = 0;
  std::uint8_t retries_ = 0;
  std::uint8_t enid_ = 0;
  StartupStage stage_ = StartupStage::quiet;
  bool failed_ = false;
  StartupError error_;
  Errc last_error_ = Errc::ok;  ///< the most telling one of stage answer
  Time due_{0};
  Time give_up_{0};
  Time quiet_span_{0};
};

}  // namespace tm485
