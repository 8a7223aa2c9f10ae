// What InterruptUartPort does beyond the contract that tests/conformance holds it to: what does not obey, interrupts that
// come too late, faults and where they stand between the characters.
#include "tm485/mcu/interrupt_uart_port.hpp"

#include <gtest/gtest.h>

#include <array>
#include <optional>
#include <vector>

#include "mcu/interrupt_line.hpp"
#include "mcu/model_access.hpp"
#include "mcu/models/stm32_models.hpp"
#include "tm485/mcu/stm32_usart_v1.hpp"

namespace tm485::test {
namespace {

using Driver = mcu::Stm32UsartV1<ModelAccess<Stm32V1Model>>;
using State = Transmission::State;

constexpr auto kDivisor = *mcu::solve_baud(mcu::BaudFamily::stm32_over16, 100'000'000, 2'500'000);
constexpr std::array<std::uint8_t, 4> kRequest{0x32, 0x05, 0xA5, 0x92};
constexpr Time kLatency{300};

/// A driver pin that refuses on demand.
struct Pin {
  Stm32V1Model* model;
  const bool* refuses_on;
  const bool* refuses_off;
  bool operator()(bool on) noexcept {
    if (on ? *refuses_on : *refuses_off) return false;
    model->engine().set_driver(on);
    return true;
  }
};

class InterruptUartPortTest : public testing::Test {
 protected:
  using Direction = mcu::CallDirection<Pin>;
  using UnderTest = mcu::InterruptUartPort<Driver, Direction, LineTimer<Stm32V1Model>>;
  static_assert(Port<UnderTest>);

