// The C program of this folder on a simulated line: what it checks itself, and that C and C++ tell the same.
#include "c/program.h"

#include <gtest/gtest.h>

#include <memory>

#include "c/shim.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/motion/estimator.hpp"
#include "tm485/motion/estimator_fixed.hpp"
#include "tm485/sim/fault_hook.hpp"

namespace tm485 {
namespace {

using test::CLine;

/// No reply gets through from `cut` to `mended`.
struct Cut : sim::FaultHook {
  Time cut = kNever, mended = kNever;
  bool on_burst(sim::Burst& burst) noexcept override {
    const bool lost = burst.talker == sim::Talker::encoder && burst.start >= cut && burst.start < mended;
    if (lost) burst.count = 0;
    return lost;
  }
};

void expect_same(const tm485_sample& c, const Sample& cpp) {
  EXPECT_EQ(c.position, cpp.position());
  EXPECT_EQ(c.latch_time, cpp.latch_time().count());
  EXPECT_EQ(c.sequence, cpp.sequence());
  EXPECT_EQ(c.single_turn, cpp.single_turn());
  EXPECT_EQ(c.turns, cpp.turns());
  EXPECT_EQ(c.electrical_angle, cpp.electrical_angle());
  EXPECT_EQ(c.latch_uncertainty_ns, cpp.latch_uncertainty().count());
  EXPECT_EQ(c.announced_hold_ns, cpp.announced_hold().count());
  EXPECT_EQ(c.status, cpp.status().bits());
  EXPECT_EQ(c.enid, cpp.enid());
  EXPECT_EQ(c.id, number(cpp.id()));
  EXPECT_EQ(c.quality, static_cast<int>(cpp.quality()));
  EXPECT_EQ(c.alarm, static_cast<int>(cpp.alarm()));
  EXPECT_EQ(c.referenced != 0, cpp.referenced());
  EXPECT_EQ(c.has_position != 0, cpp.has_position());
}

void expect_same(const tm485_time_statistic& c, const TimeStatistic& cpp) {
  EXPECT_EQ(c.minimum, cpp.minimum().count());
  EXPECT_EQ(c.mean, cpp.mean().count());
  EXPECT_EQ(c.maximum, cpp.maximum().count());
  EXPECT_EQ(c.count, cpp.count());
  EXPECT_EQ(c.origin, cpp.histogram().origin.count());
  EXPECT_EQ(c.shift, cpp.histogram().shift);
  for (std::size_t i = 0; i < Histogram::kBins; ++i) EXPECT_EQ(c.bins[i], cpp.histogram().bins[i]) << i;
}

TEST(CInterface, SamplesAndStatisticsAreThoseOfCpp) {
  for (const char* preset : {"tm485_17", "tm485_23", "tformat_17_battery"}) {
    const std::string options = std::string("profile=") + preset +
                                ",rpm=3000,seed=7,lost=0.01,almc=" + (preset[1] == 'f' ? "80" : "00");
    CLine line(options);
    const auto c = std::make_unique<collected>();
    const test_line view = line.view();
    ASSERT_EQ(use_bus(&view, preset, TM485_ID_EVERYTHING, 62500, 2000, c.get()), 0) << preset;

    sim::SimulatedEncoder encoder(*sim::parse_sim_options(options));
    const CompiledProfile profile = test::compiled(preset);
    BusConfig config;
    config.cycle = Cycle{DataId::everything, Time{62'500}};
    Bus bus(encoder.port(), profile, config);
    ASSERT_TRUE(bus.start(Time{0}));
    std::size_t held = 0;
    std::uint32_t seen = bus.latest().sequence();
    std::size_t count = 0;
    for (Time now{0}; count < c->count && !testing::Test::HasFailure();) {
      const Time due = bus.poll(now);
      const Time event = encoder.line().next_event();
      now = std::max(now, std::min({due, event > now ? event : kNever, now + Time{1'000'000}}));
      if (bus.latest().sequence() == seen) continue;
      seen = bus.latest().sequence();
      held += bus.latest().quality() == Quality::held;
      expect_same(c->samples[count++], bus.latest());
    }
    EXPECT_GT(held, 5U) << "some replies are lost";

    const Statistics& cpp = bus.statistics();
    EXPECT_EQ(c->statistics.cycles, cpp.cycles);
    EXPECT_EQ(c->statistics.good, cpp.good);
    EXPECT_EQ(c->statistics.failed, cpp.failed);
    EXPECT_EQ(c->statistics.slips, cpp.slips);
    EXPECT_EQ(c->statistics.startups, cpp.startups);
    EXPECT_EQ(c->statistics.warnings, cpp.warnings);
    EXPECT_EQ(c->statistics.reserved_status, cpp.reserved_status);
    for (std::size_t i = 0; i < TM485_ERRC_ROOM; ++i)
      EXPECT_EQ(c->statistics.errors[i], i < kErrcCount ? cpp.errors[i] : 0U) << i;
    expect_same(c->statistics.t1, cpp.t1);
    expect_same(c->statistics.reply_delay, cpp.reply_delay);
    expect_same(c->statistics.servo_phase, cpp.servo_phase);
    EXPECT_EQ(c->record.start, bus.last_record().start.count());
    EXPECT_EQ(c->record.result, static_cast<int>(bus.last_record().result));
    EXPECT_EQ(c->record.kind, TM485_RECORD_CYCLIC);
    EXPECT_EQ(line.encoder().model().t1().violations(), 0U);
  }
}

TEST(CInterface, PatternsRefusalsAndBackground) {
  CLine line("profile=tm485_17,rpm=600");
  const test_line view = line.view();
  EXPECT_EQ(use_patterns(&view), 0);
  EXPECT_EQ(line.encoder().model().t1().violations(), 0U);
}

TEST(CInterface, AStartUpThatFailsSaysWhere) {
  CLine line("profile=tm485_17");
  Cut always;
  always.cut = Time{0};
  line.encoder().line().set_fault_hook(&always);
  const test_line view = line.view();
  EXPECT_EQ(use_dead_line(&view), 0);
}

TEST(CInterface, APortIsNotTrusted) { EXPECT_EQ(use_bad_port(), 0); }

TEST(CInterface, WrongArgumentsAreRefused) {
  CLine line("profile=tm485_17");
  const test_line view = line.view();
  EXPECT_EQ(use_wrong_arguments(&view), 0);
}

TEST(CInterface, Texts) { EXPECT_EQ(use_texts(), 0); }
TEST(CInterface, Profiles) { EXPECT_EQ(use_profiles(), 0); }
TEST(CInterface, Codec) { EXPECT_EQ(use_codec(), 0); }

TEST(CInterface, EstimatorsAreThoseOfCpp) {
  tm485_estimate c;
  tm485_fixed_estimate c_fixed;
  ASSERT_EQ(use_estimators(&c, &c_fixed), 0);

  EstimatorGains gains;
  gains.period = Time{62'500};
  gains.order = 3;
  gains.gain = {kGains.gain_position, kGains.gain_velocity, kGains.gain_acceleration};
  gains.covariance = {kGains.covariance_pp, kGains.covariance_pv, kGains.covariance_pa,
                      kGains.covariance_vv, kGains.covariance_va, kGains.covariance_aa};
  gains.process_noise = kGains.process_noise;
  gains.measurement_variance = kGains.measurement_variance;
  const FixedGains fixed_gains = *FixedGains::from(gains);
  Estimator estimator(gains);
  FixedEstimator fixed(fixed_gains);
  for (int i = 0; i < 400; ++i) {
    const Time latch = Time{62'500} * i;
    if (i % 50 == 49) {
      estimator.miss(latch);
      fixed.miss(latch);
    } else {
      estimator.update(5'000 + 37 * i, latch);
      fixed.update(5'000 + 37 * i, latch);
    }
  }
  const Estimate cpp = estimator.at(Time{62'500} * 400 + Time{1'000});
  EXPECT_EQ(c.time, cpp.time.count());
  EXPECT_EQ(c.position, cpp.position);
  EXPECT_EQ(c.fraction, cpp.fraction);
  EXPECT_EQ(c.velocity, cpp.velocity);
  EXPECT_EQ(c.acceleration, cpp.acceleration);
  EXPECT_EQ(c.position_variance, cpp.position_variance);
  EXPECT_EQ(c.velocity_variance, cpp.velocity_variance);
  EXPECT_EQ(c.state, static_cast<int>(cpp.state));
  const FixedEstimate cpp_fixed = fixed.at(Time{62'500} * 400 + Time{1'000});
  EXPECT_EQ(c_fixed.position, cpp_fixed.position);
  EXPECT_EQ(c_fixed.fraction, cpp_fixed.fraction);
  EXPECT_EQ(c_fixed.velocity, cpp_fixed.velocity);
  EXPECT_EQ(c_fixed.acceleration, cpp_fixed.acceleration);
  EXPECT_EQ(c_fixed.variance, cpp_fixed.variance);
}

TEST(CInterface, AnAxisLosesItsLineAndResumes) {
  CLine line("profile=tm485_17,rpm=600");
  Cut cable;
  cable.cut = Time{200'000'000};
  cable.mended = Time{210'000'000};
  line.encoder().line().set_fault_hook(&cable);
  const test_line view = line.view();
  loop_account account;
  // 10 revolutions a second.
  ASSERT_EQ(use_axis(&view, cable.cut.count(), cable.mended.count(), 10.0 * 131072.0, &account), 0);
  EXPECT_EQ(account.raised, 1U);
  EXPECT_GT(account.raised_at, cable.cut.count() + 900'000);
  EXPECT_LT(account.raised_at, cable.cut.count() + 1'300'000);
  EXPECT_GT(account.resumed_at, cable.mended.count() + 300'000'000) << "only the command ends it";
  EXPECT_GE(account.extrapolated, 14U);
  EXPECT_LE(account.extrapolated, 20U);
  EXPECT_GT(account.fresh, 3'000U);
  EXPECT_LT(account.largest_error, 1.5);
  EXPECT_GT(account.statistics.servo_ticks, 5'000U);
  EXPECT_GE(account.statistics.failed, 3U);
  EXPECT_EQ(account.statistics.invalidated, 1U);
  EXPECT_EQ(line.encoder().model().t1().violations(), 0U);
}

TEST(CInterface, CommandsOfAnAxis) {
  CLine line("profile=tm485_17,rpm=600");
  const test_line view = line.view();
  EXPECT_EQ(use_axis_commands(&view), 0);
}

TEST(CInterface, EepromTasks) {
  for (const char* preset : {"tm485_17", "tformat_17"}) {
    for (const bool in_axis : {false, true}) {
      CLine line(std::string("profile=") + preset + ",rpm=600,seed=3");
      const test_line view = line.view();
      EXPECT_EQ(use_eeprom(&view, preset, in_axis, in_axis), 0) << preset << (in_axis ? " in an axis" : "");
      const auto& eeprom = line.encoder().model().eeprom();
      EXPECT_EQ(eeprom.image()[2 * 127 + 110], 3);
      EXPECT_EQ(eeprom.image()[2 * 127 + 110 + 39], 3 + 5 * 39);
    }
  }
}

TEST(CInterface, ResetRuns) {
  CLine line("profile=tm485_17,rpm=300");
  line.encoder().model().latch_alarms(0x10, 0x04);
  const test_line view = line.view();
  tm485_reset_outcome outcome;
  ASSERT_EQ(use_reset(&view, TM485_RESET_ERRORS, &outcome), 0);
  EXPECT_EQ(outcome.verdict, TM485_VERDICT_VERIFIED);
  EXPECT_EQ(outcome.runs, 1);
  EXPECT_EQ(outcome.status_before & 0x0410, 0x0410);
  EXPECT_EQ(outcome.status_after & 0x0410, 0);
  EXPECT_EQ(line.encoder().model().statistics().requests[7], 10U);

  CLine turning("profile=tm485_17,rpm=300");
  const test_line turning_view = turning.view();
  ASSERT_EQ(use_reset(&turning_view, TM485_RESET_ZERO, &outcome), 0);
  EXPECT_EQ(outcome.verdict, TM485_VERDICT_REFUSED);
  EXPECT_EQ(outcome.code, TM485_ERR_SHAFT_MOVES);
}

}  // namespace
}  // namespace tm485
