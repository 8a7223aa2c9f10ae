// The estimators, in float and in integers.
#include "tm485/c/estimator.h"

#include <cstddef>
#include <cstdint>
#include <new>
#include <type_traits>

#include "convert.hpp"
#include "handles.hpp"
#include "tm485/motion/estimator.hpp"
#include "tm485/motion/estimator_fixed.hpp"

namespace tm485::c {
namespace {

static_assert(kFits<tm485_estimator, Estimator>);
static_assert(kFits<tm485_fixed_estimator, FixedEstimator>);
static_assert(value(EstimatorState::empty) == TM485_ESTIMATOR_EMPTY &&
              value(EstimatorState::starting) == TM485_ESTIMATOR_STARTING &&
              value(EstimatorState::lost) == TM485_ESTIMATOR_LOST &&
              value(EstimatorState::tracking) == TM485_ESTIMATOR_TRACKING &&
              value(EstimatorState::bridging) == TM485_ESTIMATOR_BRIDGING);

// Gains are used where the program has them, so the two types must be the same bytes.
using CGains = tm485_estimator_gains;
using Covariance = StateCovariance<float>;
constexpr std::size_t kGainAt = offsetof(EstimatorGains, gain);
constexpr std::size_t kCovarianceAt = offsetof(EstimatorGains, covariance);
static_assert(std::is_standard_layout_v<EstimatorGains> && sizeof(EstimatorGains) == sizeof(CGains) &&
              alignof(EstimatorGains) == alignof(CGains));
static_assert(offsetof(CGains, period) == offsetof(EstimatorGains, period) &&
              offsetof(CGains, order) == offsetof(EstimatorGains, order) &&
              offsetof(CGains, longest_gap) == offsetof(EstimatorGains, longest_gap));
static_assert(offsetof(CGains, gain_position) == kGainAt + offsetof(Covariance::Gain, position) &&
              offsetof(CGains, gain_velocity) == kGainAt + offsetof(Covariance::Gain, velocity) &&
              offsetof(CGains, gain_acceleration) == kGainAt + offsetof(Covariance::Gain, acceleration));
static_assert(offsetof(CGains, covariance_pp) == kCovarianceAt + offsetof(Covariance, pp) &&
              offsetof(CGains, covariance_pv) == kCovarianceAt + offsetof(Covariance, pv) &&
              offsetof(CGains, covariance_pa) == kCovarianceAt + offsetof(Covariance, pa) &&
              offsetof(CGains, covariance_vv) == kCovarianceAt + offsetof(Covariance, vv) &&
              offsetof(CGains, covariance_va) == kCovarianceAt + offsetof(Covariance, va) &&
              offsetof(CGains, covariance_aa) == kCovarianceAt + offsetof(Covariance, aa));
static_assert(offsetof(CGains, process_noise) == offsetof(EstimatorGains, process_noise) &&
              offsetof(CGains, measurement_variance) == offsetof(EstimatorGains, measurement_variance) &&
              offsetof(CGains, acceleration_variance) == offsetof(EstimatorGains, acceleration_variance));

using CFixed = tm485_fixed_gains;
static_assert(std::is_standard_layout_v<FixedGains> && sizeof(FixedGains) == sizeof(CFixed) &&
              alignof(FixedGains) == alignof(CFixed) &&
              sizeof(FixedGains::Correction) == sizeof(CFixed::correction[0]));
static_assert(sizeof(CFixed::correction) == sizeof(FixedGains::correction) &&
              sizeof(CFixed::variance) == sizeof(FixedGains::variance));
static_assert(offsetof(CFixed, correction) == offsetof(FixedGains, correction) &&
              offsetof(CFixed, variance) == offsetof(FixedGains, variance) &&
              offsetof(CFixed, periods_per_ns) == offsetof(FixedGains, periods_per_ns) &&
              offsetof(CFixed, shift) == offsetof(FixedGains, shift) &&
              offsetof(CFixed, rate) == offsetof(FixedGains, rate) &&
              offsetof(CFixed, recovery) == offsetof(FixedGains, recovery) &&
              offsetof(CFixed, period) == offsetof(FixedGains, period) &&
              offsetof(CFixed, longest_gap) == offsetof(FixedGains, longest_gap));
static_assert(std::has_unique_object_representations_v<tm485_fixed_gains> &&
              std::has_unique_object_representations_v<tm485_fixed_estimate>);
// With floats in it only the sum tells that there is no padding.
static_assert(sizeof(tm485_estimate) == 2 * 8 + 5 * 4 + 4 && sizeof(tm485_estimator_gains) == 8 + 4 + 13 * 4);

Estimator& estimator_in(tm485_estimator* estimator) noexcept { return object_in<Estimator>(estimator); }
const Estimator& estimator_in(const tm485_estimator* estimator) noexcept {
  return object_in<Estimator>(estimator);
}
FixedEstimator& estimator_in(tm485_fixed_estimator* estimator) noexcept {
  return object_in<FixedEstimator>(estimator);
}
const FixedEstimator& estimator_in(const tm485_fixed_estimator* estimator) noexcept {
  return object_in<FixedEstimator>(estimator);
}

/// As Estimator::update(const Sample&).
template <class Handle>
tm485_estimator_state update_by(Handle* estimator, const tm485_sample& sample) noexcept {
  auto& self = estimator_in(estimator);
  if (sample.quality != TM485_QUALITY_FRESH || sample.has_position == 0) return value(self.state());
  return value(self.update(sample.position, Time{sample.latch_time}));
}

}  // namespace

void to_c(const Estimate& estimate, tm485_estimate& to) noexcept {
  to = {.time = estimate.time.count(),
        .position = estimate.position,
        .fraction = estimate.fraction,
        .velocity = estimate.velocity,
        .acceleration = estimate.acceleration,
        .position_variance = estimate.position_variance,
        .velocity_variance = estimate.velocity_variance,
        .state = value(estimate.state),
        .reserved = {}};
}

}  // namespace tm485::c

