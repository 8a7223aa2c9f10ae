// FixedEstimator: the Estimator in integers, for cores without a floating-point unit.
//
// Same model, same states, same answers to gaps, but the gains after a gap come from a table, and no variance is
// stated until they are steady again. Adds, shifts and multiplications of 32 × 32 to 64 bits; no
// division, no float. Inside, positions, velocities (per period) and accelerations (per period²) are counts
// in 31.32 fixed point, spans are periods in 6.26, gains 2.30. docs/estimator.md states how far it is from
// the float estimator.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>

#include "tm485/errc.hpp"
#include "tm485/motion/estimator_gains.hpp"
#include "tm485/motion/sample.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// EstimatorGains for FixedEstimator, as plain data.
struct FixedGains {
  struct Correction {
    std::int32_t position = 0;  ///< 2^30 is 1; likewise the others
    std::int32_t velocity = 0;
    std::int32_t acceleration = 0;
  };
  static constexpr std::size_t kVariances = 33;

  static constexpr std::size_t kCorrections = 16;

  /// [0] is the steady state; [n] is best for the first sample after n missing ones, the last for all longer gaps.
  std::array<Correction, kCorrections> correction{};
  /// Position variance so many whole periods after a sample of the steady state; 2^12 is 1 count².
  std::array<std::uint32_t, kVariances> variance{};
  std::uint32_t periods_per_ns = 0;  ///< times a span in ns, shifted right by `shift`: periods, 2^26 is 1
  std::uint32_t shift = 0;
  std::uint32_t rate = 0;        ///< periods per second, 2^8 is 1
  std::uint32_t recovery = 0;    ///< what a sample leaves of the age that a gap brought; 2^16 is 1
  std::int32_t period = 0;       ///< ns
  std::int32_t longest_gap = 0;  ///< ns

  /// The only place that converts floats: on the host, at compile time, or once at start-up.
  /// Error: bad_argument if !valid(gains).
  [[nodiscard]] static constexpr std::expected<FixedGains, Errc> from(const EstimatorGains& gains) noexcept;
};

/// What the shaft does at `time`, in integers.
struct FixedEstimate {
  Time time{0};
  std::int64_t position = 0;      ///< counts, rounded down
  std::uint32_t fraction = 0;     ///< 2^32 is one count, to be added to `position`
  std::int64_t velocity = 0;      ///< counts/s, 2^8 is 1
  std::int64_t acceleration = 0;  ///< counts/s²
  std::uint32_t variance =
      0;  ///< of the position: 2^12 is 1 count²; all ones: unknown, as after a start or a gap
  EstimatorState state = EstimatorState::empty;

  [[nodiscard]] constexpr bool valid() const noexcept { return state >= EstimatorState::tracking; }
};

/// One owner, trivially copyable. Speeds to 2^22 counts per period, accelerations to 2^15 counts per period². Every function: constant time.
class FixedEstimator {
 public:
  /// `gains` must outlive the estimator and its copies.
  explicit constexpr FixedEstimator(const FixedGains& gains) noexcept : gains_(&gains) {}
  explicit FixedEstimator(const FixedGains&&) = delete;

  /// As Estimator::update; a step of 2^28 counts, a speed or an acceleration beyond the limits start anew.
  constexpr EstimatorState update(std::int64_t position, Time latch) noexcept;

  /// As Estimator::update.
  constexpr EstimatorState update(const Sample& sample) noexcept {
    if (sample.quality() != Quality::fresh || !sample.has_position()) return state_;
    return update(sample.position(), sample.latch_time());
  }

  /// As Estimator::miss.
  constexpr EstimatorState miss(Time latch) noexcept {
    if (state_ >= EstimatorState::tracking) {
      state_ =
          (latch - latch_).count() > gains_->longest_gap ? EstimatorState::lost : EstimatorState::bridging;
    }
    return state_;
  }

