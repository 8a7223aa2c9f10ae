// Direction control against fake drivers: TIOCSRS485 in all its moods, and a GPIO line around a tty.
#include "tm485/linux/rs485_direction.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/ioctl.h>
#include <termios.h>

#include <array>
#include <cerrno>

#include "gpio_fixture.hpp"
#include "linux_fake/fake_tty.hpp"
#include "tm485/linux/directed_port.hpp"
#include "tm485/linux/serial_port.hpp"
#include "tm485/linux/stream_port.hpp"

namespace tm485::linux_hal::fake {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr const char* kPath = "/dev/ttyFake0";
constexpr std::array<std::uint8_t, 4> kFour{0x32, 0x05, 0xA5, 0x92};
constexpr std::uint32_t kBitRate = 2'500'000;

/// Writes into the log when bytes are taken, and when the driver says for the first time that the transmitter is empty.
class LoggingTty : public FakeTty {
 public:
  explicit LoggingTty(EventLog& log) : log_(log) {}
  ssize_t on_write(int fd, std::span<const std::byte> bytes) override {
    const ssize_t count = FakeTty::on_write(fd, bytes);
    log_.push_back(count < 0 ? "write failed" : "write");
    told_ = false;
    return count;
  }
  int on_ioctl(int fd, unsigned long request, void* argument) override {
    const int result = FakeTty::on_ioctl(fd, request, argument);
    if (request == TIOCSERGETLSR && result == 0 && (*static_cast<const int*>(argument) & TIOCSER_TEMT) != 0 &&
        !told_) {
      log_.emplace_back("empty");
      told_ = true;
    }
    if (request == TCFLSH) log_.emplace_back("flush");
    return result;
  }

