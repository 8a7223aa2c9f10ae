// MmioUart and its mapping on files that stand for physical memory and for sysfs.
#include "tm485/linux/mmio_uart.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "pseudo_terminal.hpp"

namespace tm485::linux_hal {
namespace {

namespace fs = std::filesystem;
using test::TemporaryFolder;
using ::testing::HasSubstr;

constexpr std::uint64_t kAddress = 0x3000;
constexpr std::array<std::uint8_t, 4> kRequest{0x32, 0x05, 0xA5, 0x92};

/// Sixteen kilobytes of "physical memory" in a file, seen here through a mapping of its own.
class Memory {
 public:
  explicit Memory(const std::string& path) : path_(path) {
    std::ofstream(path, std::ios::binary) << std::string(kSize, '\0');
    const posix::FileDescriptor fd(::open(path.c_str(), O_RDWR | O_CLOEXEC));
    base_ = static_cast<volatile std::uint8_t*>(
        mmap(nullptr, kSize, PROT_READ | PROT_WRITE, MAP_SHARED, fd.get(), 0));
  }
  Memory(const Memory&) = delete;
  Memory& operator=(const Memory&) = delete;
  ~Memory() { munmap(const_cast<std::uint8_t*>(base_), kSize); }

  [[nodiscard]] const std::string& path() const { return path_; }
  volatile std::uint32_t& word(std::uint64_t address) {
    return *reinterpret_cast<volatile std::uint32_t*>(base_ + address);
  }

 private:
  static constexpr std::size_t kSize = 0x4000;
  std::string path_;
  volatile std::uint8_t* base_;
};

class MmioUartTest : public ::testing::Test {
 protected:
  MmioUartTest() {
    fs::create_directories(sysfs_);
    flags() = 0x90;  // both FIFOs empty, transmitter idle
  }

  // Of the PL011's manual.
  volatile std::uint32_t& flags() { return memory_.word(kAddress + 0x18); }
  std::uint32_t reg(std::uint64_t offset) { return memory_.word(kAddress + offset); }

  [[nodiscard]] MmioOptions options() const {
    MmioOptions options;
    options.address = kAddress;
    options.clock_hz = 48'000'000;
    options.memory = memory_.path();
    options.sysfs = sysfs_;
    return options;
  }
  void write(const std::string& path, const std::string& text) const {
    fs::create_directories(fs::path(sysfs_ + "/" + path).parent_path());
    std::ofstream(sysfs_ + "/" + path) << text << '\n';
  }
  void link(const std::string& from, const std::string& to) const {
    fs::create_directories(fs::path(sysfs_ + "/" + from).parent_path());
    fs::create_directories(sysfs_ + "/" + to);
    fs::create_symlink(sysfs_ + "/" + to, sysfs_ + "/" + from);
  }

