// What PolledUartPort does beyond the contract that tests/conformance holds it to: the lead, and what does not obey.
#include "tm485/mcu/polled_uart_port.hpp"

#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <vector>

#include "mcu/model_access.hpp"
#include "mcu/models/pl011_model.hpp"
#include "tm485/mcu/pl011.hpp"

namespace tm485::test {
namespace {

using Driver = mcu::Pl011<ModelAccess<Pl011Model>>;
using State = Transmission::State;

constexpr auto kDivisor = *mcu::solve_baud(mcu::BaudFamily::pl011, 50'000'000, 2'500'000);
constexpr std::array<std::uint8_t, 4> kRequest{0x32, 0x05, 0xA5, 0x92};

/// A driver pin that refuses on demand.
struct Pin {
  Pl011Model* model;
  const bool* refuses_on;
  const bool* refuses_off;
  bool operator()(bool on) noexcept {
    if (on ? *refuses_on : *refuses_off) return false;
    model->engine().set_driver(on);
    return true;
  }
};

class PolledUartPortTest : public testing::Test {
 protected:
  using Direction = mcu::CallDirection<Pin>;
  using UnderTest = mcu::PolledUartPort<Driver, Direction>;
  static_assert(Port<UnderTest>);

  void make(const mcu::PolledPortConfig& config) {
    model_.emplace(Pl011Config{.clock_hz = 50'000'000, .engine = {.judge_driver = true}});
    port_.emplace(Driver(ModelAccess(*model_)), Direction{Pin{&*model_, &refuses_on_, &refuses_off_}},
                  config);
    ASSERT_TRUE(port_->start(kDivisor));
    model_->engine().on_sent = [this](const LineCharacter& character) { sent_.push_back(character); };
  }
  Time at(std::int64_t ns) {
    model_->engine().advance_to(Time{ns});
    return Time{ns};
  }

