// What an axis does when the position does not go on from the last one: it lets go, and who may take hold again.
#include <gtest/gtest.h>

#include <memory>

#include "support/bus_fixture.hpp"
#include "tm485/bus/axis.hpp"

namespace tm485 {
namespace {

using test::Bytes;
using test::ms;
using test::ScriptedPort;
using test::us;

class AxisTrust : public testing::Test {
 protected:
  static constexpr std::int64_t kTurn = 131'072;

  AxisTrust() {
    setup.bus.cycle = Cycle{DataId::everything, us(110)};
    setup.on_invalid = {[](void* count, Time) { ++*static_cast<int*>(count); }, &torque_offs};
    encoder.abm = 7;
    port.answer = [this](const Bytes& request, Time) {
      ScriptedPort::Answer answer;
      answer.bytes = encoder.reply(request);
      return answer;
    };
  }
  void begin_running() {
    profile = std::make_unique<CompiledProfile>(test::compiled("tm485_17"));
    axis = std::make_unique<Axis<ScriptedPort>>(port, *profile, setup);
    ASSERT_TRUE(axis->start(driver.now));
    ASSERT_TRUE(driver.run(*axis, port, driver.now + ms(3'000), [&] { return read().usable(); }));
    ASSERT_EQ(command(Command::Kind::set_referenced), Errc::ok);
    run(ms(5));
  }
  void run(Time span) { driver.run(*axis, port, driver.now + span); }
  LoopState read() { return axis->client().read(driver.now); }
  Errc command(Command::Kind kind) {
    EXPECT_TRUE(axis->client().post(Command::of(kind)));
    run(ms(1));
    const auto result = axis->client().poll_completion();
    EXPECT_TRUE(result);
    return result ? result->error : Errc::bad_state;
  }

  test::PlainEncoder encoder;
  int torque_offs = 0;
  ScriptedPort port;
  test::Driver driver;
  AxisSetup setup;
  std::unique_ptr<CompiledProfile> profile;
  std::unique_ptr<Axis<ScriptedPort>> axis;
};

TEST_F(AxisTrust, ADiscontinuityIsALoss) {
  begin_running();
  encoder.abm = 3;
  run(ms(2));
  EXPECT_EQ(axis->bus().statistics().discontinuities, 1U);
  EXPECT_EQ(axis->bus().state(), BusState::running);
  EXPECT_FALSE(read().usable()) << "the drive must not follow the step";
  EXPECT_EQ(torque_offs, 1);
  run(ms(20));
  EXPECT_EQ(torque_offs, 1) << "once";
  EXPECT_FALSE(read().usable());
  EXPECT_EQ(command(Command::Kind::resume), Errc::ok);
  EXPECT_TRUE(read().usable());
  EXPECT_EQ(read().sample->position(), 2 * kTurn + 1'000);
}

TEST_F(AxisTrust, ARestartIsALossUntilSomebodyResumes) {
  begin_running();
  encoder.abm = 1;
  run(ms(50));
  EXPECT_EQ(axis->bus().statistics().restarts, 1U);
  ASSERT_EQ(axis->bus().state(), BusState::running);
  EXPECT_FALSE(read().usable());
  EXPECT_EQ(torque_offs, 1);
  EXPECT_EQ(command(Command::Kind::resume), Errc::ok);
  EXPECT_TRUE(read().usable());
  EXPECT_FALSE(read().sample->referenced());
}

TEST_F(AxisTrust, UntilHomedNobodyResumesBeforeTheAxisIsReferenced) {
  setup.bus.axis.after_restart = Continuity::until_homed;
  begin_running();
  encoder.abm = 1;
  run(ms(50));
  EXPECT_EQ(command(Command::Kind::resume), Errc::bad_state);
  EXPECT_FALSE(read().usable());
  EXPECT_EQ(command(Command::Kind::set_referenced), Errc::ok);
  EXPECT_FALSE(read().usable()) << "referenced is not resumed";
  EXPECT_EQ(command(Command::Kind::resume), Errc::ok);
  EXPECT_TRUE(read().usable());
}

TEST_F(AxisTrust, ReReferencedItLetsGoAndGoesOnByItself) {
  setup.bus.axis.after_restart = Continuity::re_reference;
  begin_running();
  encoder.abm = 1;
  run(ms(50));
  EXPECT_EQ(torque_offs, 1) << "without a position meanwhile";
  EXPECT_TRUE(read().usable());
  EXPECT_TRUE(read().sample->referenced());
  EXPECT_EQ(read().sample->position(), 6 * kTurn + 1'000);
}

TEST_F(AxisTrust, ReReferencingIsNoLicenceForADiscontinuity) {
  setup.bus.axis.after_restart = Continuity::re_reference;
  begin_running();
  encoder.abm = 3;
  run(ms(50));
  EXPECT_FALSE(read().usable());
  EXPECT_EQ(torque_offs, 1);
}

TEST_F(AxisTrust, ARestartBehindADiscontinuityStillWantsSomebodyToResume) {
  setup.bus.axis.after_restart = Continuity::re_reference;
  begin_running();
  encoder.abm = 3;
  run(ms(5));
  ASSERT_FALSE(read().usable());
  encoder.abm = 1;
  run(ms(50));
  ASSERT_EQ(axis->bus().statistics().restarts, 1U);
  EXPECT_FALSE(read().usable()) << "nobody has looked at the step yet";
  EXPECT_EQ(command(Command::Kind::resume), Errc::ok);
  EXPECT_TRUE(read().usable());
  encoder.abm = 9;  // a step that is resumed leaves the policy as it was
  run(ms(5));
  EXPECT_EQ(command(Command::Kind::resume), Errc::ok);
  encoder.abm = 1;
  run(ms(50));
  EXPECT_TRUE(read().usable());
}

TEST_F(AxisTrust, TheLoopSeesLinkAndLatchedAlarms) {
  begin_running();
  EXPECT_EQ(axis->client().view().link, LinkState::good);
  encoder.sf = 0x10;
  encoder.almc = 0x04;  // counting error
  run(ms(2));
  encoder.sf = 0;
  encoder.almc = 0;
  run(ms(2));
  (void)read();
  EXPECT_EQ(axis->client().view().alarm, AlarmLevel::fault);
  EXPECT_TRUE(axis->client().view().alarms.has(StatusBit::counting_error));
}

}  // namespace
}  // namespace tm485