 private:
  EventLog& log_;
  bool told_ = true;
};

StreamPort open_stream() {
  const int fd = ::open(kPath, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  return {posix::FileDescriptor(fd), StreamKind::tty, kBitRate, {.timing = TimingClass::soft}};
}

class KernelDirectionTest : public ::testing::Test {
 protected:
  KernelDirectionTest() {
    tty_.has_rs485 = true;
    kernel_.add(kPath, tty_);
  }
  [[nodiscard]] static DirectionConfig config(bool low = false, bool mute = false) {
    DirectionConfig config;
    config.kind = DirectionKind::kernel;
    config.rts_low = low;
    config.mute = mute;
    return config;
  }
  [[nodiscard]] auto open(const StreamPort& port, bool low = false, bool mute = false) const {
    return Rs485Direction::open(config(low, mute), port.descriptor(), kPath);
  }
  void expect_refused(std::uint32_t mask, const std::string& what, const std::string& remedy) {
    tty_.rs485_mask = mask;
    const StreamPort port = open_stream();
    const auto direction = open(port);
    ASSERT_FALSE(direction);
    EXPECT_EQ(direction.error().code, Errc::bad_argument);
    EXPECT_EQ(direction.error().error_number, 0);
    EXPECT_THAT(direction.error().what, HasSubstr(what));
    EXPECT_THAT(direction.error().remedy, HasSubstr(remedy));
    EXPECT_EQ(tty_.rs485().flags & SER_RS485_ENABLED, 0U) << "the mode from before is back";
  }

  FakeKernel kernel_;
  FakeTty tty_;
};

TEST_F(KernelDirectionTest, SetsTheModeAndPutsItBack) {
  {
    const StreamPort port = open_stream();
    {
      const auto direction = open(port);
      ASSERT_TRUE(direction) << direction.error().message();
      EXPECT_EQ(tty_.rs485().flags,
                std::uint32_t{SER_RS485_ENABLED | SER_RS485_RTS_ON_SEND | SER_RS485_RX_DURING_TX});
      EXPECT_EQ(tty_.rs485().delay_rts_before_send, 0U);
      EXPECT_EQ(tty_.rs485().delay_rts_after_send, 0U);
      EXPECT_FALSE(direction->by_software());
      EXPECT_THAT(direction->description(), HasSubstr("kernel"));
    }
    EXPECT_EQ(tty_.rs485().flags, 0U);
  }
  EXPECT_EQ(kernel_.open_descriptors(), 0U);
}

TEST_F(KernelDirectionTest, HasTheOtherPolarityAndTheMuteReceiver) {
  const StreamPort port = open_stream();
  const auto direction = open(port, true, true);
  ASSERT_TRUE(direction);
  EXPECT_EQ(tty_.rs485().flags, std::uint32_t{SER_RS485_ENABLED | SER_RS485_RTS_AFTER_SEND});
}

TEST_F(KernelDirectionTest, ADriverWithoutTheModeIsNamedWithWhatElseThereIs) {
  tty_.has_rs485 = false;
  const StreamPort port = open_stream();
  const auto direction = open(port);
  ASSERT_FALSE(direction);
  EXPECT_EQ(direction.error().error_number, ENOTTY);
  EXPECT_THAT(direction.error().what, HasSubstr(kPath));
  EXPECT_THAT(direction.error().remedy, HasSubstr("--direction gpio"));
}

TEST_F(KernelDirectionTest, ARefusedModeKeepsItsErrno) {
  tty_.fail_ioctl(TIOCSRS485, EINVAL);
  const StreamPort port = open_stream();
  const auto direction = open(port);
  ASSERT_FALSE(direction);
  EXPECT_EQ(direction.error().error_number, EINVAL);
  EXPECT_THAT(direction.error().remedy, HasSubstr("device tree"));
}

TEST_F(KernelDirectionTest, FlagsThatTheDriverDropsAreNamed) {
  expect_refused(~std::uint32_t{SER_RS485_ENABLED}, "SER_RS485_ENABLED on", "only pretends");
  expect_refused(~std::uint32_t{SER_RS485_RTS_ON_SEND}, "SER_RS485_RTS_ON_SEND on", "kernel:low");
  expect_refused(~std::uint32_t{SER_RS485_RX_DURING_TX}, "SER_RS485_RX_DURING_TX on", "kernel:mute");
}

TEST_F(KernelDirectionTest, OfAnUnknownDriverNothingIsPromised) {
  StreamPort port = open_stream();
  auto direction = open(port);
  ASSERT_TRUE(direction);
  const DirectedPort<StreamPort> directed(std::move(port), std::move(*direction));
  EXPECT_EQ(directed.capability().timing, TimingClass::best_effort);
  EXPECT_TRUE(directed.warning());
}

TEST_F(KernelDirectionTest, ThePortGoesStraightThroughAndPutsTheModeBackBeforeItCloses) {
  StreamPort port = open_stream();
  auto direction = open(port);
  ASSERT_TRUE(direction);
  {
    DirectedPort<StreamPort> directed(std::move(port), std::move(*direction));
    ASSERT_TRUE(directed.try_send(kFour, Time{0}));
    EXPECT_EQ(directed.transmission(Time{16'000}).state, Transmission::State::sent);
    EXPECT_EQ(directed.release_times().count(), 0U);
    EXPECT_NE(tty_.rs485().flags & SER_RS485_ENABLED, 0U);
  }
  EXPECT_EQ(tty_.rs485().flags, 0U);
  EXPECT_EQ(kernel_.open_descriptors(), 0U);
}

TEST_F(KernelDirectionTest, MovingThePortKeepsTheMode) {
  StreamPort port = open_stream();
  auto direction = open(port);
  ASSERT_TRUE(direction);
  DirectedPort<StreamPort> first(std::move(port), std::move(*direction));
  DirectedPort<StreamPort> second(std::move(first));
  EXPECT_NE(tty_.rs485().flags & SER_RS485_ENABLED, 0U);
  StreamPort other = open_stream();
  second = DirectedPort<StreamPort>(std::move(other), Rs485Direction{});
  EXPECT_EQ(tty_.rs485().flags, 0U) << "before its descriptor is closed";
  EXPECT_EQ(kernel_.open_descriptors(), 1U);
}

class GpioDirectionTest : public GpioFixture {
 protected:
  GpioDirectionTest() { kernel_.add(kPath, tty_); }
  [[nodiscard]] std::expected<DirectedPort<StreamPort>, OsError> open_port(
      const DirectedOptions& directed = {}, bool low = false) {
    DirectionConfig config;
    config.kind = DirectionKind::gpio;
    config.gpio = {"gpiochip0", "3", low};
    StreamPort port = open_stream();
    auto direction = Rs485Direction::open(config, port.descriptor(), kPath, options());
    if (!direction) return std::unexpected(direction.error());
    log_.clear();
    return DirectedPort<StreamPort>(std::move(port), std::move(*direction), directed);
  }
  LoggingTty tty_{log_};
  std::array<std::uint8_t, 16> buffer_{};
};

TEST_F(GpioDirectionTest, TheLineIsOnBeforeTheFirstByteAndOffWhenTheTransmitterIsEmpty) {
  tty_.outq_polls = 3;
  tty_.lsr_polls = 5;
  auto port = open_port({.release_wait = std::chrono::seconds(10)});
  ASSERT_TRUE(port) << port.error().message();
  ASSERT_TRUE(port->try_send(kFour, Time{0}));
  EXPECT_THAT(log_, ElementsAre("line 3 high", "write", "empty", "line 3 low"));
  EXPECT_EQ(port->transmission(Time{0}).state, Transmission::State::sent);
  EXPECT_EQ(port->release_times().count(), 1U);
  EXPECT_EQ(port->capability().timing, TimingClass::best_effort);
  EXPECT_THAT(port->direction().description(), HasSubstr("line 3 of"));
}

TEST_F(GpioDirectionTest, AnActiveLowLineIsTheOtherWayRound) {
  auto port = open_port({.release_wait = std::chrono::seconds(10)}, true);
  ASSERT_TRUE(port);
  EXPECT_TRUE(chip_.line(3).high) << "inactive";
  ASSERT_TRUE(port->try_send(kFour, Time{0}));
  EXPECT_THAT(log_, ElementsAre("line 3 low", "write", "empty", "line 3 high"));
}

TEST_F(GpioDirectionTest, ATransmitterThatIsLateIsReleasedByALaterCall) {
  tty_.lsr_polls = 1'000'000'000;
  auto port = open_port();
  ASSERT_TRUE(port);
  ASSERT_TRUE(port->try_send(kFour, Time{0}));
  EXPECT_TRUE(chip_.line(3).high);
  EXPECT_EQ(port->transmission(Time{0}).state, Transmission::State::sending);
  EXPECT_THAT(log_, ElementsAre("line 3 high", "write"));
  tty_.end_of_sending();
  (void)port->try_receive(buffer_, Time{0});
  EXPECT_THAT(log_, ElementsAre("line 3 high", "write", "empty", "line 3 low"));
  EXPECT_EQ(port->transmission(Time{0}).state, Transmission::State::sent);
}

TEST_F(GpioDirectionTest, ATransmitterThatIsNeverEmptyIsGivenUpAndItsBytesAreDropped) {
  tty_.outq_polls = 1'000'000'000;
  auto port = open_port({.release_wait = Time{0}, .give_up = Time{0}});
  ASSERT_TRUE(port);
  ASSERT_TRUE(port->try_send(kFour, Time{0}));
  while (port->transmission(Time{0}).state == Transmission::State::sending) {
  }
  EXPECT_EQ(port->transmission(Time{0}).fault, Errc::send_failed);
  EXPECT_FALSE(chip_.line(3).high);
  EXPECT_EQ(tty_.ioctls(TCFLSH), 1);
}

TEST_F(GpioDirectionTest, ADriverThatCannotTellOfItsTransmitterIsGivenTheTimeOfTheRequestAgain) {
  tty_.has_lsr = false;
  tty_.outq_polls = 1;
  StreamPort port = open_stream();
  ASSERT_TRUE(port.try_send(kFour, Time{0}));
  EXPECT_EQ(port.transmission(Time{20'000}).state, Transmission::State::sending) << "a byte is in the buffer";
  EXPECT_EQ(port.transmission(Time{21'000}).state, Transmission::State::sending)
      << "and now in the transmitter";
  EXPECT_EQ(port.transmission(Time{36'999}).state, Transmission::State::sending);
  EXPECT_EQ(port.transmission(Time{37'000}).state, Transmission::State::sent);
}

TEST_F(GpioDirectionTest, AWriteThatFailsReleasesTheLine) {
  auto port = open_port();
  ASSERT_TRUE(port);
  tty_.write_limit = 0;
  EXPECT_EQ(port->try_send(kFour, Time{0}), std::unexpected(Errc::send_failed));
  EXPECT_THAT(log_, ElementsAre("line 3 high", "write failed", "flush", "line 3 low"));
}

TEST_F(GpioDirectionTest, ARequestOfWhichAPartWasTakenIsDroppedBeforeTheRelease) {
  tty_.take_no_more_after(2);
  auto port = open_port();
  ASSERT_TRUE(port);
  EXPECT_EQ(port->try_send(kFour, Time{0}), std::unexpected(Errc::send_failed));
  EXPECT_EQ(tty_.written().size(), 2U);
  ASSERT_GE(log_.size(), 3U);
  EXPECT_EQ(log_[log_.size() - 2], "flush") << "the bytes must not leave after the release";
  EXPECT_EQ(log_.back(), "line 3 low");
}

TEST_F(KernelDirectionTest, ARequestOfWhichAPartWasTakenIsDropped) {
  StreamPort port = open_stream();
  tty_.take_no_more_after(0);
  EXPECT_EQ(port.try_send(kFour, Time{0}), std::unexpected(Errc::send_failed));
  EXPECT_EQ(tty_.ioctls(TCFLSH), 0) << "there is nothing to drop";
  tty_.take_no_more_after(2);
  EXPECT_EQ(port.try_send(kFour, Time{0}), std::unexpected(Errc::send_failed));
  EXPECT_EQ(tty_.written().size(), 2U);
  EXPECT_EQ(tty_.ioctls(TCFLSH), 1);
}

TEST_F(GpioDirectionTest, APortThatIsUnpluggedWhileSendingReleasesTheLine) {
  tty_.lsr_polls = 1'000'000'000;
  auto port = open_port();
  ASSERT_TRUE(port);
  ASSERT_TRUE(port->try_send(kFour, Time{0}));
  ASSERT_TRUE(chip_.line(3).high);
  tty_.unplug();
  (void)port->try_receive(buffer_, Time{0});
  EXPECT_FALSE(chip_.line(3).high);
  EXPECT_EQ(port->transmission(Time{0}).fault, Errc::port_gone);
  EXPECT_EQ(port->try_send(kFour, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_FALSE(chip_.line(3).high);
}

TEST_F(GpioDirectionTest, AtItsEndTheLineIsInactiveAndEverythingIsClosed) {
  tty_.lsr_polls = 1'000'000'000;
  {
    auto port = open_port();
    ASSERT_TRUE(port);
    ASSERT_TRUE(port->try_send(kFour, Time{0}));
    ASSERT_TRUE(chip_.line(3).high);
  }
  EXPECT_FALSE(chip_.line(3).high);
  EXPECT_FALSE(chip_.line(3).used);
  EXPECT_EQ(kernel_.open_descriptors(), 0U);
}

/// The tty of the serial tests under its real port: what closes and comes back.
class ReopenTest : public GpioDirectionTest {
 protected:
  [[nodiscard]] std::expected<DirectedPort<SerialPort>, OsError> open_serial(DirectionKind kind) {
    DirectionConfig config;
    config.kind = kind;
    config.gpio = {"gpiochip0", "3", false};
    auto port = SerialPort::open(kPath, {.bit_rate = kBitRate});
    if (!port) return std::unexpected(port.error());
    auto direction = Rs485Direction::open(config, port->descriptor(), kPath, options());
    if (!direction) return std::unexpected(direction.error());
    return DirectedPort<SerialPort>(std::move(*port), std::move(*direction));
  }
};

TEST_F(ReopenTest, AfterUnpluggingTheNewDeviceGetsTheLine) {
  LoggingTty again(log_);
  auto port = open_serial(DirectionKind::gpio);
  ASSERT_TRUE(port) << port.error().message();
  tty_.unplug();
  EXPECT_EQ(port->try_send(kFour, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_TRUE(port->gone());
  EXPECT_FALSE(port->reopen()) << "it is still away";
  EXPECT_EQ(port->try_send(kFour, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_FALSE(chip_.line(3).used);
  kernel_.add(kPath, again);
  const auto opened = port->reopen();
  ASSERT_TRUE(opened) << opened.error().message();
  EXPECT_FALSE(port->gone());
  log_.clear();
  EXPECT_TRUE(port->try_send(kFour, Time{0}));
  EXPECT_EQ(again.written(), std::vector<std::uint8_t>(kFour.begin(), kFour.end()));
  EXPECT_EQ(log_.at(0), "line 3 high");
  EXPECT_EQ(chip_.line(3).requests, 2);
}

TEST_F(ReopenTest, AfterUnpluggingTheNewDeviceGetsTheMode) {
  LoggingTty again(log_);
  tty_.has_rs485 = true;
  auto port = open_serial(DirectionKind::kernel);
  ASSERT_TRUE(port) << port.error().message();
  tty_.unplug();
  again.has_rs485 = true;
  kernel_.add(kPath, again);
  ASSERT_TRUE(port->reopen());
  EXPECT_NE(again.rs485().flags & SER_RS485_ENABLED, 0U);
}

TEST_F(ReopenTest, NothingIsSentWithoutTheModeThatWasAskedFor) {
  LoggingTty without(log_);
  tty_.has_rs485 = true;
  auto port = open_serial(DirectionKind::kernel);
  ASSERT_TRUE(port) << port.error().message();
  tty_.unplug();
  kernel_.add(kPath, without);
  EXPECT_FALSE(port->reopen()) << "this driver has no such mode";
  EXPECT_TRUE(port->gone());
  EXPECT_EQ(port->try_send(kFour, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_TRUE(without.written().empty());
  EXPECT_EQ(port->try_receive(buffer_, Time{0}).fault, Errc::port_gone);
  EXPECT_EQ(kernel_.open_descriptors(), 0U) << "the device can be unplugged again";
  without.has_rs485 = true;
  ASSERT_TRUE(port->reopen());
  EXPECT_TRUE(port->try_send(kFour, Time{0}));
}

TEST_F(ReopenTest, ALineThatVanishesIsAPortThatIsGoneUntilItIsBack) {
  auto port = open_serial(DirectionKind::gpio);
  ASSERT_TRUE(port);
  chip_.set_error = ENODEV;
  EXPECT_EQ(port->try_send(kFour, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_TRUE(port->gone());
  kernel_.fail_open(folder_ + "gpiochip0", ENODEV);
  EXPECT_FALSE(port->reopen());
  EXPECT_TRUE(port->gone());
  EXPECT_EQ(port->try_send(kFour, Time{0}), std::unexpected(Errc::port_gone)) << "never without the driver";
  EXPECT_TRUE(tty_.written().empty());
  chip_.set_error = 0;
  EXPECT_TRUE(port->reopen());
  EXPECT_FALSE(port->gone());
  EXPECT_TRUE(port->try_send(kFour, Time{0}));
}

TEST_F(GpioDirectionTest, ALineInUseLeavesNothingOpen) {
  chip_.line(3).used = true;
  chip_.line(3).consumer = "fan";
  const auto port = open_port();
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().error_number, EBUSY);
  EXPECT_THAT(port.error().what, HasSubstr("used by 'fan'"));
  EXPECT_EQ(kernel_.open_descriptors(), 0U);
}

TEST_F(GpioDirectionTest, AThousandRequestsLeakNothing) {
  auto port = open_port();
  ASSERT_TRUE(port);
  const std::uint64_t opened = kernel_.opened();
  for (int i = 0; i < 1000; ++i) {
    ASSERT_TRUE(port->try_send(kFour, Time{0}));
    (void)port->transmission(Time{0});
    log_.clear();
    ASSERT_FALSE(chip_.line(3).high);
  }
  EXPECT_EQ(kernel_.opened(), opened);
  EXPECT_EQ(port->release_times().count(), 1000U);
}

}  // namespace
}  // namespace tm485::linux_hal::fake
