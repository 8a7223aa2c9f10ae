// The motor against what can be worked out by hand.
#include "tm485/sim/motor_model.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace tm485::sim {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr double kTurn = 2.0 * std::numbers::pi;

/// 1 A makes 1000 rad/s² and nothing takes anything away.
MotorConfig ideal() {
  MotorConfig config;
  config.inertia_kg_m2 = 5e-4;
  config.viscous_newton_m_s = 0.0;
  config.coulomb_newton_m = 0.0;
  config.torque_constant = 0.5;
  config.current_limit_amperes = 10.0;
  config.current_lag = Time{0};
  return config;
}

TEST(MotorModel, RestsWithoutCurrent) {
  MotorConfig config;
  config.start_rev = 0.25;
  MotorModel motor(config);
  motor.step(seconds{1}, 0.0);
  EXPECT_EQ(motor.time(), seconds{1});
  EXPECT_DOUBLE_EQ(motor.rev(), 0.25);
  EXPECT_EQ(motor.rev_per_s(), 0.0);
  EXPECT_EQ(motor.rev_per_s2(), 0.0);
}

TEST(MotorModel, ConstantTorqueMakesAParabola) {
  MotorModel motor(ideal());
  motor.step(milliseconds{100}, 2.0);
  EXPECT_NEAR(motor.rev_per_s() * kTurn, 200.0, 1e-9);
  EXPECT_NEAR(motor.rev() * kTurn, 10.0, 1e-9);
  EXPECT_NEAR(motor.rev_per_s2() * kTurn, 2000.0, 1e-9);
}

