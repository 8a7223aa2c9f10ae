#include "tm485/motion/plausibility.hpp"

namespace tm485 {
namespace {

constexpr std::int64_t kNsPerMinute = 60'000'000'000;
constexpr std::int64_t kLongestMemory =
    12'000'000;  // ns; keeps bend() in 63 bits, at 24 bits and the steepest
constexpr std::int64_t kShortestMemory = 100'000;

/// rpm/s << bits, divided by this, is in counts per (2^10 ns)^2 times 2^30: 60 s / (1.024 us)^2 / 2^30, rounded down.
constexpr std::int64_t kAccelerationUnit = 53'290;

}  // namespace

PlausibilityGate::PlausibilityGate(unsigned single_turn_bits, const AxisConfig& axis) noexcept {
  const std::int64_t rpm = std::clamp<std::int32_t>(axis.max_speed_rpm, 1, AxisConfig::kFastest);
  const std::int64_t rpm_s = std::clamp<std::int32_t>(axis.max_acceleration_rpm_s, 1, AxisConfig::kSteepest);
  // Rounded up: a limit may be a little wide, never too narrow.
  speed_limit_ = (rpm << single_turn_bits) / (kNsPerMinute >> 20) + 1;
  acceleration_ = (rpm_s << single_turn_bits) / kAccelerationUnit + 1;
  // From one greatest speed to the opposite one.
  memory_ = std::clamp(2 * rpm * 1'000'000'000 / rpm_s, kShortestMemory, kLongestMemory);
  constexpr unsigned kFineBits = 11;
  turn_ = std::int64_t{1} << single_turn_bits;
  fine_ = std::int64_t{1} << (single_turn_bits > kFineBits ? single_turn_bits - kFineBits : 0U);
}

void PlausibilityGate::expect_every(Time gap) noexcept {
  constexpr std::int64_t kReadings = 4;  // the errors of those that make a window
  const std::int64_t ns = gap.count();
  narrow_ = ns > 0 && ns <= memory_ && 2 * (bend(ns, ns) + kReadings) <= fine_;
  begins_ = true;
}

/// Of a reading, in half counts: it says which count the shaft is in, and is as much older or younger as makes `turned`.
std::int64_t PlausibilityGate::error_of(std::int64_t turned) noexcept { return 1 + 2 * turned; }

/// From counts per ns, times ns, to counts.
std::int64_t PlausibilityGate::round_up(std::int64_t product) noexcept {
  return (product + (std::int64_t{1} << kSpeedBits) - 1) >> kSpeedBits;
}

std::int64_t PlausibilityGate::reach(Time dt) const noexcept {
  constexpr Time kFine = std::chrono::seconds(10);  // keeps the product in 63 bits
  constexpr Time kLongest = std::chrono::hours(24);
  dt = std::clamp(dt, Time{0}, kLongest);
  return dt > kFine ? speed_limit_ * ((dt.count() >> 20) + 1) : (speed_limit_ * dt.count()) >> 20;
}

/// How far the greatest acceleration takes it from a straight line through two readings `span` apart, `dt` behind them.
std::int64_t PlausibilityGate::bend(std::int64_t dt, std::int64_t span) const noexcept {
  const std::int64_t ticks = (dt >> 10) + 1;
  const std::int64_t counts = (acceleration_ * ticks * (ticks + (span >> 10) + 1)) >> 31;
  return counts + (counts >> 8) + 1;  // the speed is rounded
}

PlausibilityGate::Window PlausibilityGate::predict(const Track& track,
                                                   const PositionReading& reading) const noexcept {
  Window window;
  window.dt = reading.latch - track.latch;
  const std::int64_t dt = window.dt.count();
  window.centre = track.raw;
  window.by_speed =
      track.length < 2 || dt > memory_ || dt < 0;  // a clock that goes back says nothing of speeds
  const bool at_any_speed = window.by_speed || reading.uncertainty.count() > dt >> 4;
  const std::int64_t speed = track.speed < 0 ? -track.speed : track.speed;
  window.error =
      error_of(at_any_speed ? reach(reading.uncertainty) + 1 : round_up(speed * reading.uncertainty.count()));
  const std::int64_t errors = window.error + track.error;
  if (window.by_speed) {
    window.half = errors / 2 + 1 + reach(std::max(window.dt, Time{0}));
  } else {
    window.centre += (track.speed * dt) >> kSpeedBits;
    window.half = (errors + round_up(track.speed_error * dt)) / 2 + 1 + bend(dt, track.span);
  }
  return window;
}

/// Not faster than the greatest speed, whatever the last two readings say, and not back in time.
bool PlausibilityGate::reachable(const Track& track, const PositionReading& reading,
                                 const Window& window) const noexcept {
  const std::int64_t moved = reading.raw - track.raw;
  const Time longest = window.dt + reading.uncertainty;
  const std::int64_t most = reach(longest) + (window.error + track.error) / 2 + 1;
  return longest >= Time{0} && moved <= most && -moved <= most;
}

/// Goes on from a reading that is inside the window.
void PlausibilityGate::follow(Track& track, const PositionReading& reading,
                              const Window& window) const noexcept {
  constexpr std::int64_t kShortest = 1'000;  // ns
  const std::int64_t off = reading.raw - window.centre;
  const std::int64_t doubt = std::min((off < 0 ? -off : off) + window.half, kLargest);
  const std::int64_t error = std::min(window.error, kLargest);
  const auto dt = static_cast<std::uint32_t>(std::clamp(window.dt.count(), kShortest, memory_));
  if (window.dt.count() > memory_) {
    track.length = 1;
    track.half_width = static_cast<std::uint32_t>(doubt);
  } else {
    // The speed becomes that of the last two readings: what it was, and what this one says more.
    const std::int64_t inverse = std::numeric_limits<std::uint32_t>::max() / dt;
    const std::int64_t before = window.by_speed ? 0 : track.speed;
    const std::int64_t spread = window.by_speed ? 0 : (track.speed_doubt * dt) >> kSpeedBits;
    constexpr unsigned kShift = 32 - kSpeedBits;
    track.half_width = static_cast<std::uint32_t>(std::min(doubt + track.doubt + spread, kLargest));
    track.speed = std::clamp(before + ((off * inverse) >> kShift), -kFastest, kFastest);
    track.speed_error = std::min(((error + track.error) * inverse) >> kShift, kFastest);
    track.speed_doubt = std::min(((doubt + track.doubt) * inverse) >> kShift, kFastest);
    if (track.length < kAgree) ++track.length;
  }
  track.raw = reading.raw;
  track.latch = reading.latch;
  track.error = static_cast<std::uint32_t>(error);
  track.doubt = static_cast<std::uint32_t>(doubt);
  track.half = static_cast<std::uint32_t>(std::min(window.half, kLargest));
  track.span = dt;
}

/// The first reading of a row.
void PlausibilityGate::begin(Track& track, const PositionReading& reading) const noexcept {
  track.raw = reading.raw;
  track.latch = reading.latch;
  track.speed = track.speed_error = track.speed_doubt = 0;
  track.error = static_cast<std::uint32_t>(std::min(error_of(reach(reading.uncertainty) + 1), kLargest));
  track.doubt = track.half = track.half_width = track.error / 2 + 1;
  track.span = 0;
  track.length = 1;
}

// Each of the following has its own frame on the stack, so that what the rare way needs does not lie below the common one.

/// Goes on from a reading inside the window, unless its own half-width is above `widest`.
[[gnu::noinline]] bool PlausibilityGate::go_on(Track& track, const PositionReading& reading,
                                               std::int64_t widest) noexcept {
  const Window window = predict(track, reading);
  const std::int64_t off = reading.raw - window.centre;
  const std::int64_t distance = off < 0 ? -off : off;
  if (distance > window.half || distance + window.half > widest || !reachable(track, reading, window))
    return false;
  follow(track, reading, window);
  return true;
}

[[gnu::noinline]] PlausibilityGate::Range PlausibilityGate::range_at(Time latch,
                                                                     Time uncertainty) const noexcept {
  const Window window = predict(track_, {track_.raw, latch, uncertainty});
  // The window itself is off by what undetected errors have made of the last two readings.
  const std::int64_t doubt = window.by_speed ? 0 : (track_.speed_doubt * window.dt.count()) >> kSpeedBits;
  const std::int64_t most = window.half + track_.doubt + doubt;
  return {window.centre - most, window.centre + most};
}

/// Is it where the shaft can be?
bool PlausibilityGate::near_track(const PositionReading& reading) const noexcept {
  const Range range = range_at(reading.latch, reading.uncertainty);
  return reading.raw >= range.lowest && reading.raw <= range.highest;
}

/// A reading without turns that the track goes on with says nothing against a candidate that is whole turns away.
[[gnu::noinline]] bool PlausibilityGate::differs_by_turns(const PositionReading& reading) const noexcept {
  if (candidate_.length == 0 || reading.turns != Turns::to_come || turnless_ || inside_) return false;
  const Window window = predict(candidate_, reading);
  const std::int64_t turns = (reading.raw - window.centre + turn_ / 2) & -turn_;
  if (turns == 0 && window.half < turn_ / 2) return false;
  const std::int64_t off = reading.raw - turns - window.centre;
  return off <= window.half && -off <= window.half;
}

GateVerdict PlausibilityGate::judge(const PositionReading& reading) noexcept {
  if (track_.length == 0) [[unlikely]] {
    begin(track_, reading);
    missed_ = 0;
    return GateVerdict::accepted;
  }
  if (begins_) [[unlikely]] {
    begins_ = false;
    if (track_.span > 2 * (reading.latch - track_.latch).count()) missed_ = kFewMissed;
  }
  const bool any = missed_ < kFewMissed || !narrow_;
  if (go_on(track_, reading, any ? kNoLimit : fine_)) [[likely]] {
    if (candidate_.length != 0) [[unlikely]] {
      // What fits to both counts here too: one reply that told other turns is not enough for them any more.
      if (!differs_by_turns(reading)) {
        candidate_.length = 0;
      } else {
        doubted_ = true;
      }
    }
    missed_ = 0;
    return GateVerdict::accepted;
  }
  return hold_back(reading);
}

/// By how many whole turns it is off from where the candidate would be.
[[gnu::noinline]] std::int64_t PlausibilityGate::turns_off(const PositionReading& reading) const noexcept {
  return (reading.raw - predict(candidate_, reading).centre + turn_ / 2) & -turn_;
}

/// Does it go on from the candidate? Whichever of the two does not know its turns takes those of the other.
[[gnu::noinline]] bool PlausibilityGate::agrees(const PositionReading& reading, bool turnless) noexcept {
  const bool guessed = turnless || turnless_;
  const std::int64_t turns = guessed ? turns_off(reading) : 0;
  candidate_.raw += turns;
  const bool agreed = go_on(candidate_, reading, kNoLimit);
  if (turnless) candidate_.raw -= turns;
  if (agreed) turnless_ = turnless_ && turnless;
  return agreed;
}

/// A reading that no sample may come of by itself. Several that agree with each other are believed.
[[gnu::noinline]] GateVerdict PlausibilityGate::hold_back(const PositionReading& reading) noexcept {
  missed();
  const bool inside = near_track(reading);
  // Without turns, and as well where the shaft can be as where a row with other turns goes on: which of them is right, the
  // replies with turns say, at least two of them; or else several such readings that the shaft is where it was thought to be.
  const bool both = inside && differs_by_turns(reading);
  const bool told = reading.turns == Turns::known;
  // Where the shaft can be, they are those that it had; not for a row that was elsewhere before.
  const auto lacks_turns = [&] {
    return !told && (!inside || both || (reading.turns == Turns::to_come && !inside_));
  };
  bool turnless = lacks_turns();
  bool agreed = candidate_.length != 0 && agrees(reading, turnless);
  if (!agreed && candidate_.length > 1) {  // the first one of the row may have been the wrong one
    candidate_.length = 1;
    inside_ = last_inside_;
    turnless_ = last_turnless_;
    told_ = last_told_ ? 1 : 0;
    both_ = 0;
    doubted_ = false;
    turnless = lacks_turns();
    agreed = agrees(reading, turnless);
  }
  constexpr std::uint8_t kTellTurns = 2;
  // It goes on from a row whose turns are in doubt, and is elsewhere itself: a row without them begins.
  if (doubted_ && told_ < kTellTurns && !told && !inside) agreed = false;
  if (!agreed) {
    begin(candidate_, reading);
    turnless = turnless_ = !told && !inside;
    told_ = both_ = 0;
    doubted_ = false;
  }
  if (told && told_ < kAgree) ++told_;
  if (both && agreed) {
    doubted_ = true;
    if (both_ < kAgreeInside) ++both_;
  }
  inside_ = inside && (inside_ || !agreed);
  last_inside_ = inside;
  last_turnless_ = turnless;
  last_told_ = told;
  if (doubted_ && told_ < kTellTurns) {
    if (both_ < kAgreeInside || !both) return GateVerdict::held_back;
    candidate_.raw = reading.raw;
    inside_ = true;
    turnless_ = false;
  }
  // Replies that tell their turns are so many wherever the track goes on between them, be it for longer than a speed is kept.
  if (candidate_.length < (inside_ ? kAgreeInside : kAgree) && told_ < kAgree) return GateVerdict::held_back;
  if (turnless_ && reading.turns == Turns::to_come) return GateVerdict::held_back;
  // One wrong reading would not have agreed with the others.
  candidate_.doubt = candidate_.half;
  candidate_.half_width =
      static_cast<std::uint32_t>(std::min<std::int64_t>(4 * std::int64_t{candidate_.half}, kLargest));
  track_ = candidate_;
  candidate_.length = 0;
  missed_ = 0;
  return inside_ ? GateVerdict::accepted : GateVerdict::reacquired;
}

}  // namespace tm485