using namespace tm485::c;
using tm485::Time;

bool tm485_estimator_gains_valid(const tm485_estimator_gains* gains) { return tm485::valid(gains_in(gains)); }

float tm485_estimate_from(const tm485_estimate* estimate, int64_t reference) {
  tm485::Estimate at;
  at.position = estimate->position;
  at.fraction = estimate->fraction;
  return at.position_from(reference);
}

size_t tm485_estimator_size(void) { return sizeof(tm485::Estimator); }

tm485_errc tm485_estimator_init(tm485_estimator* estimator, const tm485_estimator_gains* gains) {
  if (estimator == nullptr || gains == nullptr || !aligned(estimator) || !tm485_estimator_gains_valid(gains))
    return TM485_ERR_BAD_ARGUMENT;
  ::new (static_cast<void*>(estimator->storage)) tm485::Estimator(gains_in(gains));
  return TM485_OK;
}

tm485_estimator_state tm485_estimator_update(tm485_estimator* estimator, int64_t position, tm485_time latch) {
  return value(estimator_in(estimator).update(position, Time{latch}));
}

tm485_estimator_state tm485_estimator_update_sample(tm485_estimator* estimator, const tm485_sample* sample) {
  return update_by(estimator, *sample);
}

tm485_estimator_state tm485_estimator_miss(tm485_estimator* estimator, tm485_time latch) {
  return value(estimator_in(estimator).miss(Time{latch}));
}

void tm485_estimator_at(const tm485_estimator* estimator, tm485_time time, tm485_estimate* estimate) {
  to_c(estimator_in(estimator).at(Time{time}), *estimate);
}

void tm485_estimator_reset(tm485_estimator* estimator) { estimator_in(estimator).reset(); }

float tm485_estimator_innovation(const tm485_estimator* estimator) {
  return estimator_in(estimator).innovation();
}

tm485_errc tm485_fixed_gains_make(tm485_fixed_gains* fixed, const tm485_estimator_gains* gains) {
  if (fixed == nullptr || gains == nullptr) return TM485_ERR_BAD_ARGUMENT;
  const auto made = tm485::FixedGains::from(gains_in(gains));
  if (!made) return code(made.error());
  *reinterpret_cast<tm485::FixedGains*>(fixed) = *made;
  return TM485_OK;
}

size_t tm485_fixed_estimator_size(void) { return sizeof(tm485::FixedEstimator); }

tm485_errc tm485_fixed_estimator_init(tm485_fixed_estimator* estimator, const tm485_fixed_gains* gains) {
  if (estimator == nullptr || gains == nullptr || !aligned(estimator)) return TM485_ERR_BAD_ARGUMENT;
  const auto& in_place = *reinterpret_cast<const tm485::FixedGains*>(gains);
  ::new (static_cast<void*>(estimator->storage)) tm485::FixedEstimator(in_place);
  return TM485_OK;
}

tm485_estimator_state tm485_fixed_estimator_update(tm485_fixed_estimator* estimator, int64_t position,
                                                   tm485_time latch) {
  return value(estimator_in(estimator).update(position, Time{latch}));
}

tm485_estimator_state tm485_fixed_estimator_update_sample(tm485_fixed_estimator* estimator,
                                                          const tm485_sample* sample) {
  return update_by(estimator, *sample);
}

tm485_estimator_state tm485_fixed_estimator_miss(tm485_fixed_estimator* estimator, tm485_time latch) {
  return value(estimator_in(estimator).miss(Time{latch}));
}

void tm485_fixed_estimator_at(const tm485_fixed_estimator* estimator, tm485_time time,
                              tm485_fixed_estimate* estimate) {
  const tm485::FixedEstimate at = estimator_in(estimator).at(Time{time});
  *estimate = {.time = at.time.count(),
               .position = at.position,
               .velocity = at.velocity,
               .acceleration = at.acceleration,
               .fraction = at.fraction,
               .variance = at.variance,
               .state = value(at.state),
               .reserved = {}};
}

void tm485_fixed_estimator_reset(tm485_fixed_estimator* estimator) { estimator_in(estimator).reset(); }
