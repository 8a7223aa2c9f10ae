// The cascade of the servo example on the motor of the simulator, with the true angle as its feedback.
#include "servo_cascade.hpp"

#include <gtest/gtest.h>

#include "tm485/sim/motor_model.hpp"

namespace tm485::test {
namespace {

constexpr Time kPeriod{62'500};

servo::CascadeConfig config_for(const sim::MotorConfig& motor, float velocity_hz = 400.0F) {
  return servo::CascadeConfig::rigid_axis(static_cast<float>(motor.inertia_kg_m2),
                                          static_cast<float>(motor.torque_constant),
                                          static_cast<float>(motor.current_limit_amperes), velocity_hz,
                                          static_cast<float>(kPeriod.count()) * 1e-9F);
}

struct Loop {
  explicit Loop(const servo::CascadeConfig& config) : cascade(config) {}

  /// One period towards `reference`; answers the error before it.
  double step(const servo::Setpoint& reference) {
    const double error = reference.rev - motor.rev();
    current = cascade.step(static_cast<float>(error), static_cast<float>(motor.rev_per_s()), reference);
    motor.step(motor.time() + kPeriod, static_cast<double>(current));
    return error;
  }

  sim::MotorModel motor;
  servo::ServoCascade cascade;
  float current = 0.0F;
};

TEST(ServoCascade, SettlesOnAPointAgainstLoadAndFriction) {
  Loop loop(config_for({}));
  loop.motor.set_load_torque(0.6);
  for (int i = 0; i < 8000; ++i) (void)loop.step({.rev = 0.01});
  EXPECT_NEAR(loop.motor.rev(), 0.01, 1e-5);
  EXPECT_NEAR(loop.motor.torque_newton_m(), 0.6, 0.021) << "the load, within the friction";
}

TEST(ServoCascade, FollowsASwingWithFeedForward) {
  Loop with(config_for({}));
  servo::CascadeConfig config = config_for({});
  config.acceleration_gain = 0.0F;
  Loop without(config);
  const servo::Swing swing(0.25, 5.0);
  double worst = 0.0;
  double worst_without = 0.0;
  for (int i = 0; i < 16'000; ++i) {
    const double seconds = i * 62.5e-6;
    worst = std::max(worst, std::abs(with.step(swing.at(seconds))));
    worst_without = std::max(worst_without, std::abs(without.step(swing.at(seconds))));
  }
  EXPECT_LT(worst, 2e-4) << "26 counts of 17 bits";
  EXPECT_GT(worst_without, 2.0 * worst);
}

TEST(ServoCascade, CurrentStaysWithinItsLimit) {
  Loop loop(config_for({}));
  for (int i = 0; i < 4000; ++i) {
    (void)loop.step({.rev = 2.0});
    ASSERT_LE(std::abs(loop.current), 8.0F);
  }
}

TEST(ServoCascade, IntegralDoesNotWindUpAtTheLimit) {
  // A shaft that cannot turn for a second, then is free: it must not run away.
  servo::ServoCascade cascade(config_for({}));
  for (int i = 0; i < 16'000; ++i) EXPECT_LE(cascade.step(0.5F, 0.0F, {}), 8.0F);
  int periods = 0;
  while (cascade.step(-0.01F, 0.0F, {}) > 0.0F) ++periods;
  EXPECT_LT(periods, 160) << "10 ms";
}

TEST(ServoCascade, ResetForgetsTheIntegral) {
  servo::ServoCascade cascade(config_for({}));
  for (int i = 0; i < 100; ++i) (void)cascade.step(0.001F, 0.0F, {});
  EXPECT_GT(cascade.step(0.0F, 0.0F, {}), 0.0F);
  cascade.reset();
  EXPECT_EQ(cascade.step(0.0F, 0.0F, {}), 0.0F);
}

/// Velocity and acceleration are the derivatives of the position.
template <class Reference>
void expect_smooth(const Reference& reference, double seconds) {
  constexpr double kStep = 1e-6;
  constexpr double kInterval = 1.234e-3;
  for (int i = 1; i * kInterval < seconds; ++i) {
    const double t = i * kInterval;
    const servo::Setpoint before = reference.at(t - kStep);
    const servo::Setpoint here = reference.at(t);
    const servo::Setpoint after = reference.at(t + kStep);
    ASSERT_NEAR((after.rev - before.rev) / (2.0 * kStep), here.rev_per_s, 1e-3) << t;
    ASSERT_NEAR((after.rev_per_s - before.rev_per_s) / (2.0 * kStep), here.rev_per_s2, 5.0) << t;
  }
}

TEST(Swing, StartsAtRestAndIsSmooth) {
  const servo::Swing swing(0.25, 3.0);
  EXPECT_EQ(swing.at(0.0).rev, 0.0);
  EXPECT_EQ(swing.at(0.0).rev_per_s, 0.0F);
  EXPECT_NEAR(swing.at(1.0 / 6.0).rev, 0.5, 1e-12);
  expect_smooth(swing, 1.0);
}

TEST(Moves, GoRestAndComeBack) {
  const servo::Moves moves(2.0, 25.0, 0.05);  // a move takes 1.875 * 2 / 25 = 150 ms
  EXPECT_EQ(moves.at(0.0).rev, 0.0);
  EXPECT_NEAR(moves.at(0.075).rev, 1.0, 1e-12);
  EXPECT_NEAR(moves.at(0.075).rev_per_s, 25.0, 1e-4);
  EXPECT_NEAR(moves.at(0.175).rev, 2.0, 1e-12);
  EXPECT_EQ(moves.at(0.175).rev_per_s, 0.0F);
  EXPECT_NEAR(moves.at(0.275).rev, 1.0, 1e-12);
  EXPECT_NEAR(moves.at(0.275).rev_per_s, -25.0, 1e-4);
  EXPECT_NEAR(moves.at(0.39).rev, 0.0, 1e-12);
  expect_smooth(moves, 0.4);
  EXPECT_NEAR(servo::Moves(-2.0, 25.0, 0.05).at(0.075).rev, -1.0, 1e-12);
}

}  // namespace
}  // namespace tm485::test
