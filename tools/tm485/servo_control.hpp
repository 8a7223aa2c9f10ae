// ServoControl: what the servo loop of `tm485 servo-demo` does in each period. Of the stack it touches the client only.
#pragma once

#include <cstdint>
#include <optional>

#include "servo_cascade.hpp"
#include "servo_demo.hpp"
#include "tm485/bus/axis_client.hpp"

namespace tm485::cli {

/// One owner: the context of the servo loop.
class ServoControl {
 public:
  /// All of them must outlive it; it is the producer of the ring.
  ServoControl(const ServoSettings& settings, Feedback feedback, AxisClient& client,
               ControlRing& ring) noexcept;

  /// A control instant: `tick` by the grid, `now` when the loop came to it.
  void on_tick(Time tick, Time now) noexcept;

  /// The run is over: its time has passed since the axis was first switched on.
  [[nodiscard]] bool finished(Time now) const noexcept {
    return begun_ != kNever && now - begun_ >= settings_->duration;
  }
  /// When the axis was first switched on; kNever: not yet.
  [[nodiscard]] Time begun() const noexcept { return begun_; }
  [[nodiscard]] const PeriodCounts& periods() const noexcept { return periods_; }
  [[nodiscard]] std::uint32_t torque_offs() const noexcept { return torque_offs_; }
  [[nodiscard]] std::uint32_t recoveries() const noexcept { return recoveries_; }
  [[nodiscard]] std::uint64_t overflows() const noexcept { return overflows_; }

 private:
  /// What the loop takes the shaft to do.
  struct Shaft {
    float counts = 0.0F;  ///< from the reference's count
    float rev_per_s = 0.0F;
  };

  void let_go(Time now) noexcept;
  void ask_to_resume(Time now) noexcept;
  void take_hold(std::int64_t position, Time now) noexcept;
  void drive(const Sample& sample, Time now) noexcept;
  [[nodiscard]] Shaft measure(const Sample& sample, std::int64_t reference, Time now) noexcept;
  void difference(const Sample& sample) noexcept;
  void push(const ControlRecord& record) noexcept;

  const ServoSettings* settings_;
  Feedback feedback_;
  AxisClient* client_;
  ControlRing::Producer records_;
  servo::ServoCascade cascade_;
  double counts_per_rev_;

  bool holding_ = false;
  std::int64_t origin_ = 0;  ///< the count at which the reference begins
  Time hold_since_{0};
  Time begun_ = kNever;
  Time ask_at_{0};  ///< while not holding: not before

  // Raw differencing.
  std::int64_t last_position_ = 0;
  Time last_latch_ = kNever;
  float raw_rev_per_s_ = 0.0F;

  PeriodCounts periods_;
  std::uint32_t torque_offs_ = 0;
  std::uint32_t recoveries_ = 0;
  std::uint64_t overflows_ = 0;
};

}  // namespace tm485::cli