TEST(MotorModel, CurrentFollowsAsAFirstOrderLag) {
  MotorConfig config = ideal();
  config.current_lag = microseconds{100};
  MotorModel motor(config);
  for (int i = 1; i <= 40; ++i) {
    const Time now = i * Time{12'345};
    motor.step(now, 3.0);
    const double t = static_cast<double>(now.count()) / 100e3;
    ASSERT_NEAR(motor.current_amperes(), 3.0 * (1.0 - std::exp(-t)), 1e-12);
    // Twice integrated: speed and angle of a lagging current, in closed form.
    ASSERT_NEAR(motor.rev_per_s() * kTurn, 3000.0 * 100e-6 * (t - 1.0 + std::exp(-t)), 1e-9);
    ASSERT_NEAR(motor.rev() * kTurn, 3000.0 * 1e-8 * (0.5 * t * t - t + 1.0 - std::exp(-t)), 1e-8);
  }
}

TEST(MotorModel, CommandIsHeldWithinTheLimit) {
  MotorModel motor(ideal());
  motor.step(milliseconds{1}, 1000.0);
  EXPECT_DOUBLE_EQ(motor.current_amperes(), 10.0);
  motor.step(milliseconds{2}, -1000.0);
  EXPECT_DOUBLE_EQ(motor.current_amperes(), -10.0);
  EXPECT_DOUBLE_EQ(motor.torque_newton_m(), -5.0);
}

TEST(MotorModel, SpeedSettlesWhereTorqueMeetsFrictionAndLoad) {
  MotorConfig config = ideal();
  config.viscous_newton_m_s = 5e-3;  // time constant J / b = 100 ms
  config.coulomb_newton_m = 0.1;
  MotorModel motor(config);
  motor.set_load_torque(0.15);
  const double final_speed = (0.5 - 0.1 - 0.15) / 5e-3;
  motor.step(milliseconds{100}, 1.0);
  EXPECT_NEAR(motor.rev_per_s() * kTurn, final_speed * (1.0 - std::exp(-1.0)), 1e-6);
  motor.step(seconds{5}, 1.0);
  EXPECT_NEAR(motor.rev_per_s() * kTurn, final_speed, 1e-9);
  EXPECT_NEAR(motor.rev_per_s2(), 0.0, 1e-9);
}

TEST(MotorModel, FrictionBringsTheShaftToRestAndHoldsIt) {
  MotorConfig config = ideal();
  config.coulomb_newton_m = 0.05;  // 100 rad/s² of braking
  MotorModel motor(config);
  motor.step(milliseconds{100}, 0.3);  // 300 - 100 rad/s²
  ASSERT_NEAR(motor.rev_per_s() * kTurn, 20.0, 1e-9);
  const double angle = motor.rev() * kTurn;
  motor.step(milliseconds{250}, 0.0);
  EXPECT_NEAR(motor.rev_per_s() * kTurn, 5.0, 1e-9) << "150 ms of braking";
  motor.step(seconds{1}, 0.0);
  EXPECT_EQ(motor.rev_per_s(), 0.0);
  EXPECT_NEAR(motor.rev() * kTurn - angle, 20.0 * 20.0 / 2.0 / 100.0, 1e-9);
  EXPECT_EQ(motor.rev_per_s2(), 0.0);
}

TEST(MotorModel, FrictionHoldsWhatIsWeakerThanItself) {
  MotorConfig config = ideal();
  config.coulomb_newton_m = 0.05;
  MotorModel motor(config);
  motor.set_load_torque(0.3);
  motor.step(milliseconds{10}, 0.52);  // 0.26 Nm against 0.3 Nm: the difference is less than the friction
  EXPECT_EQ(motor.rev_per_s(), 0.0);
  motor.step(milliseconds{20}, 0.48);  // 0.06 Nm are missing: it sinks
  EXPECT_LT(motor.rev_per_s(), 0.0);
}

TEST(MotorModel, ReversalPassesThroughZeroWithTheFrictionOnTheOtherSide) {
  MotorConfig config = ideal();
  config.coulomb_newton_m = 0.05;
  MotorModel motor(config);
  motor.step(milliseconds{100}, 0.3);   // to 20 rad/s
  motor.step(milliseconds{200}, -0.3);  // 50 ms at -400 rad/s², then 50 ms at -200 rad/s²
  EXPECT_NEAR(motor.rev_per_s() * kTurn, -10.0, 1e-9);
  EXPECT_NEAR(motor.rev() * kTurn, 1.0 + 0.5 - 0.25, 1e-9);
}

TEST(MotorModel, EnergyIsAccountedFor) {
  MotorConfig config;  // everything switched on
  MotorModel motor(config);
  const double load = 0.05;
  motor.set_load_torque(load);
  double put_in = 0.0;
  double friction = 0.0;
  double speed = 0.0;
  double torque = 0.0;
  for (int i = 1; i <= 200'000; ++i) {
    const Time now = i * microseconds{1};
    motor.step(now, 4.0 * std::sin(1e-3 * i));
    const double mean = 0.5 * (speed + motor.rev_per_s() * kTurn);
    put_in += 0.5 * (torque + motor.torque_newton_m()) * mean * 1e-6;
    friction += (config.viscous_newton_m_s * mean * mean + config.coulomb_newton_m * std::abs(mean)) * 1e-6;
    speed = motor.rev_per_s() * kTurn;
    torque = motor.torque_newton_m();
  }
  const double stored = 0.5 * config.inertia_kg_m2 * speed * speed + load * motor.rev() * kTurn;
  ASSERT_GT(friction, 0.01);
  EXPECT_NEAR(put_in, stored + friction, 1e-4 * (std::abs(stored) + friction));
}

TEST(MotorModel, HowOftenItIsAskedChangesNothing) {
  MotorModel often;
  MotorModel seldom;
  Time now{0};
  for (int i = 0; i < 1000; ++i) {
    const double command = (i / 100) % 2 == 0 ? 2.0 : -2.0;
    for (const int part : {700, 11'800, 10'000, 40'000}) often.step(now += Time{part}, command);
    seldom.step(now, command);
    seldom.step(now - Time{1'000}, 7.0);  // has passed
  }
  EXPECT_NEAR(often.rev(), seldom.rev(), 1e-6);
  EXPECT_NEAR(often.rev_per_s(), seldom.rev_per_s(), 1e-5);
  EXPECT_NEAR(often.current_amperes(), seldom.current_amperes(), 1e-12);
}

TEST(MotorModel, MotionIsWhatItWillDoNext) {
  MotorModel motor;
  motor.step(milliseconds{5}, 3.0);
  const MotionProfile motion = motor.motion();
  const double before = motor.rev();
  EXPECT_DOUBLE_EQ(motion.revolutions(milliseconds{5}), before);
  motor.step(milliseconds{5} + microseconds{50}, 3.0);
  EXPECT_GT(motor.rev() - before, 1e-4);
  EXPECT_NEAR(motion.revolutions(motor.time()), motor.rev(), 1e-9);
}

}  // namespace
}  // namespace tm485::sim