  /// As Estimator::at; spans beyond ± the longest gap count as that.
  [[nodiscard]] constexpr FixedEstimate at(Time time) const noexcept;

  /// Forgets everything.
  constexpr void reset() noexcept { state_ = EstimatorState::empty; }

  [[nodiscard]] constexpr EstimatorState state() const noexcept { return state_; }
  [[nodiscard]] constexpr Time latch_time() const noexcept { return latch_; }
  /// Measured less predicted position of the last update; 2^16 is one count, saturates.
  [[nodiscard]] constexpr std::int32_t innovation() const noexcept { return innovation_; }

 private:
  static constexpr std::int64_t kLargestStep = std::int64_t{1} << 28;
  static constexpr std::int64_t kLargestVelocity = std::int64_t{1} << (22 + 32);
  static constexpr std::int64_t kLargestAcceleration = std::int64_t{1} << (15 + 32);
  static constexpr std::uint32_t kOne = std::uint32_t{1} << 26;  ///< a period
  static constexpr std::uint32_t kJitter = (1U << 16) / 4;       ///< less than this is no missing sample

  /// A 31.32 number times a span of 6.26 periods.
  static constexpr std::int64_t times(std::int64_t value, std::uint32_t periods) noexcept {
    const std::int64_t high = (value >> 32) * std::int64_t{periods};
    const std::uint64_t low = std::uint64_t{static_cast<std::uint32_t>(value)} * periods;
    return (high << 6) + static_cast<std::int64_t>(low >> 26);
  }
  /// A 2.30 gain times an innovation of 15.16, as 31.32.
  static constexpr std::int64_t corrected(std::int32_t gain, std::int32_t innovation) noexcept {
    return (std::int64_t{gain} * innovation) >> 14;
  }
  constexpr std::uint32_t periods_in(std::uint32_t span) const noexcept {
    return static_cast<std::uint32_t>((std::uint64_t{span} * gains_->periods_per_ns) >> gains_->shift);
  }
  /// 1 / periods as 2.30 for 1/4 to 32 periods, by Newton's iteration instead of a division.
  static constexpr std::uint32_t reciprocal(std::uint32_t periods) noexcept;
  constexpr EstimatorState begin(std::int64_t position, Time latch, std::int64_t gap,
                                 std::int64_t step) noexcept;

  const FixedGains* gains_;
  std::int64_t anchor_ = 0;
  Time latch_{0};
  std::int64_t offset_ = 0;        ///< 31.32 counts
  std::int64_t velocity_ = 0;      ///< 31.32 counts per period
  std::int64_t acceleration_ = 0;  ///< 31.32 counts per period²
  std::uint32_t age_ = 0;          ///< 16.16 periods
  std::int32_t innovation_ = 0;    ///< 15.16 counts
  EstimatorState state_ = EstimatorState::empty;
};