  TemporaryFolder folder_;
  std::string sysfs_ = folder_ / "sys";
  Memory memory_{folder_ / "memory"};
};

TEST_F(MmioUartTest, SetsUpTheUartAtItsAddressAndNothingElse) {
  const auto port = MmioUart::open(options());
  ASSERT_TRUE(port) << port.error().message();
  EXPECT_EQ(reg(0x24), 1U);
  EXPECT_EQ(reg(0x28), 13U);
  EXPECT_EQ(reg(0x2C), 0x70U);
  EXPECT_EQ(reg(0x30), 0x301U);
  EXPECT_EQ(port->divisor().rate, 2'493'506U);
  for (const std::uint64_t address : {0x0030U, 0x1030U, 0x2030U, 0x2FFCU})
    EXPECT_EQ(memory_.word(address), 0U);
}

TEST_F(MmioUartTest, AnAddressInTheMiddleOfAPageIsReached) {
  MmioOptions middle = options();
  middle.address = 0x2800;
  memory_.word(0x2818) = 0x90;
  const auto port = MmioUart::open(middle);
  ASSERT_TRUE(port) << port.error().message();
  EXPECT_EQ(memory_.word(0x2830), 0x301U);
}

TEST_F(MmioUartTest, SendsAndReceivesThroughTheRegisters) {
  auto port = MmioUart::open(options());
  ASSERT_TRUE(port) << port.error().message();
  EXPECT_EQ(port->transmission(Time{0}).state, Transmission::State::idle);
  ASSERT_EQ(port->try_send(kRequest, Time{1'000}), Time{1'000});
  EXPECT_EQ(reg(0x00), 0x92U);  // the last of them
  flags() = 0x98;
  EXPECT_EQ(port->transmission(Time{500'000}).state, Transmission::State::sending);
  flags() = 0x90;
  EXPECT_EQ(port->transmission(Time{500'000}).state, Transmission::State::sent);
  std::array<std::uint8_t, 3> buffer{};
  EXPECT_EQ(port->try_receive(buffer, Time{600'000}).count, 0U);
  flags() = 0x80;
  memory_.word(kAddress) = 0x1A;
  const Reception reception = port->try_receive(buffer, Time{600'000});
  EXPECT_EQ(reception.count, 3U);  // memory that always has a byte: bounded by the room
  EXPECT_EQ(buffer, (std::array<std::uint8_t, 3>{0x1A, 0x1A, 0x1A}));
  flags() = 0xFFFF'FFFFU;
  EXPECT_EQ(port->try_receive(buffer, Time{700'000}).fault, Errc::port_gone);
}

TEST_F(MmioUartTest, RtsIsTheDirectionIfItIsAsked) {
  MmioOptions rts = options();
  rts.direction.kind = MmioDirection::Kind::rts;
  {
    auto port = MmioUart::open(rts);
    ASSERT_TRUE(port) << port.error().message();
    EXPECT_EQ(reg(0x30), 0x301U);
    ASSERT_TRUE(port->try_send(kRequest, Time{0}));
    EXPECT_EQ(reg(0x30), 0xB01U);
    EXPECT_EQ(port->transmission(Time{20'000}).state, Transmission::State::sent);
    EXPECT_EQ(reg(0x30), 0x301U);
  }
  EXPECT_EQ(reg(0x30), 0U);
  rts.direction.kind = MmioDirection::Kind::rts_off;
  auto port = MmioUart::open(rts);
  ASSERT_TRUE(port) << port.error().message();
  EXPECT_EQ(reg(0x30), 0xB01U);
  ASSERT_TRUE(port->try_send(kRequest, Time{0}));
  EXPECT_EQ(reg(0x30), 0x301U);
}

TEST_F(MmioUartTest, AGpioIsTheDirectionIfItIsGiven) {
  MmioOptions gpio = options();
  std::vector<bool> switched;
  gpio.direction = {MmioDirection::Kind::call, [&switched](bool on) {
                      switched.push_back(on);
                      return true;
                    }};
  auto port = MmioUart::open(gpio);
  ASSERT_TRUE(port) << port.error().message();
  EXPECT_EQ(switched, std::vector<bool>{false});
  ASSERT_TRUE(port->try_send(kRequest, Time{0}));
  EXPECT_EQ(port->transmission(Time{17'500}).state, Transmission::State::sent);
  EXPECT_EQ(switched, (std::vector{false, true, false}));
  EXPECT_EQ(port->last_release(), Time{17'500 - 4 * 4'011});

  MmioOptions deaf = gpio;
  deaf.address = 0x1000;
  memory_.word(0x1018) = 0x90;
  deaf.direction.call = [](bool) { return false; };
  const auto refused = MmioUart::open(deaf);
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().what, HasSubstr("direction line does not obey"));
}

TEST_F(MmioUartTest, StatesWhatItHolds) {
  {
    const auto port = MmioUart::open(options());
    const PortCapability automatic = port->capability();
    EXPECT_EQ(automatic.release_bound, Time{0});
    EXPECT_EQ(automatic.timing, TimingClass::soft);
    EXPECT_FALSE(automatic.wire_timestamps);
  }
  MmioOptions rts = options();
  rts.direction.kind = MmioDirection::Kind::rts;
  EXPECT_EQ(MmioUart::open(rts)->capability().timing, TimingClass::best_effort);
  EXPECT_GT(MmioUart::open(rts)->capability().release_bound, Time{2'800});
  rts.release_bound = Time{2'000};
  rts.latency_allowance = Time{1};
  rts.shortest_exchange = Time{2};
  const auto port = MmioUart::open(rts);
  EXPECT_EQ(port->capability().timing, TimingClass::soft);
  EXPECT_EQ(port->capability().release_bound, Time{2'000});
  EXPECT_EQ(port->capability().latency_allowance, Time{1});
  EXPECT_EQ(port->capability().shortest_exchange, Time{2});
}

TEST_F(MmioUartTest, ClosesAsItShould) {
  {
    auto port = MmioUart::open(options());
    ASSERT_TRUE(port);
    MmioUart other = std::move(*port);
    EXPECT_EQ(reg(0x30), 0x301U);
    MmioOptions second = options();
    second.address = 0x1000;
    memory_.word(0x1018) = 0x90;
    auto replaced = MmioUart::open(second);
    ASSERT_TRUE(replaced) << replaced.error().message();
    *replaced = std::move(other);
    EXPECT_EQ(memory_.word(0x1030), 0U);
    EXPECT_EQ(reg(0x30), 0x301U);
  }
  EXPECT_EQ(reg(0x30), 0U);
}

TEST_F(MmioUartTest, AfterClosingTheSameProgramCanOpenItAgain) {
  MmioOptions gpio = options();
  const auto line = std::make_shared<bool>(false);
  gpio.direction = {MmioDirection::Kind::call, [line](bool on) {
                      *line = on;
                      return true;
                    }};
  auto port = MmioUart::open(gpio);
  gpio.direction = {};
  ASSERT_TRUE(port) << port.error().message();
  ASSERT_TRUE(port->try_send(kRequest, Time{0}));
  EXPECT_TRUE(*line);
  const PortCapability held = port->capability();
  port->close();
  EXPECT_FALSE(*line);
  EXPECT_EQ(line.use_count(), 1) << "what switches the driver is free for the next one";
  EXPECT_EQ(reg(0x30), 0U);
  std::array<std::uint8_t, 4> buffer{};
  EXPECT_EQ(port->try_send(kRequest, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_EQ(port->transmission(Time{0}).state, Transmission::State::failed);
  EXPECT_EQ(port->transmission(Time{0}).fault, Errc::port_gone);
  EXPECT_EQ(port->try_receive(buffer, Time{0}).fault, Errc::port_gone);
  EXPECT_EQ(port->capability().release_bound, held.release_bound);
  port->close();
  auto again = MmioUart::open(options());
  ASSERT_TRUE(again) << again.error().message();
  *port = std::move(*again);
  EXPECT_TRUE(port->try_send(kRequest, Time{0}));
}

TEST_F(MmioUartTest, OneUartHasOneUser) {
  const auto port = MmioUart::open(options());
  ASSERT_TRUE(port);
  const auto second = MmioUart::open(options());
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().error_number, EBUSY);
  EXPECT_THAT(second.error().remedy, HasSubstr("another program"));
  EXPECT_EQ(reg(0x30), 0x301U);
  MmioOptions neighbour = options();
  neighbour.address = 0x1000;
  memory_.word(0x1018) = 0x90;
  EXPECT_TRUE(MmioUart::open(neighbour));
}

TEST_F(MmioUartTest, ARateThatTheClockDoesNotMakeIsRefused) {
  MmioOptions slow = options();
  slow.clock_hz = 24'000'000;
  const auto port = MmioUart::open(slow);
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, Errc::bad_argument);
  EXPECT_THAT(port.error().what, HasSubstr("PL011 at 0x3000"));
  EXPECT_THAT(port.error().what, HasSubstr("1500000 bit/s"));
  EXPECT_THAT(port.error().remedy, HasSubstr("40 MHz"));
  EXPECT_EQ(reg(0x30), 0U);
}

TEST_F(MmioUartTest, ImpossibleOptionsAreNamed) {
  const auto why = [this](auto change) {
    MmioOptions changed = options();
    change(changed);
    const auto port = MmioUart::open(changed);
    return port ? std::string("taken") : port.error().what;
  };
  EXPECT_THAT(why([](MmioOptions& o) { o.clock_hz = 0; }), HasSubstr("clock"));
  EXPECT_THAT(why([](MmioOptions& o) { o.bit_rate = 0; }), HasSubstr("bit rate"));
  EXPECT_THAT(why([](MmioOptions& o) { o.address = 0; }), HasSubstr("address"));
  EXPECT_THAT(why([](MmioOptions& o) { o.address += 2; }), HasSubstr("multiple of 4"));
  EXPECT_THAT(why([](MmioOptions& o) { o.layout = {.shift = 0, .width = 4}; }), HasSubstr("width"));
  EXPECT_THAT(why([](MmioOptions& o) { o.driver_lead = Time{-1}; }), HasSubstr("negative"));
  EXPECT_THAT(why([](MmioOptions& o) { o.release_bound = Time{-1}; }), HasSubstr("negative"));
  EXPECT_THAT(why([](MmioOptions& o) { o.direction.kind = MmioDirection::Kind::call; }), HasSubstr("call"));
}

TEST_F(MmioUartTest, WhatIsNoUartIsRefused) {
  // Memory keeps everything, but a 16550's FIFOs answer at the register that they are set by.
  MmioOptions other = options();
  other.block = MmioBlock::ns16550;
  other.clock_hz = 40'000'000;
  other.layout = {.shift = 2, .width = 4};
  const auto without_fifo = MmioUart::open(other);
  ASSERT_FALSE(without_fifo);
  EXPECT_EQ(without_fifo.error().code, Errc::bad_argument);
  EXPECT_THAT(without_fifo.error().what, HasSubstr("16550 at 0x3000"));
  EXPECT_THAT(without_fifo.error().what, HasSubstr("FIFO"));
}

TEST_F(MmioUartTest, AnAddressBehindTheEndIsNoCrash) {
  MmioOptions outside = options();
  outside.address = 0x100'0000;
  const std::size_t before = test::open_descriptors();
  for (int i = 0; i < 3; ++i) {
    const auto port = MmioUart::open(outside);
    ASSERT_FALSE(port);
    EXPECT_EQ(port.error().error_number, EFAULT);
    EXPECT_THAT(port.error().remedy, HasSubstr("nothing answers"));
  }
  EXPECT_EQ(test::open_descriptors(), before);
}

TEST_F(MmioUartTest, WhatCannotBeMappedIsNamed) {
  MmioOptions absent = options();
  absent.memory = folder_ / "absent";
  EXPECT_EQ(MmioUart::open(absent).error().code, Errc::port_gone);
  EXPECT_THAT(MmioUart::open(absent).error().remedy, HasSubstr("UIO"));
  MmioOptions folder = options();
  folder.memory = sysfs_;
  EXPECT_EQ(MmioUart::open(folder).error().error_number, EISDIR);
  EXPECT_THAT(std::string(remedy_for(Resource::mapped_uart, EPERM)), HasSubstr("iomem=relaxed"));

  ASSERT_EQ(chmod(memory_.path().c_str(), 0), 0);
  const uid_t before = geteuid();
  if (before == 0 && seteuid(65'534) != 0) GTEST_SKIP() << "root, and cannot become another user";
  // The folder of the test belongs to root: what is in it is out of reach for another reason, with the same answer.
  const auto port = MmioUart::open(options());
  ASSERT_EQ(seteuid(before), 0);
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().error_number, EACCES);
  EXPECT_THAT(port.error().remedy, HasSubstr("root"));
}

TEST_F(MmioUartTest, AKernelDriverThatStillHasItIsNamedWithTheWayToUnbind) {
  write("class/tty/ttyS0/iomem_base", "0x9000");
  link("devices/platform/3000.serial/driver", "bus/amba/drivers/uart-pl011");
  link("devices/platform/3000.serial/subsystem", "bus/amba");
  link("class/tty/ttyAMA0/device", "devices/platform/3000.serial");
  write("class/tty/ttyAMA0/iomem_base", "0x3000");
  const auto port = MmioUart::open(options());
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().error_number, EBUSY);
  EXPECT_THAT(port.error().what, HasSubstr("ttyAMA0"));
  EXPECT_THAT(port.error().remedy, HasSubstr("echo 3000.serial > /sys/bus/amba/drivers/uart-pl011/unbind"));
  EXPECT_EQ(reg(0x30), 0U);
  MmioOptions other = options();
  other.address = 0x1000;
  memory_.word(0x1018) = 0x90;
  EXPECT_TRUE(MmioUart::open(other));
}

/// Kernels since 6.5 have two devices of their own between the tty and the UART.
TEST_F(MmioUartTest, TheDriverIsFoundBehindTheKernelsOwnDevices) {
  link("devices/3000.pl011/driver", "bus/amba/drivers/uart-pl011");
  link("devices/3000.pl011/subsystem", "bus/amba");
  link("devices/3000.pl011/3000.pl011:0/driver", "bus/serial-base/drivers/ctrl");
  link("devices/3000.pl011/3000.pl011:0/subsystem", "bus/serial-base");
  link("devices/3000.pl011/3000.pl011:0/3000.pl011:0.0/driver", "bus/serial-base/drivers/port");
  link("devices/3000.pl011/3000.pl011:0/3000.pl011:0.0/subsystem", "bus/serial-base");
  link("class/tty/ttyAMA0/device", "devices/3000.pl011/3000.pl011:0/3000.pl011:0.0");
  write("class/tty/ttyAMA0/iomem_base", "0x3000");
  const BoundDriver bound = find_bound_driver(sysfs_, kAddress);
  EXPECT_EQ(bound.tty, "ttyAMA0");
  EXPECT_EQ(bound.device, "3000.pl011");
  EXPECT_EQ(bound.bus, "amba");
  EXPECT_EQ(bound.driver, "uart-pl011");
}

TEST_F(MmioUartTest, MapsAUioDevice) {
  // A file in place of /dev/uio0: its region begins at the file's start.
  write("class/uio/memory/maps/map0/size", "0x4000");
  write("class/uio/memory/maps/map0/addr", "0x9000000");
  write("class/uio/memory/maps/map0/offset", "0x0");
  MmioOptions uio = options();
  uio.uio = memory_.path();
  uio.memory = folder_ / "absent";
  uio.address = 0;
  memory_.word(0x18) = 0x90;
  {
    const auto port = MmioUart::open(uio);
    ASSERT_TRUE(port) << port.error().message();
    EXPECT_EQ(memory_.word(0x30), 0x301U);
  }
  uio.address = 0x900'0000;
  EXPECT_TRUE(MmioUart::open(uio));
  uio.address = 0x900'1000;
  const auto other_address = MmioUart::open(uio);
  ASSERT_FALSE(other_address);
  EXPECT_THAT(other_address.error().what, HasSubstr("another address"));
  uio.address = 0;
  write("class/uio/memory/maps/map0/size", "0x800");
  EXPECT_THAT(MmioUart::open(uio).error().what, HasSubstr("too short"));
  write("class/uio/memory/maps/map0/size", "plenty");
  EXPECT_EQ(MmioUart::open(uio).error().error_number, ENOTTY);
  uio.uio = "/dev/uio_absent";
  EXPECT_EQ(MmioUart::open(uio).error().code, Errc::port_gone);
}

TEST_F(MmioUartTest, LeaksNoDescriptor) {
  MmioOptions slow = options();
  slow.clock_hz = 1;
  const std::size_t before = test::open_descriptors();
  for (int i = 0; i < 200; ++i) {
    EXPECT_TRUE(MmioUart::open(options()));
    EXPECT_FALSE(MmioUart::open(slow));
  }
  EXPECT_EQ(test::open_descriptors(), before);
}

}  // namespace
}  // namespace tm485::linux_hal
