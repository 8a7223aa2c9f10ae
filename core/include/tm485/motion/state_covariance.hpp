// StateCovariance: how uncertain position, velocity and acceleration are, and what time and a sample do to that.
// The arithmetic of the Kalman filter in units of counts and periods, for two or three states; docs/estimator.md.
#pragma once

namespace tm485 {

/// The upper half of the symmetric matrix; with two states the three that name `a` are 0.
template <class Real>
struct StateCovariance {
  Real pp = 0;  ///< counts²
  Real pv = 0;  ///< counts² per period
  Real pa = 0;
  Real vv = 0;  ///< (counts per period)²
  Real va = 0;
  Real aa = 0;  ///< (counts per period²)²

  /// What one count of innovation adds to each state.
  struct Gain {
    Real position = 0;
    Real velocity = 0;
    Real acceleration = 0;
  };

  /// `t` periods later, 0 or more; `noise` is the density of the white acceleration (order 2) or jerk (order 3).
  constexpr void predict(Real t, Real noise, unsigned order) noexcept {
    const Real t2 = t * t;
    const Real half = t2 / 2;
    const Real p_to_v = pv + t * vv + half * va;
    const Real p_to_a = pa + t * va + half * aa;
    const Real v_to_a = va + t * aa;
    pp = pp + t * pv + half * pa + t * p_to_v + half * p_to_a;
    pv = p_to_v + t * p_to_a;
    pa = p_to_a;
    vv = vv + t * va + t * v_to_a;
    va = v_to_a;
    const Real n = noise * t;
    if (order == 2) {
      pp += n * t2 * (Real{1} / 3);
      pv += n * t * (Real{1} / 2);
      vv += n;
    } else {
      pp += n * t2 * t2 * (Real{1} / 20);
      pv += n * t2 * t * (Real{1} / 8);
      pa += n * t2 * (Real{1} / 6);
      vv += n * t2 * (Real{1} / 3);
      va += n * t * (Real{1} / 2);
      aa += n;
    }
  }

  /// The best use of a sample with this variance, counts².
  [[nodiscard]] constexpr Gain gain(Real measurement_variance) const noexcept {
    const Real scale = 1 / (pp + measurement_variance);
    return {pp * scale, pv * scale, pa * scale};
  }

  /// A sample was used with the best gain.
  constexpr void correct(const Gain& gain, Real measurement_variance) noexcept {
    vv -= gain.velocity * pv;
    va -= gain.velocity * pa;
    aa -= gain.acceleration * pa;
    pp = gain.position * measurement_variance;
    pv = gain.velocity * measurement_variance;
    pa = gain.acceleration * measurement_variance;
  }

  /// After two samples `t` periods apart whose difference gave the velocity; the acceleration is taken as 0.
  [[nodiscard]] static constexpr StateCovariance of_two_samples(Real t, Real noise, unsigned order,
                                                                Real measurement_variance,
                                                                Real acceleration_variance) noexcept {
    // The motion's own part: what happened in between, less its mean, as seen from the second sample.
    StateCovariance p;
    p.predict(t, noise, order);
    const Real inverse = 1 / t;
    const Real vv_motion = p.vv - 2 * inverse * p.pv + inverse * inverse * p.pp;
    const Real va_motion = p.va - inverse * p.pa;
    p.pp = measurement_variance;
    p.pv = measurement_variance * inverse;
    p.pa = 0;
    p.vv = 2 * measurement_variance * inverse * inverse + vv_motion;
    p.va = va_motion;
    if (order == 3) {
      p.vv += acceleration_variance * t * t / 4;
      p.va += acceleration_variance * t / 2;
      p.aa += acceleration_variance;
    }
    return p;
  }
};

}  // namespace tm485
