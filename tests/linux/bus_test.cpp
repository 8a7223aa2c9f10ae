// The whole bus over a pseudo-terminal in real time. The peer is not the simulator but two replies written
// down by hand, so that a mistake shared by core and simulator would show.
#include "tm485/bus/bus.hpp"

#include <gtest/gtest.h>
#include <poll.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <span>
#include <thread>

#include "pseudo_terminal.hpp"
#include "tm485/linux/clock.hpp"
#include "tm485/linux/serial_port.hpp"

namespace tm485::linux_hal {
namespace {

// ABS 012345h, ABM 000002h, ENID 11h; the last byte is the exclusive or of the others.
constexpr std::array<std::uint8_t, 11> kEverything{0x1A, 0x00, 0x45, 0x23, 0x01, 0x11,
                                                   0x02, 0x00, 0x00, 0x00, 0x6E};
constexpr std::array<std::uint8_t, 4> kEncoderId{0x92, 0x00, 0x11, 0x83};

/// Answers ID2 and ID3 until told to stop.
class Peer {
 public:
  explicit Peer(int fd) : thread_([this, fd] { run(fd); }) {}
  Peer(const Peer&) = delete;
  Peer& operator=(const Peer&) = delete;
  ~Peer() { stop(); }

  void stop() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
  }

 private:
  void run(int fd) const {
    pollfd waited{fd, POLLIN, 0};
    while (!stop_) {
      std::uint8_t request = 0;
      if (poll(&waited, 1, 10) <= 0 || ::read(fd, &request, 1) != 1) continue;
      if (request == kEverything[0]) answer(fd, kEverything);
      if (request == kEncoderId[0]) answer(fd, kEncoderId);
    }
  }

  static void answer(int fd, std::span<const std::uint8_t> reply) {
    EXPECT_EQ(::write(fd, reply.data(), reply.size()), static_cast<ssize_t>(reply.size()));
  }

  std::atomic<bool> stop_{false};
  std::thread thread_;
};

/// Polls until `done` or for ten seconds.
template <class Done>
void poll_until(Bus<SerialPort>& bus, const MonotonicClock& clock, Done done) {
  while (!done() && clock.now() < std::chrono::seconds(10)) {
    bus.poll(clock.now());
    std::this_thread::yield();
  }
}

TEST(BusOnSerialPort, StartsReadsAndNoticesThatThePortIsGone) {
  test::PseudoTerminal terminal;
  auto port = SerialPort::open(terminal.path());
  ASSERT_TRUE(port) << port.error().message();
  Peer peer(terminal.master());
  const auto profile = CompiledProfile::compile(*find_profile("tm485_17"));
  ASSERT_TRUE(profile);
  const MonotonicClock clock;
  BusConfig config;
  config.cycle = Cycle{DataId::everything, std::chrono::milliseconds(1)};
  Bus<SerialPort> bus(*port, *profile, config);
  ASSERT_TRUE(bus.start(clock.now()));

  poll_until(bus, clock, [&] { return bus.state() == BusState::running; });
  ASSERT_EQ(bus.state(), BusState::running);
  poll_until(bus, clock,
             [&] { return bus.statistics().good >= 50 && bus.latest().quality() == Quality::fresh; });
  ASSERT_GE(bus.statistics().good, 50U);
  const Sample& sample = bus.latest();
  EXPECT_EQ(sample.quality(), Quality::fresh);
  EXPECT_EQ(sample.single_turn(), 0x012345U);
  EXPECT_EQ(sample.turns(), 2);
  EXPECT_EQ(sample.enid(), 0x11);
  EXPECT_EQ(sample.position(), (std::int64_t{2} - 1) * 131'072 + 0x012345);

  peer.stop();
  terminal.close();
  const auto gone = [&] { return bus.statistics().errors[static_cast<std::size_t>(Errc::port_gone)]; };
  poll_until(bus, clock, [&] { return gone() != 0 && bus.state() == BusState::startup; });
  EXPECT_GT(gone(), 0U);
  EXPECT_EQ(bus.state(), BusState::startup);
  EXPECT_EQ(bus.latest().quality(), Quality::invalid);
}

TEST(BusOnSerialPort, ASilentLineIsATimeoutAndNeverASample) {
  test::PseudoTerminal terminal;
  auto port = SerialPort::open(terminal.path(), {.latency_allowance = std::chrono::milliseconds(1)});
  ASSERT_TRUE(port);
  const auto profile = CompiledProfile::compile(*find_profile("tm485_17"));
  ASSERT_TRUE(profile);
  const MonotonicClock clock;
  Bus<SerialPort> bus(*port, *profile, BusConfig{});
  // Without a period: the shortest that the port holds.
  ASSERT_TRUE(bus.start(clock.now()));
  const auto timeouts = [&] { return bus.statistics().errors[static_cast<std::size_t>(Errc::timeout)]; };
  poll_until(bus, clock, [&] { return timeouts() >= 10; });
  EXPECT_GE(timeouts(), 10U);
  EXPECT_EQ(bus.state(), BusState::startup);
  EXPECT_EQ(bus.latest().quality(), Quality::invalid);
}

}  // namespace
}  // namespace tm485::linux_hal
