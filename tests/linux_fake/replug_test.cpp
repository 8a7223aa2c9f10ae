// An adapter that is unplugged and comes back: the port alone, and a bus on it in a time of its own.
#include <gmock/gmock.h>

#include <array>
#include <chrono>
#include <memory>

#include "linux_fake/fake_kernel.hpp"
#include "linux_fake/fake_tty.hpp"
#include "support/fake_sysfs.hpp"
#include "support/frames.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/linux/reopener.hpp"
#include "tm485/linux/serial_port.hpp"

namespace tm485::linux_hal {
namespace {

using fake::FakeKernel;
using fake::FakeTty;
using std::chrono::milliseconds;
using test::FakeSysfs;
using ::testing::HasSubstr;

class Replug : public ::testing::Test {
 protected:
  Replug() { plug_in("ttyUSB0", "MINE"); }
  ~Replug() override {
    port_.reset();
    EXPECT_EQ(kernel_.open_descriptors(), 0U) << "a descriptor leaks";
  }

  FakeTty& plug_in(const std::string& name, const std::string& serial, const std::string& product = "6014",
                   const std::string& speed = "480") {
    system_.add_usb(name, {"0403", product, "0900", "ftdi_sio", speed, serial, "adapter", "1"});
    ttys_.push_back(std::make_unique<FakeTty>());
    ttys_.back()->responder = [](const std::vector<std::uint8_t>& request) -> std::vector<std::uint8_t> {
      if (request.at(0) == 0x92) return test::id2_reply(0x11);
      if (request.at(0) == 0x1A) return test::id3_reply(1'000, 2);
      return {};
    };
    kernel_.add(system_.dev(name), *ttys_.back());
    return *ttys_.back();
  }
  void pull_out(const std::string& name, const std::string& serial) {
    ttys_.back()->unplug();
    kernel_.remove(system_.dev(name));
    system_.remove(name, serial);
  }
  void open(const std::string& name = "ttyUSB0") {
    SerialOptions options;
    options.system = {system_.sys(), system_.dev()};
    auto port = SerialPort::open(system_.dev(name), options);
    ASSERT_TRUE(port) << port.error().message();
    port_.emplace(std::move(*port));
  }
  FakeTty& tty() { return *ttys_.back(); }

  FakeSysfs system_;
  FakeKernel kernel_;
  std::vector<std::unique_ptr<FakeTty>> ttys_;
  std::optional<SerialPort> port_;
};

TEST_F(Replug, IsFoundUnderAnotherNumberByItsStableName) {
  open();
  EXPECT_EQ(port_->reopen_path(), system_.by_id("MINE"));
  pull_out("ttyUSB0", "MINE");
  const auto absent = port_->reopen();
  ASSERT_FALSE(absent);
  EXPECT_EQ(absent.error().code, Errc::port_gone);
  EXPECT_EQ(absent.error().error_number, ENOENT);
  EXPECT_TRUE(port_->gone());
  EXPECT_EQ(kernel_.open_descriptors(), 0U) << "an open descriptor would keep the number busy";
  plug_in("ttyUSB0", "OTHER");  // another adapter takes the old number
  FakeTty& back = plug_in("ttyUSB1", "MINE");
  ASSERT_TRUE(port_->reopen());
  EXPECT_FALSE(port_->gone());
  EXPECT_EQ(port_->identity().name, "ttyUSB1");
  const std::array<std::uint8_t, 1> request{0x92};
  EXPECT_TRUE(port_->try_send(request, Time{0}));
  EXPECT_EQ(back.written().size(), 1U);
  EXPECT_EQ(port_->reopen_path(), system_.by_id("MINE")) << "and the next time";
}

TEST_F(Replug, APortThatIsGoneTouchesNothing) {
  open();
  port_->close();
  EXPECT_TRUE(port_->gone());
  EXPECT_EQ(kernel_.open_descriptors(), 0U);
  EXPECT_EQ(tty().rate(), 9'600U) << "put back";
  std::array<std::uint8_t, 8> buffer{1};
  EXPECT_EQ(port_->try_send(buffer, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_EQ(port_->try_receive(buffer, Time{0}).fault, Errc::port_gone);
  EXPECT_EQ(port_->transmission(Time{0}).fault, Errc::port_gone);
  EXPECT_FALSE(port_->line_counters());
  port_->close();
  EXPECT_EQ(kernel_.open_descriptors(), 0U);
}

TEST_F(Replug, ASlowerDeviceBehindTheSameNameIsRefused) {
  open();
  pull_out("ttyUSB0", "MINE");
  plug_in("ttyUSB0", "MINE");
  system_.remove("ttyUSB0", "MINE");
  system_.add_usb("ttyUSB0", {"0403", "6014", "0900", "ftdi_sio", "480", "MINE", "adapter", "16"});
  kernel_.fail_open(system_.latency_timer("ttyUSB0"), EACCES);
  const auto slower = port_->reopen();
  ASSERT_FALSE(slower);
  EXPECT_EQ(slower.error().name, "another_device");
  EXPECT_TRUE(port_->gone());
  EXPECT_EQ(kernel_.open_descriptors(), 0U);
  ASSERT_TRUE(port_->reopen()) << "once the timer can be set";
}

TEST_F(Replug, WithoutAStableNameThePathIsOpenedAgain) {
  system_.add_uart("ttyAMA0", "uart-pl011", 48'000'000);
  FakeTty uart;
  kernel_.add(system_.dev("ttyAMA0"), uart);
  open("ttyAMA0");
  EXPECT_EQ(port_->reopen_path(), system_.dev("ttyAMA0"));
  uart.break_down();
  ASSERT_FALSE(port_->reopen());
  FakeTty again;
  kernel_.add(system_.dev("ttyAMA0"), again);
  EXPECT_TRUE(port_->reopen());
  port_.reset();
}

class ReplugOnBus : public Replug {
 protected:
  ReplugOnBus() {
    open();
    profile_.emplace(test::compiled(test::preset("tm485_17")));
    BusConfig config;
    config.cycle = Cycle{DataId::everything, milliseconds(2)};
    config.max_hold = milliseconds(100);
    bus_.emplace(*port_, *profile_, config);
  }

  /// Polls every 50 us until `done`, for at most `limit`; collects what the reopener tells.
  template <class Done>
  bool run(Time limit, Done done) {
    const Time end = now_ + limit;
    while (now_ < end) {
      bus_->poll(now_);
      const Reopener::Event event = reopener_.tend(*port_, *bus_, now_);
      if (event != Reopener::Event::none) events_.push_back(event);
      if (done()) return true;
      now_ += std::chrono::microseconds(50);
    }
    return false;
  }
  bool run_until_running() {
    return run(std::chrono::seconds(5), [&] { return bus_->latest().quality() == Quality::fresh; });
  }
  [[nodiscard]] std::uint32_t errors(Errc code) const {
    return bus_->statistics().errors[static_cast<std::size_t>(code)];
  }

  std::optional<CompiledProfile> profile_;
  std::optional<Bus<SerialPort>> bus_;
  Reopener reopener_;
  Time now_{0};
  std::vector<Reopener::Event> events_;
};

TEST_F(ReplugOnBus, TheSampleIsHeldThenInvalidAndFreshAfterAStartUp) {
  ASSERT_TRUE(bus_->start(now_));
  ASSERT_TRUE(run_until_running());
  const std::uint32_t startups = bus_->statistics().startups;
  pull_out("ttyUSB0", "MINE");
  EXPECT_TRUE(run(milliseconds(50), [&] { return bus_->latest().quality() == Quality::held; }));
  EXPECT_TRUE(run(milliseconds(500), [&] { return bus_->latest().quality() == Quality::invalid; }));
  EXPECT_FALSE(run(std::chrono::seconds(3), [&] { return bus_->state() == BusState::running; }));
  EXPECT_GT(errors(Errc::port_gone), 0U);
  EXPECT_EQ(events_, std::vector{Reopener::Event::gone}) << "told once, not at every attempt";
  EXPECT_EQ(kernel_.open_descriptors(), 0U);

  plug_in("ttyUSB7", "MINE");
  ASSERT_TRUE(run_until_running());
  EXPECT_EQ(events_, (std::vector{Reopener::Event::gone, Reopener::Event::back}));
  EXPECT_EQ(bus_->statistics().startups, startups + 1);
  EXPECT_EQ(bus_->latest().single_turn(), 1'000U);
  EXPECT_EQ(reopener_.times(), 1U);
  EXPECT_EQ(kernel_.open_descriptors(), 1U);
}

TEST_F(ReplugOnBus, AHundredTimesWithoutALeak) {
  ASSERT_TRUE(bus_->start(now_));
  for (int i = 0; i < 100; ++i) {
    const std::string name = i % 2 == 0 ? "ttyUSB0" : "ttyUSB1";
    ASSERT_TRUE(run_until_running()) << i;
    pull_out(name, "MINE");
    ASSERT_TRUE(run(std::chrono::seconds(1), [&] { return bus_->state() == BusState::startup; })) << i;
    plug_in(i % 2 == 0 ? "ttyUSB1" : "ttyUSB0", "MINE");
  }
  EXPECT_TRUE(run_until_running());
  EXPECT_EQ(reopener_.times(), 100U);
  EXPECT_EQ(kernel_.open_descriptors(), 1U);
}

TEST_F(ReplugOnBus, AttemptsAreBounded) {
  ASSERT_TRUE(bus_->start(now_));
  ASSERT_TRUE(run_until_running());
  pull_out("ttyUSB0", "MINE");
  FakeTty& refusing = plug_in("ttyUSB0", "MINE");
  refusing.accept_only({9'600});
  const std::uint64_t opened = kernel_.opened();
  (void)run(std::chrono::seconds(10), [] { return false; });
  EXPECT_GE(kernel_.opened() - opened, 15U);
  EXPECT_LE(kernel_.opened() - opened, 20U) << "twice a second";
}

TEST_F(ReplugOnBus, AFailedReplyIsNamedByWhatTheDriverCounted) {
  ASSERT_TRUE(bus_->start(now_));
  ASSERT_TRUE(run_until_running());
  const auto healthy = tty().responder;
  const auto one_bad_reply = [&](auto spoil) {
    const std::uint32_t good = bus_->statistics().good;
    EXPECT_TRUE(run(std::chrono::seconds(1), [&] { return bus_->statistics().good >= good + 3; }));
    tty().responder = [&, spoil](const std::vector<std::uint8_t>& request) {
      std::vector<std::uint8_t> reply = healthy(request);
      spoil(reply);
      tty().responder = healthy;
      return reply;
    };
    const std::uint32_t failed = bus_->statistics().failed;
    EXPECT_TRUE(run(std::chrono::seconds(1), [&] { return bus_->statistics().failed > failed; }));
    return bus_->last_record().result;
  };
  using Reply = std::vector<std::uint8_t>;
  EXPECT_EQ(one_bad_reply([](Reply& reply) { reply[3] ^= 1; }), Errc::crc_error);
  EXPECT_EQ(one_bad_reply([&](Reply& reply) {
              reply[3] ^= 1;
              ++tty().counters.frame;
            }),
            Errc::framing_error);
  EXPECT_EQ(one_bad_reply([&](Reply& reply) {
              reply.pop_back();
              ++tty().counters.overrun;
            }),
            Errc::overrun);
  EXPECT_EQ(one_bad_reply([&](Reply& reply) {
              reply.clear();
              ++tty().counters.brk;
            }),
            Errc::framing_error);
  EXPECT_EQ(one_bad_reply([](Reply& reply) { reply.clear(); }), Errc::timeout);
  EXPECT_EQ(errors(Errc::overrun), 1U);
  EXPECT_EQ(errors(Errc::framing_error), 2U);
  EXPECT_TRUE(run_until_running());
}

TEST_F(ReplugOnBus, TheCountersAreNotReadWhileCyclesAreGood) {
  ASSERT_TRUE(bus_->start(now_));
  ASSERT_TRUE(run_until_running());
  const int before = tty().ioctls(0x545D);  // TIOCGICOUNT
  const std::uint32_t good = bus_->statistics().good;
  (void)run(std::chrono::seconds(1), [] { return false; });
  EXPECT_GT(bus_->statistics().good, good + 400);
  EXPECT_EQ(tty().ioctls(0x545D), before);
}

}  // namespace
}  // namespace tm485::linux_hal