constexpr std::expected<FixedGains, Errc> FixedGains::from(const EstimatorGains& gains) noexcept {
  if (!tm485::valid(gains)) return std::unexpected(Errc::bad_argument);
  constexpr double kGain = 1073741824.0;
  // None of the values is negative, and core has no lround().
  const auto rounded = [](double value) {
    return static_cast<std::int64_t>(value + 0.5);  // NOLINT(bugprone-incorrect-roundings)
  };
  const StateCovariance<float>& steady = gains.covariance;
  const StateCovariance<double> covariance{steady.pp, steady.pv, steady.pa, steady.vv, steady.va, steady.aa};
  const auto after = [&](std::size_t periods) {
    StateCovariance<double> later = covariance;
    later.predict(static_cast<double>(periods), double{gains.process_noise}, gains.order);
    return later;
  };
  FixedGains fixed;
  for (std::size_t i = 0; i < fixed.correction.size(); ++i) {
    auto gain = after(i + 1).gain(double{gains.measurement_variance});
    if (i == 0)
      gain = {double{gains.gain.position}, double{gains.gain.velocity}, double{gains.gain.acceleration}};
    const auto number = [&](double value) {
      return static_cast<std::int32_t>(rounded(std::clamp(value, 0.0, 1.999) * kGain));
    };
    fixed.correction[i] = {number(gain.position), number(gain.velocity), number(gain.acceleration)};
  }
  for (std::size_t n = 0; n < fixed.variance.size(); ++n) {
    const double value = after(n).pp * 4096.0;
    fixed.variance[n] = value < 4294967294.0 ? static_cast<std::uint32_t>(value + 1.0) : UINT32_MAX;
  }
  // A narrow filter forgets slowly.
  const double recovery = std::clamp(1.0 - double{gains.gain.position} / 2.0, 0.85, 0.999);
  const auto period = static_cast<double>(gains.period.count());
  double per_ns = 67108864.0 / period;
  while (per_ns < 2147483648.0) {
    per_ns *= 2.0;
    ++fixed.shift;
  }
  fixed.periods_per_ns = static_cast<std::uint32_t>(std::min<std::int64_t>(rounded(per_ns), UINT32_MAX));
  fixed.rate = static_cast<std::uint32_t>(rounded(256e9 / period));
  fixed.recovery = static_cast<std::uint32_t>(rounded(recovery * 65536.0));
  fixed.period = static_cast<std::int32_t>(gains.period.count());
  fixed.longest_gap = fixed.period * gains.longest_gap;
  return fixed;
}

constexpr EstimatorState FixedEstimator::update(std::int64_t position, Time latch) noexcept {
  const std::int64_t gap = (latch - latch_).count();
  const auto step =
      static_cast<std::int64_t>(static_cast<std::uint64_t>(position) - static_cast<std::uint64_t>(anchor_));
  if (state_ < EstimatorState::tracking || gap <= 0 || gap > gains_->longest_gap || step >= kLargestStep ||
      step <= -kLargestStep) [[unlikely]] {
    return begin(position, latch, gap, step);
  }
  const std::uint32_t periods = periods_in(static_cast<std::uint32_t>(gap));
  std::uint32_t late = (periods >> 10) + age_;
  late = late < (1U << 16) + kJitter ? 0 : late - (1U << 16);
  const std::uint32_t missing =
      std::min((late + (1U << 15)) >> 16, std::uint32_t{FixedGains::kCorrections - 1});
  const FixedGains::Correction& gain = gains_->correction[missing];

  const std::int64_t change = times(acceleration_, periods);
  const std::int64_t predicted = offset_ + times(velocity_ + (change >> 1), periods);
  const std::int64_t exact = (step << 32) - predicted;
  innovation_ =
      static_cast<std::int32_t>(std::clamp(exact >> 16, std::int64_t{-INT32_MAX}, std::int64_t{INT32_MAX}));
  offset_ = corrected(gain.position, innovation_) - exact;
  velocity_ += change + corrected(gain.velocity, innovation_);
  acceleration_ += corrected(gain.acceleration, innovation_);
  age_ = static_cast<std::uint32_t>((std::uint64_t{late} * gains_->recovery) >> 16);
  anchor_ = position;
  latch_ = latch;
  state_ = EstimatorState::tracking;
  if (velocity_ >= kLargestVelocity || velocity_ <= -kLargestVelocity ||
      acceleration_ >= kLargestAcceleration || acceleration_ <= -kLargestAcceleration) [[unlikely]] {
    state_ = EstimatorState::empty;
    return begin(position, latch, 0, 0);
  }
  return state_;
}

