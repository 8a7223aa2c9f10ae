// SerialPort on real kernel objects: a pseudo-terminal, and things that are no serial port.
#include "tm485/linux/serial_port.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <fstream>
#include <vector>

#include "pseudo_terminal.hpp"
#include "tm485/linux/clock.hpp"

namespace tm485::linux_hal {
namespace {

using test::KernelSettings;
using test::PseudoTerminal;
using test::TemporaryFolder;
using ::testing::HasSubstr;

constexpr std::array<std::uint8_t, 4> kFour{0x32, 0x05, 0xA5, 0x92};

SerialPort open_port(const PseudoTerminal& terminal, const SerialOptions& options = {}) {
  auto port = SerialPort::open(terminal.path(), options);
  if (!port) throw std::runtime_error(port.error().message());
  return std::move(*port);
}

/// Receives until `count` bytes are there or the port fails; two seconds at most.
std::vector<std::uint8_t> receive(SerialPort& port, std::size_t count) {
  const MonotonicClock clock;
  std::vector<std::uint8_t> bytes;
  std::array<std::uint8_t, 16> buffer{};
  while (bytes.size() < count && clock.now() < std::chrono::seconds(2)) {
    const Reception reception = port.try_receive(buffer, clock.now());
    if (reception.fault != Errc::ok) break;
    bytes.insert(bytes.end(), buffer.begin(), buffer.begin() + static_cast<std::ptrdiff_t>(reception.count));
  }
  return bytes;
}

/// The next reception that is not "nothing yet"; two seconds at most.
Reception next_event(SerialPort& port) {
  const MonotonicClock clock;
  std::array<std::uint8_t, 16> buffer{};
  Reception reception;
  while (reception.count == 0 && reception.fault == Errc::ok && clock.now() < std::chrono::seconds(2))
    reception = port.try_receive(buffer, clock.now());
  return reception;
}

TEST(RateAcceptable, IsTwoPercentWithItsEdges) {
  static_assert(rate_acceptable(2'500'000, 2'500'000));
  static_assert(rate_acceptable(2'500'000, 2'450'000));
  static_assert(rate_acceptable(2'500'000, 2'550'000));
  static_assert(!rate_acceptable(2'500'000, 2'449'999));
  static_assert(!rate_acceptable(2'500'000, 2'550'001));
  static_assert(!rate_acceptable(2'500'000, 9'600));
  static_assert(!rate_acceptable(2'500'000, 38'400));
  static_assert(!rate_acceptable(2'500'000, 2'000'000));
  static_assert(!rate_acceptable(2'500'000, 2'400'000));
  static_assert(!rate_acceptable(2'500'000, 0));
  static_assert(rate_acceptable(9'600, 9'408));
  static_assert(!rate_acceptable(9'600, 9'407));
  static_assert(!rate_acceptable(0, 0));
  static_assert(!rate_acceptable(0, 9'600));
  static_assert(!rate_acceptable(1, 4'294'967'295));
  static_assert(!rate_acceptable(4'294'967'295, 1));
}

TEST(RateRefused, NamesBothRatesAndARemedy) {
  const OsError error = rate_refused("/dev/ttyS0", 2'500'000, 9'600);
  EXPECT_EQ(error.code, Errc::bad_argument);
  EXPECT_EQ(error.error_number, 0);
  EXPECT_THAT(error.what, HasSubstr("/dev/ttyS0"));
  EXPECT_THAT(error.what, HasSubstr("2500000"));
  EXPECT_THAT(error.what, HasSubstr("9600"));
  EXPECT_THAT(error.remedy, HasSubstr("FT232H"));
}

TEST(SerialPort, SetsAnyRateAndReadsItBack) {
  const PseudoTerminal terminal;
  for (const std::uint32_t rate : {2'500'000U, 9'600U, 1'234'567U, 10'000'000U}) {
    const SerialPort port = open_port(terminal, {.bit_rate = rate});
    EXPECT_EQ(port.achieved_rate(), rate);
    const KernelSettings kernel = test::kernel_settings(port.descriptor());
    EXPECT_EQ(kernel.input_rate, rate);
    EXPECT_EQ(kernel.output_rate, rate);
    EXPECT_FALSE(kernel.canonical);
    EXPECT_FALSE(kernel.echo);
  }
}

TEST(SerialPort, StatesWhatAPseudoTerminalHolds) {
  const PseudoTerminal terminal;
  const SerialPort port = open_port(terminal);
  EXPECT_TRUE(port.is_pseudo_terminal());
  EXPECT_FALSE(port.low_latency());
  const PortCapability capability = port.capability();
  EXPECT_EQ(capability.shortest_exchange, Time{0});
  EXPECT_EQ(capability.jitter_margin, std::chrono::microseconds(20));
  EXPECT_EQ(capability.latency_allowance, std::chrono::milliseconds(50));
  EXPECT_FALSE(capability.wire_timestamps);
  EXPECT_EQ(capability.timing, TimingClass::best_effort);
}

TEST(SerialPort, TakesAStatedCapability) {
  const PseudoTerminal terminal;
  const SerialPort port = open_port(
      terminal, {.latency_allowance = std::chrono::milliseconds(3), .shortest_exchange = Time{70'000}});
  EXPECT_EQ(port.capability().latency_allowance, std::chrono::milliseconds(3));
  EXPECT_EQ(port.capability().shortest_exchange, Time{70'000});
}

TEST(SerialPort, RefusesImpossibleOptions) {
  const PseudoTerminal terminal;
  for (const SerialOptions& options :
       {SerialOptions{.bit_rate = 0}, SerialOptions{.latency_allowance = Time{-1}},
        SerialOptions{.shortest_exchange = Time{-1}}}) {
    const auto port = SerialPort::open(terminal.path(), options);
    ASSERT_FALSE(port);
    EXPECT_EQ(port.error().code, Errc::bad_argument);
    EXPECT_EQ(port.error().error_number, EINVAL);
  }
}

TEST(SerialPort, AMissingPathIsPortGone) {
  const auto port = SerialPort::open("/dev/ttyNothingHere0");
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, Errc::port_gone);
  EXPECT_EQ(port.error().error_number, ENOENT);
  EXPECT_THAT(port.error().remedy, HasSubstr("plugged in"));
}

TEST(SerialPort, WhatIsNoTerminalIsRefused) {
  const TemporaryFolder folder;
  std::ofstream(folder / "file") << "not a port";
  for (const std::string& path : {std::string("/dev/null"), folder / "file"}) {
    const auto port = SerialPort::open(path);
    ASSERT_FALSE(port) << path;
    EXPECT_EQ(port.error().code, Errc::bad_argument);
    EXPECT_EQ(port.error().error_number, ENOTTY);
    EXPECT_THAT(port.error().remedy, HasSubstr("not a serial port"));
  }
  const auto port = SerialPort::open("/dev");
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().error_number, EISDIR);
}

TEST(SerialPort, AForbiddenPathNamesTheGroup) {
  const TemporaryFolder folder;
  std::ofstream(folder / "file") << "x";
  ASSERT_EQ(chmod((folder / "file").c_str(), 0), 0);
  // Nothing is forbidden to root, so be somebody else for the moment.
  const uid_t before = geteuid();
  if (before == 0 && seteuid(65'534) != 0) GTEST_SKIP() << "root, and cannot become another user";
  const auto port = SerialPort::open(folder / "file");
  ASSERT_EQ(seteuid(before), 0);
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, Errc::bad_argument);
  EXPECT_EQ(port.error().error_number, EACCES);
  EXPECT_THAT(port.error().remedy, HasSubstr("dialout"));
}

TEST(SerialPort, IsExclusiveAlsoForRoot) {
  const PseudoTerminal terminal;
  {
    const SerialPort port = open_port(terminal);
    const auto second = SerialPort::open(terminal.path());
    ASSERT_FALSE(second);
    EXPECT_EQ(second.error().code, Errc::bad_argument);
    EXPECT_EQ(second.error().error_number, EBUSY);
    EXPECT_THAT(second.error().remedy, HasSubstr("another program"));
    EXPECT_TRUE(SerialPort::open(terminal.path(), {.exclusive = false}));
  }
  EXPECT_TRUE(SerialPort::open(terminal.path()));
}

TEST(SerialPort, ARefusedSecondOpenLeavesTheFirstAlone) {
  PseudoTerminal terminal;
  SerialPort port = open_port(terminal);
  ASSERT_FALSE(SerialPort::open(terminal.path()));
  EXPECT_FALSE(test::kernel_settings(port.descriptor()).canonical);
  terminal.write({0x0A, 0x0D});
  EXPECT_EQ(receive(port, 2), (std::vector<std::uint8_t>{0x0A, 0x0D}));
}

TEST(SerialPort, PutsTheSettingsBackWhenItCloses) {
  const PseudoTerminal terminal;
  const posix::FileDescriptor watcher(::open(terminal.path().c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK));
  ASSERT_TRUE(watcher.valid());
  const KernelSettings before = test::kernel_settings(watcher.get());
  ASSERT_TRUE(before.canonical);
  {
    const SerialPort port = open_port(terminal);
    EXPECT_FALSE(test::kernel_settings(watcher.get()).canonical);
  }
  const KernelSettings after = test::kernel_settings(watcher.get());
  EXPECT_TRUE(after.canonical);
  EXPECT_EQ(after.echo, before.echo);
  EXPECT_EQ(after.output_rate, before.output_rate);
}

TEST(SerialPort, EveryByteValuePassesBothWays) {
  PseudoTerminal terminal;
  SerialPort port = open_port(terminal);
  std::vector<std::uint8_t> all(256);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::uint8_t>(i);
  for (std::size_t i = 0; i < all.size(); i += 4)
    ASSERT_TRUE(port.try_send(std::span(all).subspan(i, 4), Time{0}));
  EXPECT_EQ(terminal.read(all.size()), all);
  terminal.write(all);
  EXPECT_EQ(receive(port, all.size()), all);
}

TEST(SerialPort, WhatCameBeforeItOpenedIsDropped) {
  PseudoTerminal terminal;
  const posix::FileDescriptor holder(::open(terminal.path().c_str(), O_RDWR | O_NOCTTY | O_NONBLOCK));
  terminal.write({'o', 'l', 'd', '\n'});
  SerialPort port = open_port(terminal);
  terminal.drain();  // the terminal has echoed the line before it was raw
  terminal.write({0x5A});
  EXPECT_EQ(receive(port, 1), (std::vector<std::uint8_t>{0x5A}));
}

TEST(SerialPort, ReportsWhenARequestIsSent) {
  PseudoTerminal terminal;
  SerialPort port = open_port(terminal);
  EXPECT_EQ(port.transmission(Time{0}).state, Transmission::State::idle);
  ASSERT_EQ(port.try_send(kFour, Time{1'000}), Time{1'000});
  EXPECT_EQ(port.transmission(Time{16'999}).state, Transmission::State::sending);
  EXPECT_EQ(terminal.read(4).size(), 4U);
  EXPECT_EQ(port.transmission(Time{17'000}).state, Transmission::State::sent);
}

TEST(SerialPort, TheOtherEndClosingIsPortGoneForReading) {
  PseudoTerminal terminal;
  SerialPort port = open_port(terminal);
  terminal.close();
  EXPECT_EQ(next_event(port).fault, Errc::port_gone);
  EXPECT_EQ(port.try_send(kFour, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_EQ(port.transmission(Time{0}).fault, Errc::port_gone);
}

TEST(SerialPort, TheOtherEndClosingIsPortGoneForSending) {
  PseudoTerminal terminal;
  SerialPort port = open_port(terminal);
  terminal.close();
  EXPECT_EQ(port.try_send(kFour, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_EQ(port.last_errno(), EIO);
  EXPECT_EQ(next_event(port).fault, Errc::port_gone);
}

TEST(SerialPort, TheOtherEndClosingDuringARequestFailsIt) {
  PseudoTerminal terminal;
  SerialPort port = open_port(terminal);
  ASSERT_TRUE(port.try_send(kFour, Time{0}));
  terminal.close();
  const Transmission transmission = port.transmission(Time{1'000'000});
  EXPECT_EQ(transmission.state, Transmission::State::failed);
  EXPECT_EQ(transmission.fault, Errc::port_gone);
}

TEST(SerialPort, AFullBufferFailsTheSendAndRecovers) {
  PseudoTerminal terminal;
  SerialPort port = open_port(terminal);
  std::expected<Time, Errc> result = Time{0};
  for (int i = 0; i < 1'000'000 && result; ++i) result = port.try_send(kFour, Time{0});
  ASSERT_EQ(result, std::unexpected(Errc::send_failed));
  EXPECT_EQ(port.transmission(Time{0}).fault, Errc::send_failed);
  EXPECT_GT(terminal.drain(), 0U);
  EXPECT_TRUE(port.try_send(kFour, Time{0}));
  EXPECT_EQ(terminal.read(4), std::vector<std::uint8_t>(kFour.begin(), kFour.end()));
}

TEST(SerialPort, MovesKeepThePortOpenAndCloseTheOneReplaced) {
  PseudoTerminal first;
  PseudoTerminal second;
  SerialPort port = open_port(first);
  SerialPort other = open_port(second);
  port = std::move(other);
  EXPECT_TRUE(SerialPort::open(first.path()));
  EXPECT_FALSE(SerialPort::open(second.path()));
  const SerialPort moved = std::move(port);
  EXPECT_GE(moved.descriptor(), 0);
  EXPECT_FALSE(SerialPort::open(second.path()));
}

TEST(SerialPort, LeaksNoDescriptor) {
  const PseudoTerminal terminal;
  const SerialPort held = open_port(terminal, {.exclusive = false});
  const std::size_t before = test::open_descriptors();
  for (int i = 0; i < 1000; ++i) {
    EXPECT_TRUE(SerialPort::open(terminal.path()));
    EXPECT_FALSE(SerialPort::open("/dev/null"));
    EXPECT_FALSE(SerialPort::open(terminal.path(), {.bit_rate = 0}));
  }
  EXPECT_EQ(test::open_descriptors(), before);
}

}  // namespace
}  // namespace tm485::linux_hal
