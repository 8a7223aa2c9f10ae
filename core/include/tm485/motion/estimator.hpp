// Estimator: position, velocity and acceleration at any instant, from positions with their latch times.
//
// A Kalman filter with two or three states. In its steady state the gains are constants (EstimatorGains) and an
// update is a fixed number of float operations without a division. After a start and after a missing sample the
// gains and the variance are followed until they are steady again: bounded too, about three times the operations.
// Each sample is predicted over the time that really passed, so jitter bends nothing. The state is held relative to
// the last sample's count, a 64-bit anchor: floats never carry more than the distance of two samples, and nothing
// is lost at large positions.
// For cores without a floating-point unit: estimator_fixed.hpp. Model, units, figures: docs/estimator.md.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>

#include "tm485/motion/estimator_gains.hpp"
#include "tm485/motion/sample.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// Square root without the C library, exact to 2 units in the last place; 0 for negative values. About ten
/// operations and three divisions: for display and diagnosis rather than for every cycle.
[[nodiscard]] constexpr float square_root(float value) noexcept {
  if (!(value > 1e-30F)) return 0.0F;
  float root = std::bit_cast<float>((std::bit_cast<std::uint32_t>(value) >> 1) + 0x1FBD1DF5U);
  for (int i = 0; i < 3; ++i) root = 0.5F * (root + value / root);
  return root;
}

/// What the shaft does at `time`.
struct Estimate {
  Time time{0};
  std::int64_t position = 0;                     ///< counts, rounded down
  float fraction = 0;                            ///< of a count, 0 to 1, to be added to `position`
  float velocity = 0;                            ///< counts/s
  float acceleration = 0;                        ///< counts/s²; 0 with two states
  float position_variance = 0;                   ///< counts²; infinite if it is beyond float
  float velocity_variance = 0;                   ///< (counts/s)²
  EstimatorState state = EstimatorState::empty;  ///< the estimate means something from `tracking` upwards

  [[nodiscard]] constexpr bool valid() const noexcept { return state >= EstimatorState::tracking; }
  /// Standard deviations; in a loop compare variances instead.
  [[nodiscard]] constexpr float position_deviation() const noexcept { return square_root(position_variance); }
  [[nodiscard]] constexpr float velocity_deviation() const noexcept { return square_root(velocity_variance); }
  /// This estimate less a count, exact near it: what a position loop subtracts. Saturates at ±2^30 counts.
  [[nodiscard]] constexpr float position_from(std::int64_t reference) const noexcept {
    constexpr std::int64_t kLimit = std::int64_t{1} << 30;
    const auto distance = static_cast<std::int64_t>(static_cast<std::uint64_t>(position) -
                                                    static_cast<std::uint64_t>(reference));
    return static_cast<float>(static_cast<std::int32_t>(std::clamp(distance, -kLimit, kLimit))) + fraction;
  }
};

/// One owner; trivially copyable, so a copy can cross to another context in one piece (LatestValue) and be asked
/// there. Every function: constant time, no division of 64 bits, no libm.
class Estimator {
 public:
  /// `gains` must be valid(gains) and outlive the estimator and its copies.
  explicit constexpr Estimator(const EstimatorGains& gains) noexcept
      : gains_(&gains),
        per_nanosecond_(1.0F / static_cast<float>(gains.period.count())),
        rate_(1e9F / static_cast<float>(gains.period.count())),
        least_(gains.period.count() - gains.period.count() / 4),
        spread_(static_cast<std::uint64_t>(gains.period.count() / 2)),
        longest_gap_(gains.period.count() * gains.longest_gap) {}
  explicit Estimator(const EstimatorGains&&) = delete;

  /// A position, in counts, that was latched at `latch`. A latch time that is not later than the last one's is
  /// ignored. A gap longer than `longest_gap`, or a step of 2^30 counts or more, starts anew.
  /// Answers the state afterwards.
  constexpr EstimatorState update(std::int64_t position, Time latch) noexcept;

  /// A fresh sample with a position is an update; any other is ignored (tell `miss`).
  constexpr EstimatorState update(const Sample& sample) noexcept {
    if (sample.quality() != Quality::fresh || !sample.has_position()) return state_;
    return update(sample.position(), sample.latch_time());
  }