constexpr std::uint32_t FixedEstimator::reciprocal(std::uint32_t periods) noexcept {
  std::uint32_t down = 0;  // periods = part * 2^down, part in [1/4, 1) of a period
  while (periods >= kOne) {
    periods >>= 1;
    ++down;
  }
  const std::uint64_t part = std::uint64_t{periods} << 4;  // 2.30
  // Started at 1 the error is at most 3/4; squared eight times it is far below the resolution.
  std::uint64_t inverse = std::uint64_t{1} << 30;
  for (int i = 0; i < 8; ++i) {
    inverse = (inverse * ((std::uint64_t{2} << 30) - ((part * inverse) >> 30))) >> 30;
  }
  return static_cast<std::uint32_t>(std::min<std::uint64_t>(inverse >> down, UINT32_MAX));
}

/// The first two samples, and what cannot be bridged.
constexpr EstimatorState FixedEstimator::begin(std::int64_t position, Time latch, std::int64_t gap,
                                               std::int64_t step) noexcept {
  if (state_ != EstimatorState::empty && gap <= 0) return state_;
  const bool second = state_ == EstimatorState::starting && gap <= gains_->longest_gap &&
                      step < kLargestStep && step > -kLargestStep;
  if (second && 4 * gap < gains_->period) return state_;  // too close together to tell a velocity
  velocity_ = 0;
  bool known = false;
  if (second) {
    const std::uint32_t inverse = reciprocal(periods_in(static_cast<std::uint32_t>(gap)));
    velocity_ = (step * std::int64_t{inverse}) * 4;  // |step| < 2^28, 1/periods <= 4: below 2^63
    known = velocity_ < kLargestVelocity && velocity_ > -kLargestVelocity;
    if (!known) velocity_ = 0;
  }
  offset_ = 0;
  acceleration_ = 0;
  innovation_ = 0;
  age_ = FixedGains::kCorrections << 16;
  anchor_ = position;
  latch_ = latch;
  state_ = known ? EstimatorState::tracking : EstimatorState::starting;
  return state_;
}

constexpr FixedEstimate FixedEstimator::at(Time time) const noexcept {
  const std::int64_t longest = gains_->longest_gap;
  const std::int64_t span = std::clamp((time - latch_).count(), -longest, longest);
  const bool after = span >= 0;
  const std::uint32_t periods = periods_in(static_cast<std::uint32_t>(after ? span : -span));
  const std::int64_t change = times(acceleration_, periods);
  const std::int64_t mean = after ? velocity_ + (change >> 1) : (change >> 1) - velocity_;
  const std::int64_t distance = offset_ + times(mean, periods);
  const std::int64_t velocity = after ? velocity_ + change : velocity_ - change;

  // Per period to per second: the rate has 8 fractional bits.
  const std::uint32_t rate = gains_->rate;
  const auto per_second = [rate](std::int64_t value) {
    return (value >> 32) * std::int64_t{rate} +
           static_cast<std::int64_t>((std::uint64_t{static_cast<std::uint32_t>(value)} * rate) >> 32);
  };
  const std::uint32_t whole = (periods + kOne - 1) >> 26;  // rounded up

  FixedEstimate estimate;
  estimate.time = time;
  estimate.position = static_cast<std::int64_t>(static_cast<std::uint64_t>(anchor_) +
                                                static_cast<std::uint64_t>(distance >> 32));
  estimate.fraction = static_cast<std::uint32_t>(distance);
  estimate.velocity = per_second(velocity);
  // Twice, with 24 fractional bits in between; the limit of the acceleration keeps all of it within 64 bits.
  const std::int64_t per_period =
      (acceleration_ >> 32) * std::int64_t{rate} * 65536 +
      static_cast<std::int64_t>((std::uint64_t{static_cast<std::uint32_t>(acceleration_)} * rate) >> 16);
  const auto below = static_cast<std::uint64_t>(per_period) & 0xFFFFFFU;
  estimate.acceleration =
      ((per_period >> 24) * std::int64_t{rate} + static_cast<std::int64_t>((below * rate) >> 24)) >> 8;
  estimate.variance = age_ == 0 && whole < FixedGains::kVariances ? gains_->variance[whole] : UINT32_MAX;
  estimate.state = state_;
  return estimate;
}

}  // namespace tm485
