// A servo motor as plain numbers: what turns the simulated shaft when a servo loop is tried.
//
// The current follows its command as a first-order lag, held within a limit: a closed current loop. The torque works
// on one rigid inertia with viscous and Coulomb friction and a load. Nothing of TM485 is in it; motion() is the
// seam to the encoder.
#pragma once

#include "tm485/sim/motion_profile.hpp"
#include "tm485/time.hpp"

namespace tm485::sim {

/// The default: a servo motor of 400 W with a light load.
struct MotorConfig {
  double inertia_kg_m2 = 5e-5;         ///< rotor and load, above 0
  double viscous_newton_m_s = 1e-4;    ///< Nm at 1 rad/s, 0 or more
  double coulomb_newton_m = 0.02;      ///< friction that does not depend on the speed, 0 or more
  double torque_constant = 0.5;        ///< Nm for one A, above 0
  double current_limit_amperes = 8.0;  ///< the command is held within ± this
  Time current_lag{80'000};            ///< time constant of the current loop: 80 µs is 2 kHz; 0: no lag
  double start_rev = 0.0;              ///< angle at the start, at rest
};

/// One owner; nothing blocks or allocates.
class MotorModel {
 public:
  /// At rest at `start`, without current.
  explicit MotorModel(const MotorConfig& config = {}, Time start = Time{0}) noexcept;

  /// The load from now on: torque in Nm against the positive direction (a hanging weight; friction is separate).
  void set_load_torque(double torque_newton_m) noexcept { load_ = torque_newton_m; }

  /// Goes on to `until` with this current command; an instant that has passed changes nothing. Bounded by the span
  /// over kSubStep: the current is exact, the speed of second order in the sub-step, a stop by friction is met.
  void step(Time until, double command_amperes) noexcept;
  static constexpr Time kSubStep{2'000};

  [[nodiscard]] Time time() const noexcept { return time_; }
  [[nodiscard]] double current_amperes() const noexcept { return current_; }
  [[nodiscard]] double torque_newton_m() const noexcept { return config_.torque_constant * current_; }
  /// Angle, speed and acceleration at time(), in revolutions.
  [[nodiscard]] double rev() const noexcept;
  [[nodiscard]] double rev_per_s() const noexcept;
  [[nodiscard]] double rev_per_s2() const noexcept;

  /// The movement about time(): good for some tens of microseconds, for as long as the current stays as it is.
  [[nodiscard]] MotionProfile motion() const noexcept {
    return MotionProfile::segment(time_, rev(), rev_per_s(), rev_per_s2());
  }
  [[nodiscard]] const MotorConfig& config() const noexcept { return config_; }

 private:
  [[nodiscard]] double friction(double drive_newton_m) const noexcept;
  void sub_step(double seconds, double target_amperes, double decay) noexcept;
  void turn(double seconds, double drive_newton_m) noexcept;

  MotorConfig config_;
  double lag_s_;
  double decay_;  ///< of the current over one sub-step
  Time time_;
  double angle_;        ///< rad
  double speed_ = 0.0;  ///< rad/s; exactly 0 while friction holds the shaft
  double current_ = 0.0;
  double load_ = 0.0;
};

}  // namespace tm485::sim