  /// No sample of `latch` will come: it is missing, or was rejected. The estimate goes on from the last sample, with
  /// the variance of that span. Only tells the state; `at` and `update` go by the time that passed in any case.
  constexpr EstimatorState miss(Time latch) noexcept {
    if (state_ >= EstimatorState::tracking) {
      const bool lost = (latch - latch_).count() > longest_gap_;
      state_ = lost ? EstimatorState::lost : EstimatorState::bridging;
      if (lost) steady_ = false;
    }
    return state_;
  }

  /// The estimate at `time`. Meant for a few periods around the last sample: before it too, but then the variance is
  /// that of the same span after it. Spans beyond ±1 s count as 1 s.
  [[nodiscard]] constexpr Estimate at(Time time) const noexcept;

  /// Forgets everything: position lost, encoder restarted.
  constexpr void reset() noexcept {
    state_ = EstimatorState::empty;
    steady_ = false;
  }

  [[nodiscard]] constexpr EstimatorState state() const noexcept { return state_; }
  /// The latch time of the last sample that was taken.
  [[nodiscard]] constexpr Time latch_time() const noexcept { return latch_; }
  /// Measured less predicted position of the last update, in counts: what diagnosis looks at.
  [[nodiscard]] constexpr float innovation() const noexcept { return innovation_; }
  [[nodiscard]] constexpr const EstimatorGains& gains() const noexcept { return *gains_; }

 private:
  static constexpr std::int64_t kLargestStep = std::int64_t{1} << 30;

  static constexpr bool too_far(std::int64_t step) noexcept {
    return step >= kLargestStep || step <= -kLargestStep;
  }
  constexpr float periods_in(std::int64_t span) const noexcept {
    return static_cast<float>(static_cast<std::int32_t>(span)) * per_nanosecond_;
  }
  constexpr void take(float periods, std::int32_t step, const EstimatorGains::Gain& gain) noexcept;
  constexpr EstimatorState follow(std::int64_t position, Time latch, std::int64_t gap,
                                  std::int64_t step) noexcept;
  constexpr EstimatorState begin(std::int64_t position, Time latch, std::int64_t gap,
                                 std::int64_t step) noexcept;
  constexpr bool is_steady() const noexcept;

  const EstimatorGains* gains_;
  std::int64_t anchor_ = 0;  ///< the last sample's count
  Time latch_{0};            ///< the last sample's latch time
  float offset_ = 0;         ///< estimated position less the anchor, counts
  float velocity_ = 0;       ///< counts per period
  /// To be added to it: the last update's change, and what rounding took (at 23 bits and speed 24 bits are few).
  float velocity_rest_ = 0;
  float acceleration_ = 0;  ///< counts per period²
  float innovation_ = 0;
  float per_nanosecond_;  ///< periods per nanosecond
  float rate_;            ///< periods per second
  StateCovariance<float> covariance_;
  std::int64_t least_;    ///< a gap from here ...
  std::uint64_t spread_;  ///< ... to so much more, in ns, is one period with jitter
  std::int64_t longest_gap_;
  bool steady_ = false;  ///< covariance_ is the steady state's; only while tracking or bridging
  EstimatorState state_ = EstimatorState::empty;
};

constexpr EstimatorState Estimator::update(std::int64_t position, Time latch) noexcept {
  const std::int64_t gap = (latch - latch_).count();
  const auto step =
      static_cast<std::int64_t>(static_cast<std::uint64_t>(position) - static_cast<std::uint64_t>(anchor_));
  if (!steady_ || static_cast<std::uint64_t>(gap - least_) > spread_ || too_far(step)) [[unlikely]] {
    return follow(position, latch, gap, step);
  }
  take(periods_in(gap), static_cast<std::int32_t>(step), gains_->gain);
  anchor_ = position;
  latch_ = latch;
  state_ = EstimatorState::tracking;
  return EstimatorState::tracking;
}

/// The states over `periods` and a sample `step` counts from the anchor.
constexpr void Estimator::take(float periods, std::int32_t step, const EstimatorGains::Gain& gain) noexcept {
  // One update waits for the last one's states, so the products come first and the sums in a tree.
  const float half_square = 0.5F * periods * periods;
  const float change = periods * velocity_rest_ + half_square * acceleration_;
  // The two large numbers by themselves: their difference is small.
  const float beyond = static_cast<float>(step) - periods * velocity_;
  const float innovation = (beyond - offset_) - change;
  offset_ = (gain.position - 1.0F) * innovation;  // relative to this sample, the new anchor
  const float before = velocity_;
  velocity_ += velocity_rest_;
  velocity_rest_ =
      (velocity_rest_ - (velocity_ - before) + periods * acceleration_) + gain.velocity * innovation;
  acceleration_ += gain.acceleration * innovation;
  innovation_ = innovation;
}

