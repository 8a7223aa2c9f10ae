// DirectedPort in a time of the test's own: what is switched when, to the nanosecond.
#include "tm485/linux/directed_port.hpp"

#include <gmock/gmock.h>

#include <array>
#include <cerrno>
#include <limits>
#include <string>
#include <vector>

namespace tm485::linux_hal {
namespace {

using ::testing::ElementsAre;

constexpr std::array<std::uint8_t, 1> kOne{0x1A};
constexpr std::array<std::uint8_t, 4> kFour{0x32, 0x05, 0xA5, 0x92};
constexpr Time kForever{std::numeric_limits<std::int64_t>::max() / 4};

/// The world of one test: its time, its line, and the log of what happened.
struct World {
  Time time{1'000'000};
  Time tick{100};       ///< what a look at the clock takes
  Time empty_after{0};  ///< the transmitter is empty this long after the last stop bit
  Time sent_at{0};      ///< of the last request
  Time span{0};
  bool refuse = false;  ///< the port takes no request
  bool vanish = false;  ///< the port is gone
  int enable_error = 0;
  int release_error = 0;
  bool driver = false;
  bool broke_in = false;  ///< the driver was released with bytes still on the line
  std::vector<std::string> log;

  [[nodiscard]] bool empty() const { return time >= sent_at + span + empty_after; }
};

struct FakeClock {
  World* world;
  [[nodiscard]] Time now() const noexcept {
    world->time += world->tick;
    return world->time;
  }
};

struct FakeDirection {
  World* world;
  bool software = true;
  ReleaseBound bound{Time{100'000}, false, "a program"};

  [[nodiscard]] bool by_software() const noexcept { return software; }
  [[nodiscard]] DirectionKind kind() const noexcept { return DirectionKind::gpio; }
  [[nodiscard]] const ReleaseBound& release_bound() const noexcept { return bound; }
  [[nodiscard]] int enable() noexcept {
    world->log.emplace_back("on");
    if (world->enable_error != 0) return world->enable_error;
    world->driver = true;
    return 0;
  }
  [[nodiscard]] int release() noexcept {
    world->log.emplace_back("off");
    if (world->release_error != 0) return world->release_error;
    if (world->driver && world->span != Time{0} && !world->empty()) world->broke_in = true;
    world->driver = false;
    return 0;
  }
};

/// Keeps the contract of a port without switching anything.
struct FakePort {
  World* world;
  bool sending = false;
  [[nodiscard]] PortCapability capability() const noexcept { return {.timing = TimingClass::soft}; }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    world->log.emplace_back("write");
    if (world->vanish) return std::unexpected(Errc::port_gone);
    if (world->refuse) return std::unexpected(Errc::send_failed);
    sending = true;
    world->sent_at = world->time;
    world->span = Time{4'000} * static_cast<std::int64_t>(request.size());
    return now;
  }
  [[nodiscard]] Transmission transmission(Time) noexcept {
    if (world->vanish) return {Transmission::State::failed, Errc::port_gone};
    if (!sending) return {};
    if (!world->empty()) return {Transmission::State::sending, Errc::ok};
    return {Transmission::State::sent, Errc::ok};
  }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t>, Time) noexcept {
    return {.fault = world->vanish ? Errc::port_gone : Errc::ok};
  }
  [[nodiscard]] int descriptor() const noexcept { return -1; }
};

using TestPort = DirectedPort<FakePort, FakeDirection, FakeClock>;
static_assert(Port<TestPort>);

class DirectedPortTest : public ::testing::Test {
 protected:
  [[nodiscard]] TestPort make(const DirectedOptions& options = {}) {
    return TestPort(FakePort{&world_}, FakeDirection{&world_}, options, FakeClock{&world_});
  }
  World world_;
  std::array<std::uint8_t, 16> buffer_{};
};

TEST_F(DirectedPortTest, TheDriverIsOnBeforeTheBytesAndOffWhenTheTransmitterIsEmpty) {
  TestPort port = make();
  const auto start = port.try_send(kFour, Time{5'000});
  ASSERT_TRUE(start);
  EXPECT_EQ(*start, Time{5'100}) << "in the caller's time, when the bytes were written";
  EXPECT_THAT(world_.log, ElementsAre("on", "write", "off"));
  EXPECT_FALSE(world_.broke_in);
  EXPECT_FALSE(port.driving());
  EXPECT_EQ(port.transmission(Time{30'000}).state, Transmission::State::sent);
  EXPECT_EQ(port.release_times().count(), 1U);
  EXPECT_LE(port.release_times().maximum(), Time{500});
  EXPECT_GE(port.release_times().minimum(), Time{0});
  EXPECT_EQ(port.late_releases(), 0U);
}

TEST_F(DirectedPortTest, TrySendReturnsAfterTheReleaseAndNotLater) {
  TestPort port = make();
  const Time before = world_.time;
  ASSERT_TRUE(port.try_send(kOne, Time{0}));
  EXPECT_LT(world_.time - before, Time{4'000 + 1'000});
}

TEST_F(DirectedPortTest, ALateTransmitterIsWaitedForAndCountedAsLate) {
  world_.empty_after = Time{7'000};
  TestPort port = make();
  ASSERT_TRUE(port.try_send(kFour, Time{0}));
  EXPECT_FALSE(port.driving());
  EXPECT_FALSE(world_.broke_in);
  EXPECT_EQ(port.late_releases(), 1U);
  EXPECT_GE(port.release_times().maximum(), Time{7'000});
  ASSERT_TRUE(port.warning());
  EXPECT_THAT(*port.warning(), ::testing::HasSubstr("late in this run"));
}

TEST_F(DirectedPortTest, TheWaitIsBoundedAndTheNextCallReleases) {
  world_.empty_after = Time{300'000};
  TestPort port = make();
  const Time before = world_.time;
  ASSERT_TRUE(port.try_send(kFour, Time{0}));
  EXPECT_LE(world_.time - before, Time{16'000 + 50'000 + 1'000});
  EXPECT_TRUE(port.driving());
  EXPECT_EQ(port.transmission(Time{0}).state, Transmission::State::sending);
  EXPECT_EQ(port.try_receive(buffer_, Time{0}).fault, Errc::ok);
  EXPECT_TRUE(port.driving()) << "not empty yet";
  world_.time += Time{300'000};
  (void)port.try_receive(buffer_, Time{0});
  EXPECT_FALSE(port.driving());
  EXPECT_FALSE(world_.broke_in);
  EXPECT_EQ(port.transmission(Time{0}).state, Transmission::State::sent);
  EXPECT_EQ(port.late_releases(), 1U);
}

TEST_F(DirectedPortTest, ALongRequestIsNotWaitedForAtAll) {
  TestPort port = make({.bit_rate = 9'600});
  world_.empty_after = kForever;
  const Time before = world_.time;
  ASSERT_TRUE(port.try_send(kFour, Time{0}));
  EXPECT_LT(world_.time - before, Time{1'000});
  EXPECT_TRUE(port.driving());
}

TEST_F(DirectedPortTest, NothingIsSentWhileTheDriverIsStillOn) {
  world_.empty_after = Time{1'000'000};
  TestPort port = make();
  ASSERT_TRUE(port.try_send(kFour, Time{0}));
  EXPECT_EQ(port.try_send(kOne, Time{0}), std::unexpected(Errc::send_failed));
  EXPECT_THAT(world_.log, ElementsAre("on", "write"));
}

TEST_F(DirectedPortTest, ATransmitterThatIsNeverEmptyIsGivenUp) {
  world_.empty_after = kForever;
  TestPort port = make({.give_up = std::chrono::milliseconds(1)});
  ASSERT_TRUE(port.try_send(kFour, Time{0}));
  EXPECT_TRUE(port.driving());
  world_.time += Time{2'000'000};
  const Transmission given_up = port.transmission(Time{0});
  EXPECT_EQ(given_up.state, Transmission::State::failed);
  EXPECT_EQ(given_up.fault, Errc::send_failed);
  EXPECT_FALSE(world_.driver);
  EXPECT_EQ(port.release_times().count(), 0U) << "this was no release in time";
}

TEST_F(DirectedPortTest, ARefusedRequestReleasesAtOnce) {
  world_.refuse = true;
  TestPort port = make();
  EXPECT_EQ(port.try_send(kFour, Time{0}), std::unexpected(Errc::send_failed));
  EXPECT_THAT(world_.log, ElementsAre("on", "write", "off"));
  EXPECT_FALSE(world_.driver);
  EXPECT_EQ(port.transmission(Time{0}).state, Transmission::State::failed);
  EXPECT_EQ(port.release_times().count(), 0U);
}

TEST_F(DirectedPortTest, APortThatVanishesWhileSendingReleasesTheDriver) {
  world_.empty_after = Time{300'000};
  TestPort port = make();
  ASSERT_TRUE(port.try_send(kFour, Time{0}));
  ASSERT_TRUE(world_.driver);
  world_.vanish = true;
  EXPECT_EQ(port.try_receive(buffer_, Time{0}).fault, Errc::port_gone);
  EXPECT_FALSE(world_.driver);
  EXPECT_EQ(port.transmission(Time{0}).fault, Errc::port_gone);
}

TEST_F(DirectedPortTest, ADriverThatCannotBeEnabledSendsNothing) {
  world_.enable_error = EIO;
  TestPort port = make();
  EXPECT_EQ(port.try_send(kFour, Time{0}), std::unexpected(Errc::send_failed));
  EXPECT_THAT(world_.log, ElementsAre("on", "off"));
  EXPECT_EQ(port.last_direction_errno(), EIO);
  EXPECT_EQ(port.transmission(Time{0}).state, Transmission::State::failed);
}

TEST_F(DirectedPortTest, ALineThatIsGoneIsAPortThatIsGone) {
  world_.enable_error = ENODEV;
  world_.release_error = ENODEV;
  TestPort port = make();
  EXPECT_EQ(port.try_send(kFour, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_EQ(port.try_send(kFour, Time{0}), std::unexpected(Errc::port_gone));
}

TEST_F(DirectedPortTest, AReleaseThatFailsIsReportedAndTriedAgain) {
  world_.release_error = EIO;
  TestPort port = make();
  ASSERT_TRUE(port.try_send(kFour, Time{0}));
  EXPECT_TRUE(port.driving());
  EXPECT_EQ(port.transmission(Time{0}).state, Transmission::State::failed);
  EXPECT_EQ(port.try_send(kOne, Time{0}), std::unexpected(Errc::send_failed));
  EXPECT_EQ(std::ranges::count(world_.log, "write"), 1);
  world_.release_error = 0;
  EXPECT_TRUE(port.try_send(kOne, Time{0}));
  EXPECT_FALSE(world_.driver);
}

TEST_F(DirectedPortTest, WithoutSoftwareEverythingGoesStraightThrough) {
  TestPort port(FakePort{&world_}, FakeDirection{&world_, false, {}}, {}, FakeClock{&world_});
  EXPECT_EQ(port.try_send(kFour, Time{7}), Time{7});
  EXPECT_THAT(world_.log, ElementsAre("write"));
  EXPECT_EQ(port.transmission(Time{0}).state, Transmission::State::sending);
  EXPECT_EQ(port.capability().timing, TimingClass::soft);
  EXPECT_EQ(port.release_times().count(), 0U);
}

TEST_F(DirectedPortTest, ABoundBeyondTheLimitIsBestEffort) {
  const auto capability = [this](Time bound) {
    return TestPort(FakePort{&world_}, FakeDirection{&world_, true, {bound, false, "a program"}}, {},
                    FakeClock{&world_})
        .capability();
  };
  EXPECT_EQ(capability(Time{2'800}).timing, TimingClass::soft);
  EXPECT_EQ(capability(Time{2'801}).timing, TimingClass::best_effort);
  EXPECT_EQ(capability(Time{2'801}).release_bound, Time{2'801});
}

TEST_F(DirectedPortTest, TimesAreThoseOfTheCallerWhateverTheEpochOfItsClock) {
  for (const Time now : {Time{0}, Time{1'000'000'000'000}}) {
    TestPort port = make();
    const auto start = port.try_send(kOne, now);
    ASSERT_TRUE(start);
    EXPECT_EQ(*start - now, Time{100});
    EXPECT_LE(port.release_times().maximum(), Time{500});
  }
}

}  // namespace
}  // namespace tm485::linux_hal
