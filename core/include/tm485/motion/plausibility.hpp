// PlausibilityGate: between a reply and a sample. Can the shaft be where this reply says?
//
// CRC X^8+1 lets every pair of wrong bits in one bit column pass. What is left to tell is motion: from the last readings,
// the greatest speed and the greatest acceleration follows where the shaft is at the next latch, give or take half a
// window. A reading outside is held back, never passed on; inside, the sample states how wrong it can be.
//
//   window      centre  last reading + speed * dt        (the speed: that of the last two readings)
//               half    errors of the readings + acceleration * dt * (dt + their distance) / 2
//   half-width  |reading - centre| + half, and as much as the last two readings can have been wrong by themselves
//
// A step of the shaft is real if readings go on to agree with each other: after a few of them the gate follows, and says
// whether it was a discontinuity. Specification: section 8; docs/safety.md.
#pragma once

#include <algorithm>
#include <cstdint>
#include <limits>

#include "tm485/motion/axis_config.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// What is known of the whole turns of a reading.
enum class Turns : std::uint8_t {
  known,    ///< the reply has them, or there are none
  to_come,  ///< the nearest to the last position; other replies of the cycle have them
  guessed,  ///< likewise, and no reply has
};

/// A position as read: turns and ABS as one number, unwrapped.
struct PositionReading {
  std::int64_t raw = 0;  ///< counts
  Time latch{0};
  Time uncertainty{0};  ///< ± of the latch time
  Turns turns = Turns::known;
};

enum class GateVerdict : std::uint8_t {
  accepted,    ///< where the shaft can be
  reacquired,  ///< not where it can have come to, but readings agree that it is there: a discontinuity
  held_back,   ///< no sample may come of it
};

/// One owner (the bus's context). Every function: constant time, no 64-bit division but in the constructor.
class PlausibilityGate {
 public:
  /// So many readings have to agree before the gate follows a step; of those inside the window, after an outage, fewer. Where
  /// the cycle reads turns, one of those that make a step must have them: ABS alone does not tell which way it went.
  static constexpr std::uint8_t kAgree = 4;
  static constexpr std::uint8_t kAgreeInside = 3;
  static constexpr std::uint8_t kFewMissed = 2;

  PlausibilityGate(unsigned single_turn_bits, const AxisConfig& axis) noexcept;

  /// Judges a reading and, unless it is held back, goes on from it. The first one is accepted: start-up has to see more
  /// than one.
  [[nodiscard]] GateVerdict judge(const PositionReading& reading) noexcept;

  /// Readings are wanted every `gap` from now on; 0: at no fixed time. Where a gap is so short that the next reading has a
  /// narrow window, one that comes in a wide window is not believed by itself: behind kFewMissed failed ones, or if the last
  /// two are much further apart than it is from them (start-up, which has waited for a lost frame).
  void expect_every(Time gap) noexcept;
  /// A reading was asked for, and none has come.
  void missed() noexcept {
    if (missed_ < kFewMissed) ++missed_;
  }

  /// The next reading is the first one.
  void forget() noexcept {
    track_.length = 0;
    candidate_.length = 0;
    missed_ = 0;
  }

  /// Where the shaft can be at `latch`, give or take `uncertainty`, even if the last readings were as wrong as they can be. There
  /// must have been a reading.
  struct Range {
    std::int64_t lowest = 0, highest = 0;  ///< counts, as PositionReading::raw
  };
  [[nodiscard]] Range range_at(Time latch, Time uncertainty) const noexcept;
  /// How far the shaft can turn in `dt`, in counts.
  [[nodiscard]] std::int64_t reach(Time dt) const noexcept;

  /// By how much the last reading that was not held back can be wrong, in counts, an undetected error of this or of one of
  /// the two readings before it included; at most 2^32 - 1.
  [[nodiscard]] std::uint32_t half_width() const noexcept { return track_.half_width; }
  /// The last reading that was not held back: with other whole turns than it was given if it had none of its own, and those
  /// of the row that it belongs to are others.
  [[nodiscard]] std::int64_t raw() const noexcept { return track_.raw; }

