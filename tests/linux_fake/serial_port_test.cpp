// SerialPort on drivers that refuse, lie, count faults, and vanish.
#include "tm485/linux/serial_port.hpp"

#include <gmock/gmock.h>
#include <linux/serial.h>
#include <sys/ioctl.h>

#include <array>
#include <cerrno>
#include <fstream>

#include "linux_fake/fake_kernel.hpp"
#include "linux_fake/fake_tty.hpp"
#include "support/fake_sysfs.hpp"

namespace tm485::linux_hal {
namespace {

using fake::FakeKernel;
using fake::FakeTty;
using std::chrono::milliseconds;
using test::FakeSysfs;
using ::testing::HasSubstr;

constexpr std::array<std::uint8_t, 4> kFour{0x32, 0x05, 0xA5, 0x92};

class SerialPortOnFake : public ::testing::Test {
 protected:
  SerialPortOnFake() { kernel_.add(path_, tty_); }
  ~SerialPortOnFake() override { EXPECT_EQ(kernel_.open_descriptors(), 0U) << "a descriptor leaks"; }

  [[nodiscard]] SerialOptions options() const {
    SerialOptions options;
    options.system = {system_.sys(), system_.dev()};
    return options;
  }
  [[nodiscard]] std::expected<SerialPort, OsError> open() { return SerialPort::open(path_, options()); }

  /// The error of an open that must fail and leave nothing behind: no descriptor, the old rate, no exclusive use.
  OsError refused(const SerialOptions& options) {
    const auto port = SerialPort::open(path_, options);
    EXPECT_FALSE(port);
    EXPECT_EQ(kernel_.open_descriptors(), 0U);
    EXPECT_FALSE(tty_.exclusive());
    return port ? OsError{} : port.error();
  }
  OsError refused() { return refused(options()); }