  bool refuses_on_ = false;
  bool refuses_off_ = false;
  std::optional<Pl011Model> model_;
  std::optional<UnderTest> port_;
  std::vector<LineCharacter> sent_;
};

TEST_F(PolledUartPortTest, TheCapabilityIsTheOwnersWithoutWireTimestamps) {
  make({.capability = {.latency_allowance = Time{7}, .wire_timestamps = true, .release_bound = Time{9}}});
  EXPECT_FALSE(port_->capability().wire_timestamps);
  EXPECT_EQ(port_->capability().latency_allowance, Time{7});
  EXPECT_EQ(port_->capability().release_bound, Time{9});
}

TEST_F(PolledUartPortTest, TheLeadPassesBeforeTheFirstByte) {
  make({.driver_lead = Time{1'000}});
  EXPECT_EQ(port_->try_send(kRequest, at(10'000)), Time{11'000});
  EXPECT_TRUE(model_->engine().driver());
  (void)port_->transmission(at(10'999));
  EXPECT_FALSE(model_->engine().transmitting());
  (void)port_->transmission(at(11'000));
  EXPECT_TRUE(model_->engine().transmitting());
  EXPECT_EQ(port_->transmission(at(26'999)).state, State::sending);
  EXPECT_EQ(port_->transmission(at(27'000)).state, State::sent);
  EXPECT_FALSE(model_->engine().driver());
  EXPECT_EQ(sent_.size(), 4U);
}

TEST_F(PolledUartPortTest, AskingForBytesIsEnoughToReleaseTheDriver) {
  make({});
  ASSERT_TRUE(port_->try_send(kRequest, at(0)));
  std::array<std::uint8_t, 4> buffer{};
  (void)port_->try_receive(buffer, at(15'999));
  EXPECT_TRUE(model_->engine().driver());
  (void)port_->try_receive(buffer, at(16'700));
  EXPECT_FALSE(model_->engine().driver());
  EXPECT_EQ(port_->last_release(), Time{700});
}

TEST_F(PolledUartPortTest, RequestsOfTheWrongLengthAreRefused) {
  make({});
  const std::array<std::uint8_t, 5> five{};
  EXPECT_EQ(port_->try_send({}, at(0)), std::unexpected(Errc::send_failed));
  EXPECT_EQ(port_->try_send(five, at(0)), std::unexpected(Errc::send_failed));
  EXPECT_FALSE(model_->engine().driver());
}

TEST_F(PolledUartPortTest, ADirectionThatDoesNotDriveFailsTheRequest) {
  make({});
  refuses_on_ = true;
  EXPECT_EQ(port_->try_send(kRequest, at(0)), std::unexpected(Errc::send_failed));
  EXPECT_EQ(port_->transmission(at(1'000)).state, State::failed);
  (void)at(50'000);
  EXPECT_TRUE(sent_.empty());
  refuses_on_ = false;
  EXPECT_TRUE(port_->try_send(kRequest, at(50'000)));
}

TEST_F(PolledUartPortTest, ADirectionThatDoesNotReleaseIsNeverSent) {
  make({.stuck_after = Time{100'000}});
  ASSERT_TRUE(port_->try_send(kRequest, at(0)));
  refuses_off_ = true;
  EXPECT_EQ(port_->transmission(at(16'000)).state, State::sending);
  EXPECT_EQ(port_->transmission(at(115'999)).state, State::sending);
  const Transmission given_up = port_->transmission(at(116'000));
  EXPECT_EQ(given_up.state, State::failed);
  EXPECT_EQ(given_up.fault, Errc::send_failed);
  refuses_off_ = false;
}

TEST_F(PolledUartPortTest, ADriverThatStaysOnIsReleasedByALaterCall) {
  make({.stuck_after = Time{100'000}});
  std::array<std::uint8_t, 4> buffer{};
  ASSERT_TRUE(port_->try_send(kRequest, at(0)));
  refuses_off_ = true;
  ASSERT_EQ(port_->transmission(at(116'000)).state, State::failed);
  EXPECT_TRUE(model_->engine().driver());
  EXPECT_EQ(port_->try_send(kRequest, at(120'000)), std::unexpected(Errc::send_failed));
  refuses_off_ = false;
  (void)port_->try_receive(buffer, at(130'000));
  EXPECT_FALSE(model_->engine().driver());
  EXPECT_EQ(port_->transmission(at(131'000)).state, State::failed) << "the request was not sent in time";
  EXPECT_TRUE(port_->try_send(kRequest, at(140'000)));
}

TEST_F(PolledUartPortTest, ADriverThatStaysOnAfterTheUartIsReleasedByALaterCall) {
  make({});
  std::array<std::uint8_t, 4> buffer{};
  ASSERT_TRUE(port_->try_send(kRequest, at(0)));
  refuses_off_ = true;
  model_->vanish();
  EXPECT_EQ(port_->try_receive(buffer, at(1'000)).fault, Errc::port_gone);
  EXPECT_TRUE(model_->engine().driver());
  refuses_off_ = false;
  EXPECT_EQ(port_->try_send(kRequest, at(2'000)), std::unexpected(Errc::port_gone));
  EXPECT_FALSE(model_->engine().driver());
}

TEST_F(PolledUartPortTest, AStuckTransmitterIsGivenUpAndFreesTheLine) {
  make({.stuck_after = Time{100'000}});
  model_->set_stuck(true);
  ASSERT_TRUE(port_->try_send(kRequest, at(0)));
  EXPECT_EQ(port_->transmission(at(100'000)).state, State::sending);
  EXPECT_EQ(port_->transmission(at(116'000)).state, State::failed);
  EXPECT_FALSE(model_->engine().driver());
  EXPECT_EQ(port_->try_send(kRequest, at(120'000)), std::unexpected(Errc::send_failed));
  model_->set_stuck(false);
  ASSERT_TRUE(port_->try_send(kRequest, at(130'000)));
  EXPECT_EQ(port_->transmission(at(146'000)).state, State::sent);
}

TEST_F(PolledUartPortTest, AUartThatVanishesFreesTheLine) {
  make({});
  ASSERT_TRUE(port_->try_send(kRequest, at(0)));
  (void)at(16'000);
  model_->vanish();
  std::array<std::uint8_t, 4> buffer{};
  EXPECT_EQ(port_->try_receive(buffer, at(17'000)).fault, Errc::port_gone);
  EXPECT_FALSE(model_->engine().driver());
  EXPECT_EQ(port_->transmission(at(18'000)).fault, Errc::port_gone);
}

TEST_F(PolledUartPortTest, StoppingFreesTheLine) {
  make({});
  ASSERT_TRUE(port_->try_send(std::span(kRequest).first(1), at(0)));
  (void)at(4'000);
  port_->stop();
  EXPECT_FALSE(model_->engine().driver());
  EXPECT_EQ(port_->transmission(at(9'000)).state, State::idle);
  EXPECT_EQ(model_->control() & 1U, 0U);
  ASSERT_TRUE(port_->start(kDivisor));
  EXPECT_TRUE(port_->try_send(kRequest, at(20'000)));
}

}  // namespace
}  // namespace tm485::test