/// Not the steady state: the gain is worked out from the covariance, which is followed until it is steady.
constexpr EstimatorState Estimator::follow(std::int64_t position, Time latch, std::int64_t gap,
                                           std::int64_t step) noexcept {
  if (state_ < EstimatorState::tracking || gap <= 0 || gap > longest_gap_ || too_far(step)) {
    return begin(position, latch, gap, step);
  }
  const float periods = periods_in(gap);
  covariance_.predict(periods, gains_->process_noise, gains_->order);
  const EstimatorGains::Gain gain = covariance_.gain(gains_->measurement_variance);
  covariance_.correct(gain, gains_->measurement_variance);
  take(periods, static_cast<std::int32_t>(step), gain);
  steady_ = is_steady();
  if (steady_) covariance_ = gains_->covariance;
  anchor_ = position;
  latch_ = latch;
  state_ = EstimatorState::tracking;
  return state_;
}

constexpr bool Estimator::is_steady() const noexcept {
  const auto near = [](float value, float limit) { return value <= 1.02F * limit && value >= 0.98F * limit; };
  const StateCovariance<float>& limit = gains_->covariance;
  return near(covariance_.pp, limit.pp) && near(covariance_.vv, limit.vv) && near(covariance_.aa, limit.aa);
}

/// The first two samples, and what cannot be bridged.
constexpr EstimatorState Estimator::begin(std::int64_t position, Time latch, std::int64_t gap,
                                          std::int64_t step) noexcept {
  if (state_ != EstimatorState::empty && gap <= 0) return state_;
  const bool second = state_ == EstimatorState::starting && gap <= longest_gap_ && !too_far(step);
  if (second && 4 * gap < gains_->period.count()) return state_;  // too close together to tell a velocity
  velocity_ = 0.0F;
  if (second) {
    const float periods = periods_in(gap);
    velocity_ = static_cast<float>(static_cast<std::int32_t>(step)) / periods;
    covariance_ =
        StateCovariance<float>::of_two_samples(periods, gains_->process_noise, gains_->order,
                                               gains_->measurement_variance, gains_->acceleration_variance);
  }
  velocity_rest_ = 0.0F;
  offset_ = 0.0F;
  acceleration_ = 0.0F;
  innovation_ = 0.0F;
  anchor_ = position;
  latch_ = latch;
  steady_ = false;
  state_ = second ? EstimatorState::tracking : EstimatorState::starting;
  return state_;
}

constexpr Estimate Estimator::at(Time time) const noexcept {
  constexpr std::int64_t kLongest = 1'000'000'000;
  constexpr float kFarthest = 1073741824.0F;  // 2^30, so that the conversion to 32 bits is defined
  const float periods = periods_in(std::clamp((time - latch_).count(), -kLongest, kLongest));
  const float half_change = 0.5F * periods * acceleration_;
  const float distance = std::clamp(
      (offset_ + periods * (velocity_rest_ + half_change)) + periods * velocity_, -kFarthest, kFarthest);
  auto whole = static_cast<std::int32_t>(distance);
  if (static_cast<float>(whole) > distance) --whole;
  StateCovariance<float> covariance = covariance_;
  covariance.predict(periods < 0.0F ? -periods : periods, gains_->process_noise, gains_->order);

  Estimate estimate;
  estimate.time = time;
  estimate.position = static_cast<std::int64_t>(static_cast<std::uint64_t>(anchor_) +
                                                static_cast<std::uint64_t>(std::int64_t{whole}));
  estimate.fraction = distance - static_cast<float>(whole);
  estimate.velocity = (velocity_ + (velocity_rest_ + 2.0F * half_change)) * rate_;
  estimate.acceleration = acceleration_ * rate_ * rate_;
  estimate.position_variance = covariance.pp;
  estimate.velocity_variance = covariance.vv * rate_ * rate_;
  estimate.state = state_;
  return estimate;
}

}  // namespace tm485