  FakeSysfs system_;
  FakeKernel kernel_;
  FakeTty tty_;
  std::string path_ = system_.dev("ttyUSB0");
};

TEST_F(SerialPortOnFake, SetsUpADriverThatTakesEverything) {
  {
    const auto port = open();
    ASSERT_TRUE(port) << port.error().message();
    EXPECT_EQ(port->achieved_rate(), 2'500'000U);
    EXPECT_EQ(tty_.rate(), 2'500'000U);
    EXPECT_TRUE(tty_.raw());
    EXPECT_TRUE(tty_.exclusive());
    EXPECT_TRUE(port->low_latency());
    EXPECT_TRUE(tty_.low_latency());
    EXPECT_EQ(kernel_.open_descriptors(), 1U);
  }
  EXPECT_EQ(tty_.rate(), 9'600U) << "put back";
  EXPECT_FALSE(tty_.raw());
}

TEST_F(SerialPortOnFake, ARateThatIsRefusedSilentlyIsFoundByReadingItBack) {
  tty_.accept_only({9'600, 115'200, 2'000'000});
  const OsError error = refused();
  EXPECT_EQ(error.name, "rate_refused");
  EXPECT_THAT(error.what, HasSubstr("9600"));
  EXPECT_EQ(tty_.rate(), 9'600U);
  tty_.rate_rule = [](std::uint32_t, std::uint32_t) { return 2'400'000U; };  // CP2102N
  EXPECT_THAT(refused().what, HasSubstr("2400000"));
  tty_.rate_rule = [](std::uint32_t, std::uint32_t) { return 2'526'316U; };  // FT232H
  EXPECT_TRUE(open());
}

TEST_F(SerialPortOnFake, EveryStepThatFailsKeepsItsErrnoAndLeavesNothing) {
  struct Step {
    unsigned long request;
    int error_number;
    const char* name;
  };
  // TCGETS2, TCSETS2: their numbers come from a header that this file cannot include.
  constexpr unsigned long kGetSettings = 0x802C542A;
  constexpr unsigned long kSetSettings = 0x402C542B;
  for (const Step& step :
       {Step{kGetSettings, ENOTTY, "TCGETS2"}, Step{kSetSettings, EINVAL, "TCSETS2"},
        Step{kSetSettings, EIO, "TCSETS2"}, Step{TIOCEXCL, EPERM, "TIOCEXCL"}, Step{TCFLSH, EIO, "TCFLSH"}}) {
    tty_.fail_ioctl(step.request, step.error_number);
    const OsError error = refused();
    EXPECT_EQ(error.error_number, step.error_number) << step.name;
    EXPECT_THAT(error.what, HasSubstr(step.name));
    EXPECT_FALSE(error.remedy.empty());
    EXPECT_EQ(tty_.rate(), 9'600U);
  }
  for (const int error_number : {EACCES, EBUSY, ENXIO, ENODEV, EIO, EMFILE}) {
    kernel_.fail_open(path_, error_number);
    EXPECT_EQ(refused().error_number, error_number);
  }
  EXPECT_TRUE(open());
}

TEST_F(SerialPortOnFake, ASecondProgramIsToldThatThePortIsBusy) {
  const auto first = open();
  ASSERT_TRUE(first);
  const auto second = open();
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().error_number, EBUSY);
  EXPECT_EQ(tty_.rate(), 2'500'000U) << "the first one's settings";
  tty_.privileged = true;  // root gets past TIOCEXCL, but not past the lock
  const auto third = open();
  ASSERT_FALSE(third);
  EXPECT_EQ(third.error().error_number, EBUSY);
  EXPECT_EQ(kernel_.open_descriptors(), 1U);
}

TEST_F(SerialPortOnFake, SignalsDuringOpeningSendingAndReadingAreSurvived) {
  kernel_.fail_open(path_, EINTR, 3);
  auto port = open();
  ASSERT_TRUE(port) << port.error().message();
  tty_.fail_write(EINTR, 3);
  EXPECT_TRUE(port->try_send(kFour, Time{0}));
  EXPECT_EQ(tty_.written().size(), 4U);
  tty_.receive({1, 2});
  tty_.fail_read(EINTR, 3);
  std::array<std::uint8_t, 8> buffer{};
  EXPECT_EQ(port->try_receive(buffer, Time{0}).count, 2U);
}

TEST_F(SerialPortOnFake, SignalsWithoutEndDoNotHoldItUp) {
  kernel_.fail_open(path_, EINTR, 1'000'000);
  EXPECT_EQ(refused().error_number, EINTR);
  kernel_.fail_open(path_, 0, 0);
  auto port = open();
  ASSERT_TRUE(port);
  tty_.fail_write(EINTR, 1'000'000);
  const int writes = tty_.writes();
  EXPECT_EQ(port->try_send(kFour, Time{0}), std::unexpected(Errc::send_failed));
  EXPECT_LE(tty_.writes() - writes, StreamPort::kSendAttempts);
  tty_.fail_read(EINTR, 1'000'000);
  std::array<std::uint8_t, 8> buffer{};
  const Reception nothing = port->try_receive(buffer, Time{0});
  EXPECT_EQ(nothing.count, 0U);
  EXPECT_EQ(nothing.fault, Errc::ok);
}

TEST_F(SerialPortOnFake, ShortWritesAreCompletedAndAFullBufferFails) {
  auto port = open();
  ASSERT_TRUE(port);
  tty_.write_limit = 1;
  EXPECT_TRUE(port->try_send(kFour, Time{0}));
  EXPECT_EQ(tty_.written(), std::vector<std::uint8_t>(kFour.begin(), kFour.end()));
  tty_.write_limit = 0;
  EXPECT_EQ(port->try_send(kFour, Time{0}), std::unexpected(Errc::send_failed));
  EXPECT_EQ(port->last_errno(), EAGAIN);
}

TEST_F(SerialPortOnFake, IsSentWhenTheTransmitterIsEmptyNotWhenTheBytesAreTaken) {
  auto port = open();
  ASSERT_TRUE(port);
  tty_.outq_polls = 3;
  tty_.lsr_polls = 1;
  ASSERT_TRUE(port->try_send(kFour, Time{0}));
  const int calls = tty_.calls();
  EXPECT_EQ(port->transmission(Time{15'999}).state, Transmission::State::sending);
  EXPECT_LE(tty_.calls(), calls + 2);
  for (int i = 0; i < 3; ++i)
    EXPECT_EQ(port->transmission(Time{16'000}).state, Transmission::State::sending) << i;
  EXPECT_EQ(port->transmission(Time{16'000}).state, Transmission::State::sent);
}

TEST_F(SerialPortOnFake, AnUnpluggedOneIsGoneForReadingSendingAndTheTransmitter) {
  std::array<std::uint8_t, 8> buffer{};
  for (const bool hung_up : {true, false}) {
    FakeTty tty;
    kernel_.add(path_, tty);
    auto reading = open();
    ASSERT_TRUE(reading);
    ASSERT_TRUE(reading->try_send(kFour, Time{0}));
    hung_up ? tty.unplug() : tty.break_down();
    EXPECT_EQ(reading->transmission(Time{16'000}).fault, Errc::port_gone);
    EXPECT_TRUE(reading->gone());
    const int calls = tty.calls();
    EXPECT_EQ(reading->try_receive(buffer, Time{0}).fault, Errc::port_gone);
    EXPECT_EQ(reading->try_send(kFour, Time{0}), std::unexpected(Errc::port_gone));
    EXPECT_EQ(reading->line_fault(), Errc::ok);
    EXPECT_EQ(tty.calls(), calls) << "a port that is gone is left alone";
    EXPECT_EQ(reading->last_errno(), EIO);
  }
}

TEST_F(SerialPortOnFake, FaultsOfTheLineAreCountedAndNamed) {
  auto port = open();
  ASSERT_TRUE(port);
  EXPECT_EQ(port->line_fault(), Errc::ok);
  ++tty_.counters.frame;
  EXPECT_EQ(port->line_fault(), Errc::framing_error);
  EXPECT_EQ(port->line_fault(), Errc::ok) << "told once";
  ++tty_.counters.brk;
  EXPECT_EQ(port->line_fault(), Errc::framing_error);
  ++tty_.counters.parity;
  EXPECT_EQ(port->line_fault(), Errc::framing_error);
  ++tty_.counters.overrun;
  ++tty_.counters.frame;
  EXPECT_EQ(port->line_fault(), Errc::overrun) << "lost characters explain more";
  ++tty_.counters.buf_overrun;
  EXPECT_EQ(port->line_fault(), Errc::overrun);
  const auto total = port->line_counters();
  ASSERT_TRUE(total);
  EXPECT_EQ(*total, (LineCounters{1, 1, 2, 1, 1}));
}

TEST_F(SerialPortOnFake, CountersOfBeforeAreNotThisPortsAndMayWrap) {
  tty_.counters.frame = INT32_MAX;
  auto port = open();
  ASSERT_TRUE(port);
  EXPECT_EQ(port->line_counters(), LineCounters{});
  tty_.counters.frame = INT32_MIN;
  EXPECT_EQ(port->line_counters()->framing_errors, 1U);
}

TEST_F(SerialPortOnFake, ADriverThatDoesNotCountIsAskedOnce) {
  tty_.has_icount = false;
  auto port = open();
  ASSERT_TRUE(port);
  EXPECT_EQ(port->line_counters(), std::unexpected(ENOTTY));
  EXPECT_EQ(port->line_fault(), Errc::ok);
  EXPECT_EQ(tty_.ioctls(TIOCGICOUNT), 1);
}

TEST_F(SerialPortOnFake, NobodyCountsWhileAllIsWell) {
  auto port = open();
  ASSERT_TRUE(port);
  const int before = tty_.ioctls(TIOCGICOUNT);
  std::array<std::uint8_t, 8> buffer{};
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(port->try_send(kFour, Time{0}));
    tty_.receive({1, 2, 3});
    (void)port->try_receive(buffer, Time{0});
    (void)port->try_receive(buffer, Time{0});
  }
  EXPECT_EQ(tty_.ioctls(TIOCGICOUNT), before);
}

TEST_F(SerialPortOnFake, TheLatencyTimerIsSetAndReadBack) {
  system_.add_usb("ttyUSB0", {"0403", "6014", "0900", "ftdi_sio", "480", "A1", "C232HM", "16"});
  const auto port = open();
  ASSERT_TRUE(port) << port.error().message();
  EXPECT_EQ(port->latency_timer().state, LatencyTimer::State::set);
  EXPECT_EQ(port->latency_timer().milliseconds, 1U);
  EXPECT_TRUE(port->latency_timer().remedy().empty());
  std::string text;
  std::ifstream(system_.latency_timer("ttyUSB0")) >> text;
  EXPECT_EQ(text, "1");
  EXPECT_EQ(port->capability().shortest_exchange, milliseconds(1));
  EXPECT_EQ(port->capability().latency_allowance, milliseconds(21));
  EXPECT_EQ(port->capability().timing, TimingClass::best_effort);
}

TEST_F(SerialPortOnFake, ALatencyTimerThatMayNotBeSetIsReportedAndCostsItsTime) {
  system_.add_usb("ttyUSB0", {"0403", "6014", "0900", "ftdi_sio", "480", "A1", "C232HM", "16"});
  kernel_.fail_open(system_.latency_timer("ttyUSB0"), EACCES);
  const auto port = open();
  ASSERT_TRUE(port);
  EXPECT_EQ(port->latency_timer().state, LatencyTimer::State::refused);
  EXPECT_EQ(port->latency_timer().error_number, EACCES);
  EXPECT_EQ(port->latency_timer().milliseconds, 16U);
  EXPECT_THAT(std::string(port->latency_timer().remedy()), HasSubstr("udev"));
  EXPECT_EQ(port->capability().shortest_exchange, milliseconds(16));
}

TEST_F(SerialPortOnFake, OtherChipsHaveNoLatencyTimer) {
  system_.add_usb("ttyUSB0", {"1a86", "55d3", "0445", "cdc_acm"});
  const auto port = open();
  ASSERT_TRUE(port);
  EXPECT_EQ(port->latency_timer().state, LatencyTimer::State::absent);
  EXPECT_EQ(port->capability().shortest_exchange, std::chrono::microseconds(250));
}

TEST_F(SerialPortOnFake, AChipThatCannotIsRefusedByNameThoughItsDriverRepeatsTheWish) {
  system_.add_usb("ttyUSB0", {"0403", "6001", "0600", "ftdi_sio"});
  const OsError error = refused();
  EXPECT_EQ(error.name, "chip_unfit");
  EXPECT_THAT(error.what, HasSubstr("FT232R"));
  EXPECT_THAT(error.what, HasSubstr("2000000"));
  EXPECT_THAT(error.remedy, HasSubstr("FT232H"));
  SerialOptions all_the_same = options();
  all_the_same.refuse_unfit_chip = false;
  EXPECT_TRUE(SerialPort::open(path_, all_the_same));
  SerialOptions slower = options();
  slower.bit_rate = 2'000'000;
  EXPECT_TRUE(SerialPort::open(path_, slower));
}

}  // namespace
}  // namespace tm485::linux_hal