 private:
  /// Counts per ns, times 2^24.
  static constexpr unsigned kSpeedBits = 24;
  /// Beyond it no error is counted exactly, so that products stay in 63 bits.
  static constexpr std::int64_t kLargest = std::numeric_limits<std::uint32_t>::max();

  static constexpr std::int64_t kFastest = std::int64_t{1} << 38;
  static constexpr std::int64_t kNoLimit = std::numeric_limits<std::int64_t>::max();

  /// What a row of agreeing readings has left.
  struct Track {
    std::int64_t raw = 0;
    Time latch{0};
    std::int64_t speed = 0;        ///< of the last two readings
    std::int64_t speed_error = 0;  ///< of it, by the errors of the two; as `error`
    std::int64_t speed_doubt = 0;  ///< of it, if both are as wrong as they can be
    std::uint32_t error = 0;       ///< of the last reading, if its bits are right, in half counts
    std::uint32_t doubt = 0;       ///< of the last reading, if only its own bits are wrong
    std::uint32_t half = 0;        ///< half of the window that it was found in
    std::uint32_t span = 0;        ///< between the last two, ns
    std::uint32_t half_width = 0;  ///< of the last reading: see half_width()
    std::uint8_t length = 0;       ///< readings in the row; 1: the speed is not known
  };
  struct Window {
    std::int64_t centre = 0;
    std::int64_t half = 0;
    std::int64_t error = 0;  ///< of the reading, in half counts
    Time dt{0};
    bool by_speed = false;  ///< the acceleration says nothing: too long ago, or the first two
  };

  [[nodiscard]] static std::int64_t error_of(std::int64_t turned) noexcept;
  [[nodiscard]] static std::int64_t round_up(std::int64_t product) noexcept;
  [[nodiscard]] Window predict(const Track& track, const PositionReading& reading) const noexcept;
  [[nodiscard]] bool reachable(const Track& track, const PositionReading& reading,
                               const Window& window) const noexcept;
  [[nodiscard]] std::int64_t bend(std::int64_t dt, std::int64_t span) const noexcept;
  void begin(Track& track, const PositionReading& reading) const noexcept;
  [[nodiscard]] bool go_on(Track& track, const PositionReading& reading, std::int64_t widest) noexcept;
  void follow(Track& track, const PositionReading& reading, const Window& window) const noexcept;
  [[nodiscard]] bool near_track(const PositionReading& reading) const noexcept;
  [[nodiscard]] GateVerdict hold_back(const PositionReading& reading) noexcept;
  [[nodiscard]] bool differs_by_turns(const PositionReading& reading) const noexcept;
  [[nodiscard]] std::int64_t turns_off(const PositionReading& reading) const noexcept;
  [[nodiscard]] bool agrees(const PositionReading& reading, bool turnless) noexcept;

  std::int64_t speed_limit_;   ///< counts per 2^20 ns
  std::int64_t acceleration_;  ///< counts per (2^10 ns)^2, times 2^30
  std::int64_t memory_;        ///< for so long a speed says where the shaft is, ns
  std::int64_t turn_;          ///< counts of a turn
  std::int64_t fine_;          ///< half-width up to which a sample is good for a servo loop: 0.18 degrees
  bool narrow_ = false;        ///< the next reading has a window much narrower than fine_
  bool begins_ = false;        ///< the next reading is the first since expect_every()
  std::uint8_t missed_ = 0;
  bool inside_ = false;         ///< each reading of the candidate was where the shaft can be
  bool last_inside_ = false;    ///< the last one was
  bool turnless_ = false;       ///< no reading of the candidate knows its turns
  bool last_turnless_ = false;  ///< the last one does not
  bool last_told_ = false;      ///< the last one has them in its reply
  std::uint8_t told_ = 0;       ///< readings of the candidate that have, up to kAgree
  bool doubted_ = false;        ///< one since it began fitted to the track too, but for its turns
  std::uint8_t both_ = 0;       ///< of those that were held back, up to kAgreeInside
  Track track_;
  Track candidate_;
};

}  // namespace tm485
