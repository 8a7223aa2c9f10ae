// ServoPlant: the machine of `tm485 servo-demo`: a motor that turns the simulated encoder, and the referee that
// compares what the servo loop believes with what the shaft does.
#pragma once

#include <cmath>
#include <cstdint>

#include "tm485/sim/motor_model.hpp"
#include "tm485/sim/simulated_encoder.hpp"
#include "tm485/sync/spsc_ring.hpp"
#include "tm485/time.hpp"

namespace tm485::cli {

/// Root mean square and largest size of many values.
class Spread {
 public:
  void add(double value) noexcept {
    ++count_;
    squares_ += value * value;
    largest_ = std::max(largest_, std::abs(value));
  }
  [[nodiscard]] std::uint64_t count() const noexcept { return count_; }
  [[nodiscard]] double rms() const noexcept {
    return count_ == 0 ? 0.0 : std::sqrt(squares_ / static_cast<double>(count_));
  }
  [[nodiscard]] double largest() const noexcept { return largest_; }

 private:
  std::uint64_t count_ = 0;
  double squares_ = 0.0;
  double largest_ = 0.0;
};

/// What the servo loop has done in one period. In revolutions of the axis, as the encoder counts them.
struct ControlRecord {
  Time at{0};                    ///< when
  float current_amperes = 0.0F;  ///< the command from then on
  bool driving = false;          ///< false: torque is off, and the rest means nothing
  double reference_rev = 0;      ///< where the shaft should be at that instant
  float rev_per_s = 0.0F;        ///< what the loop took for the speed
};

/// From the servo loop to the plant: a quarter of a second at 16 kHz.
using ControlRing = SpscRing<ControlRecord, 4096>;

/// What the referee has found, over the periods in which the loop was driving, from kSettle after it took hold.
struct PlantFindings {
  Spread tracking_rev;          ///< reference less true angle at the control instant
  Spread speed_rev_per_s;       ///< the speed that the loop believed less the true one
  Spread ripple_amperes;        ///< the current command above kRippleHz
  double top_rev_per_s = 0;     ///< of the shaft
  std::uint32_t watchdogs = 0;  ///< times that no command came for kWatchdog
};
inline constexpr double kRippleHz = 500.0;
/// As in a drive: without a command for this long there is no current until the next one.
inline constexpr Time kWatchdog = std::chrono::milliseconds(1);
inline constexpr Time kSettle = std::chrono::milliseconds(50);

/// One owner: the context of the bus.
class ServoPlant {
 public:
  /// `encoder` and `ring` must outlive the plant, which is the ring's consumer.
  ServoPlant(sim::SimulatedEncoder& encoder, ControlRing& ring, const sim::MotorConfig& config,
             double load_newton_m) noexcept
      : encoder_(&encoder), records_(ring), motor_(config) {
    motor_.set_load_torque(load_newton_m);
  }

  /// Takes the commands given up to `now`, turns the shaft until then, and tells the encoder. Call it before a request
  /// is sent.
  void advance(Time now) noexcept;

  /// The axis has become invalid: no current, until the loop has let go and takes hold again.
  void torque_off(Time now) noexcept;

  /// When the loop took hold for the first time; kNever: not yet.
  [[nodiscard]] Time begun() const noexcept { return begun_; }
  [[nodiscard]] const PlantFindings& findings() const noexcept { return findings_; }
  [[nodiscard]] const sim::MotorModel& motor() const noexcept { return motor_; }

 private:
  void turn(Time until) noexcept;
  void judge(const ControlRecord& record) noexcept;

  sim::SimulatedEncoder* encoder_;
  ControlRing::Consumer records_;
  sim::MotorModel motor_;
  double command_ = 0.0;
  Time commanded_{0};
  bool driving_ = false;
  bool off_ = false;  ///< after torque_off()
  Time begun_ = kNever;
  Time held_since_{0};
  double turns_ = 0.0;   ///< whole turns of the axis less those of the motor
  double smooth_ = 0.0;  ///< the command below kRippleHz
  Time last_{0};
  PlantFindings findings_;
};

}  // namespace tm485::cli
