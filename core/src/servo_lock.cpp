#include "tm485/bus/servo_lock.hpp"

#include <algorithm>

namespace tm485 {
namespace {

constexpr int kPhaseShift = 3;          // an eighth of the error moves the start
constexpr std::int64_t kRateShift = 8;  // a 256th changes the length
constexpr std::uint8_t kTaught = 200;   // ticks behind which the rate is nearly known
constexpr std::int64_t kCalm = 8;       // then an eighth of that: what jitter taught runs through a hold
constexpr std::uint8_t kVotes = 8;      // ticks in a row that change the state
constexpr std::int64_t kMostGain =
    4096;  // of an error at most a 16th a pattern, however many ticks a pattern has
constexpr std::int64_t kRateLimit = 1000;  // parts of the length: 1000 ppm, far beyond two crystals
constexpr std::uint8_t kMute = 24;         // ticks until an eighth each has taken up what a hold has left

}  // namespace

ServoLock::ServoLock(const ServoClock& clock, Time length, Time latch_after) noexcept
    : length_(length),
      unit_(std::min(length, clock.period)),
      period_(clock.period),
      ahead_(latch_after + clock.lead) {
  constexpr std::int64_t kMost = INT32_MAX;
  const std::int64_t scaled = (std::int64_t{1} << kFraction) * length.count();
  rate_limit_ = static_cast<std::int32_t>(std::min(scaled / kRateLimit, kMost));
  // One tick's worth of rate, seen from one pattern: length / period of it.
  rate_gain_ = static_cast<std::int32_t>(
      std::clamp<std::int64_t>((scaled / period_.count()) >> kRateShift, 1, kMostGain));
}

Time ServoLock::begin(Time first) noexcept {
  if (state_ == State::waiting) {
    start_ = first;
  } else {
    // The phase is known: the next start that has it. What had put the grid off may be over sooner.
    go_to(first);
    const Time behind = first - start_;
    start_ += behind > Time{0} ? unit_ * whole_in(behind + unit_ - Time{1}, unit_)
                               : -unit_ * whole_in(-behind, unit_);
  }
  off_until_ = start_;
  return start_;
}

Time ServoLock::advance(std::int64_t patterns) noexcept {
  move(patterns);
  if (start_ - last_tick_ - excused_ > period_ * kLostAfter + length_) state_ = State::waiting;
  return start_;
}

void ServoLock::move(std::int64_t patterns) noexcept {
  start_ += length_ * patterns;
  shift(std::int64_t{rate_} * patterns);
}

/// The grid goes to within a pattern of `at`, there or back.
void ServoLock::go_to(Time at) noexcept {
  const Time ahead = at - start_;
  if (ahead > length_) move(whole_in(ahead, length_));
  if (ahead < -length_) move(-whole_in(-ahead, length_));
}

/// `by` in 2^-16 ns.
void ServoLock::shift(std::int64_t by) noexcept {
  const std::int64_t sum = by + fraction_;
  start_ += Time{sum >> kFraction};
  fraction_ = static_cast<std::int32_t>(sum & ((std::int64_t{1} << kFraction) - 1));
}

/// Tick less grid, within half a unit of zero.
Time ServoLock::error_of(Time tick) const noexcept {
  const std::int64_t unit = unit_.count();
  std::int64_t error = (tick - ahead_ - start_).count();
  if (error >= unit) error = left_of(Time{error}, unit_).count();
  if (error < -unit) error = -left_of(Time{-error}, unit_).count();
  if (error >= unit / 2) error -= unit;
  if (error < -unit / 2) error += unit;
  return Time{error};
}

std::optional<Time> ServoLock::on_tick(Time tick) noexcept {
  if (tick - last_tick_ > period_ * kLostAfter) state_ = State::waiting;
  last_tick_ = tick;
  excused_ = Time{0};
  const Time error = error_of(tick);
  if (state_ == State::waiting) {
    // The whole way at once, and forwards: whatever waits for this start must not come earlier than it was told.
    start_ += error < Time{0} ? error + unit_ : error;
    state_ = State::seeking;
    votes_ = 0;
    mute_ = 0;
    taught_ = 0;
    coasting_ = false;
    heard_at_ = tick;
    return std::nullopt;
  }
  const Time near = unit_ / 16;
  const bool is_near = error <= near && error >= -near;
  const bool agrees = state_ == State::locked ? is_near : !is_near;
  votes_ = agrees ? std::uint8_t{0} : static_cast<std::uint8_t>(votes_ + 1);
  if (votes_ >= kVotes) {
    if (state_ == State::locked) {  // the servo clock has jumped
      state_ = State::waiting;
      return error;
    }
    state_ = State::locked;
    votes_ = 0;
  }
  const Time heard = std::clamp(error, -near, near);
  shift((heard.count() << kFraction) >> kPhaseShift);
  if (coasting_ && tick - heard_at_ > std::max(length_, period_) * kMute) {
    take_up(tick, heard);
  } else if (mute_ != 0) {
    --mute_;
  } else {
    turn(heard.count() * rate_gain_ / (taught_ == kTaught ? kCalm : 1));
    if (taught_ != kTaught) ++taught_;
  }
  coasting_ = false;
  heard_at_ = tick;
  return error;
}

/// The first tick behind a long hold. What the grid is off by now has come together over all of it: the rate is off by so much
/// less a pattern. Half of that is heard, or a quarter, because a tick may be stamped late, and an eighth of it once the rate is
/// nearly known; and the ticks that follow, which tell the same again while it is taken up, say nothing of the rate.
void ServoLock::take_up(Time tick, Time error) noexcept {
  unsigned parts = taught_ == kTaught ? 5 : 2;  // a power of two: at least twice the patterns that it took
  for (Time span = length_ * 2; span <= tick - heard_at_ && parts < kFraction; span *= 2) ++parts;
  turn((error.count() << kFraction) >> parts);
  mute_ = kMute;
}

/// The rate by `by`, in 2^-16 ns a pattern.
void ServoLock::turn(std::int64_t by) noexcept {
  rate_ = static_cast<std::int32_t>(std::clamp<std::int64_t>(rate_ + by, -rate_limit_, rate_limit_));
}

std::int32_t ServoLock::drift_ppm() const noexcept {
  if (length_ == Time{0}) return 0;
  return static_cast<std::int32_t>((std::int64_t{rate_} * 1'000'000 / length_.count()) >> kFraction);
}

}  // namespace tm485