  void make(const mcu::InterruptPortConfig& config, bool judged = true) {
    model_.emplace(
        Stm32Config{.clock_hz = 100'000'000, .interrupts = true, .engine = {.judge_driver = judged}});
    line_.emplace(*model_, kLatency);
    port_.emplace(Driver(ModelAccess(*model_)), Direction{Pin{&*model_, &refuses_on_, &refuses_off_}}, config,
                  LineTimer(*line_));
    line_->on_interrupt = [this](Time now) { port_->on_interrupt(now); };
    line_->on_timer = [this](Time now) { port_->on_timer(now); };
    ASSERT_TRUE(port_->start(kDivisor));
    model_->engine().on_sent = [this](const LineCharacter& character) { sent_.push_back(character); };
  }
  void TearDown() override { EXPECT_EQ(model_->engine().complaints(), std::vector<std::string>{}); }
  Time at(std::int64_t ns) {
    line_->run_to(Time{ns});
    return Time{ns};
  }
  /// Characters one behind the other from `start` on.
  void arrive(std::int64_t start, std::vector<std::uint8_t> bytes, std::size_t broken = SIZE_MAX) {
    for (std::size_t i = 0; i < bytes.size(); ++i, start += 4'000)
      model_->engine().arrive({bytes[i], Time{start}, Time{start + 4'000}, i != broken});
  }
  Reception receive(std::int64_t ns) { return port_->try_receive(buffer_, at(ns)); }

  bool refuses_on_ = false;
  bool refuses_off_ = false;
  std::optional<Stm32V1Model> model_;
  std::optional<InterruptLine<Stm32V1Model>> line_;
  std::optional<UnderTest> port_;
  std::vector<LineCharacter> sent_;
  std::array<std::uint8_t, 16> buffer_{};
};

TEST_F(InterruptUartPortTest, TheTimerEndsTheLeadAndTransmissionCompleteTheRequest) {
  make({.driver_lead = Time{1'000}});
  EXPECT_EQ(port_->try_send(kRequest, at(10'000)), Time{11'000});
  EXPECT_TRUE(model_->engine().driver());
  (void)at(10'999);
  EXPECT_FALSE(model_->engine().transmitting());
  (void)at(11'000 + kLatency.count());
  EXPECT_TRUE(model_->engine().transmitting());
  // Nobody calls the port meanwhile.
  const std::int64_t end = 11'000 + kLatency.count() + 16'000;
  (void)at(end);
  EXPECT_TRUE(model_->engine().driver());
  (void)at(end + kLatency.count());
  EXPECT_FALSE(model_->engine().driver());
  EXPECT_EQ(port_->transmission(at(end + kLatency.count())).state, State::sent);
  EXPECT_EQ(port_->last_release(), kLatency);
  ASSERT_EQ(sent_.size(), 4U);
  for (std::size_t i = 1; i < sent_.size(); ++i) EXPECT_EQ(sent_[i].start, sent_[i - 1].end);
}

TEST_F(InterruptUartPortTest, TheCapabilityIsTheOwnersWithoutWireTimestamps) {
  make({.capability = {.latency_allowance = Time{7}, .wire_timestamps = true, .release_bound = Time{9}}});
  EXPECT_FALSE(port_->capability().wire_timestamps);
  EXPECT_EQ(port_->capability().latency_allowance, Time{7});
}

TEST_F(InterruptUartPortTest, RequestsOfTheWrongLengthAreRefused) {
  make({});
  const std::array<std::uint8_t, 5> five{};
  EXPECT_EQ(port_->try_send({}, at(0)), std::unexpected(Errc::send_failed));
  EXPECT_EQ(port_->try_send(five, at(0)), std::unexpected(Errc::send_failed));
  EXPECT_FALSE(model_->engine().driver());
}

TEST_F(InterruptUartPortTest, ADirectionThatDoesNotDriveFailsTheRequest) {
  make({});
  refuses_on_ = true;
  EXPECT_EQ(port_->try_send(kRequest, at(0)), std::unexpected(Errc::send_failed));
  EXPECT_EQ(port_->transmission(at(1'000)).state, State::failed);
  (void)at(50'000);
  EXPECT_TRUE(sent_.empty());
  refuses_on_ = false;
  EXPECT_TRUE(port_->try_send(kRequest, at(50'000)));
}

/// The model is not asked to judge a driver that could not be released.
TEST_F(InterruptUartPortTest, ADirectionThatReleasesLateIsAskedAgainByTheOwner) {
  make({.stuck_after = Time{100'000}});
  ASSERT_TRUE(port_->try_send(kRequest, at(0)));
  refuses_off_ = true;
  EXPECT_EQ(port_->transmission(at(16'500)).state, State::sending);
  refuses_off_ = false;
  EXPECT_EQ(port_->transmission(at(17'000)).state, State::sent);
  EXPECT_FALSE(model_->engine().driver());
}

TEST_F(InterruptUartPortTest, AStuckTransmitterIsGivenUpInTimeAndFreesTheLine) {
  make({.stuck_after = Time{2'500}});
  model_->set_stuck(true);
  ASSERT_TRUE(port_->try_send(kRequest, at(0)));
  EXPECT_EQ(port_->transmission(at(18'499)).state, State::sending);
  EXPECT_EQ(port_->transmission(at(18'500)).state, State::failed);
  EXPECT_EQ(port_->transmission(at(18'500)).fault, Errc::send_failed);
  EXPECT_FALSE(model_->engine().driver());
  EXPECT_EQ(port_->try_send(kRequest, at(120'000)), std::unexpected(Errc::send_failed));
  model_->set_stuck(false);
  ASSERT_TRUE(port_->try_send(kRequest, at(130'000)));
  EXPECT_EQ(port_->transmission(at(146'500)).state, State::sent);
}

/// Interrupts that do not come at all. Nobody judges a driver whose release is then late.
TEST_F(InterruptUartPortTest, WithoutInterruptsARequestFailsInTime) {
  make({.stuck_after = Time{2'500}}, false);
  line_->set_latency(Time{1'000'000});
  ASSERT_TRUE(port_->try_send(kRequest, at(0)));
  EXPECT_EQ(port_->transmission(at(18'499)).state, State::sending);
  EXPECT_EQ(port_->transmission(at(18'500)).state, State::failed);
  line_->set_latency(kLatency);
  (void)at(30'000);
  EXPECT_EQ(sent_.size(), 1U) << "what was given up must not be sent later";
  ASSERT_TRUE(port_->try_send(kRequest, at(40'000)));
  EXPECT_EQ(port_->transmission(at(57'000)).state, State::sent);
  EXPECT_EQ(sent_.size(), 5U);
}

TEST_F(InterruptUartPortTest, AFramingErrorStandsAtItsCharacter) {
  make({});
  arrive(0, {1, 2, 3, 4}, 1);
  const Reception first = receive(20'000);
  EXPECT_EQ(first.count, 2U);
  EXPECT_EQ(first.fault, Errc::framing_error);
  const Reception rest = receive(20'000);
  EXPECT_EQ(rest.count, 2U);
  EXPECT_EQ(rest.fault, Errc::ok);
  EXPECT_EQ(buffer_[0], 3U);
}

/// Two characters have room, the others are lost while the interrupt is late.
TEST_F(InterruptUartPortTest, AnInterruptThatIsLateByCharactersIsAnOverrunThatPasses) {
  make({});
  line_->set_latency(Time{14'000});
  arrive(0, {1, 2, 3, 4, 5, 6});
  const Reception late = receive(60'000);
  EXPECT_EQ(late.fault, Errc::overrun);
  EXPECT_GE(late.count, 1U);
  EXPECT_EQ(buffer_[0], 1U);
  while (receive(60'000).count != 0) {
  }
  line_->set_latency(kLatency);
  arrive(100'000, {7, 8, 9});
  const Reception next = receive(120'000);
  EXPECT_EQ(next.count, 3U);
  EXPECT_EQ(next.fault, Errc::ok);
  EXPECT_EQ(buffer_[0], 7U);
}

TEST_F(InterruptUartPortTest, AnOwnerThatIsLateByARingIsAnOverrunThatPasses) {
  make({});
  std::vector<std::uint8_t> flood(20);
  for (std::size_t i = 0; i < flood.size(); ++i) flood[i] = static_cast<std::uint8_t>(i);
  arrive(0, flood);
  const Reception first = receive(100'000);
  EXPECT_EQ(first.count, 16U);
  EXPECT_EQ(first.fault, Errc::overrun);
  EXPECT_EQ(buffer_[15], 15U);
  arrive(110'000, {7});
  const Reception next = receive(120'000);
  EXPECT_EQ(next.count, 1U);
  EXPECT_EQ(next.fault, Errc::ok);
}

TEST_F(InterruptUartPortTest, AUartThatVanishesFreesTheLine) {
  make({});
  ASSERT_TRUE(port_->try_send(kRequest, at(0)));
  (void)at(15'000);
  model_->vanish();
  port_->on_interrupt(at(16'100));
  EXPECT_EQ(receive(16'200).fault, Errc::port_gone);
  EXPECT_FALSE(model_->engine().driver());
  EXPECT_EQ(port_->transmission(at(18'000)).fault, Errc::port_gone);
}

TEST_F(InterruptUartPortTest, StoppingFreesTheLineAndSilencesTheInterrupt) {
  make({});
  ASSERT_TRUE(port_->try_send(std::span(kRequest).first(1), at(0)));
  (void)at(4'000);
  port_->stop();
  EXPECT_FALSE(model_->engine().driver());
  arrive(10'000, {1, 2});
  const std::uint32_t before = line_->taken();
  EXPECT_EQ(port_->transmission(at(30'000)).state, State::idle);
  EXPECT_EQ(line_->taken(), before);
  ASSERT_TRUE(port_->start(kDivisor));
  EXPECT_TRUE(port_->try_send(kRequest, at(40'000)));
  EXPECT_EQ(port_->transmission(at(57'000)).state, State::sent);
}

TEST_F(InterruptUartPortTest, CallsWithoutCauseAreHarmless) {
  make({});
  for (int i = 0; i < 10; ++i) {
    port_->on_interrupt(at(i * 100));
    port_->on_timer(at(i * 100));
  }
  EXPECT_EQ(port_->transmission(at(2'000)).state, State::idle);
  ASSERT_TRUE(port_->try_send(kRequest, at(3'000)));
  for (int i = 0; i < 170; ++i) {
    port_->on_interrupt(at(3'000 + i * 100));
    port_->on_timer(at(3'000 + i * 100));
  }
  EXPECT_EQ(port_->transmission(at(20'000)).state, State::sent);
  EXPECT_EQ(sent_.size(), 4U);
}

}  // namespace
}  // namespace tm485::test
