// The fake kernel itself: what belongs to a fake device comes to it, everything else goes to the real kernel.
#include "fake_kernel.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/file.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <array>
#include <cerrno>

#include "fake_tty.hpp"

namespace tm485::linux_hal::fake {
namespace {

constexpr const char* kPath = "/dev/ttyFake0";

int open_fake() { return ::open(kPath, O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC); }

TEST(FakeKernel, AnUnknownPathIsTheRealKernels) {
  FakeKernel kernel;
  EXPECT_EQ(open_fake(), -1);
  EXPECT_EQ(errno, ENOENT);
  const int fd = ::open("/dev/zero", O_RDONLY);
  ASSERT_GE(fd, 0);
  char byte = 'x';
  EXPECT_EQ(::read(fd, &byte, 1), 1);
  EXPECT_EQ(byte, 0);
  EXPECT_EQ(::ioctl(fd, TIOCEXCL), -1);
  EXPECT_EQ(errno, ENOTTY);
  EXPECT_EQ(::close(fd), 0);
  EXPECT_EQ(kernel.opened(), 0U);
}

TEST(FakeKernel, RoutesEveryCallAndCountsDescriptors) {
  FakeKernel kernel;
  FakeTty tty;
  kernel.add(kPath, tty);
  const int fd = open_fake();
  ASSERT_GE(fd, 0);
  EXPECT_EQ(kernel.open_descriptors(), 1U);
  EXPECT_EQ(::write(fd, "ab", 2), 2);
  EXPECT_EQ(tty.written(), (std::vector<std::uint8_t>{'a', 'b'}));
  tty.receive({7});
  pollfd waited{fd, POLLIN, 0};
  EXPECT_EQ(::poll(&waited, 1, 1000), 1);
  std::array<std::uint8_t, 4> buffer{};
  EXPECT_EQ(::read(fd, buffer.data(), buffer.size()), 1);
  EXPECT_EQ(buffer[0], 7);
  EXPECT_EQ(::read(fd, buffer.data(), buffer.size()), -1);
  EXPECT_EQ(errno, EAGAIN);
  EXPECT_EQ(::poll(&waited, 1, 1'000'000), 0) << "a fake kernel does not wait";
  EXPECT_EQ(::ioctl(fd, TIOCEXCL), 0);
  EXPECT_EQ(open_fake(), -1);
  EXPECT_EQ(errno, EBUSY);
  struct stat status{};
  EXPECT_EQ(::fstat(fd, &status), 0);
  EXPECT_TRUE(S_ISCHR(status.st_mode));
  EXPECT_EQ(::stat(kPath, &status), 0);
  EXPECT_EQ(::access(kPath, R_OK | W_OK), 0);
  EXPECT_EQ(::close(fd), 0);
  EXPECT_EQ(kernel.open_descriptors(), 0U);
  EXPECT_EQ(kernel.opened(), 1U);
}

TEST(FakeKernel, TheLockIsHeldByOneDescriptorUntilItCloses) {
  FakeKernel kernel;
  FakeTty tty;
  kernel.add(kPath, tty);
  const int first = open_fake();
  const int second = open_fake();
  EXPECT_EQ(::flock(first, LOCK_EX | LOCK_NB), 0);
  EXPECT_EQ(::flock(second, LOCK_EX | LOCK_NB), -1);
  EXPECT_EQ(errno, EWOULDBLOCK);
  ::close(first);
  EXPECT_EQ(::flock(second, LOCK_EX | LOCK_NB), 0);
  ::close(second);
}

TEST(FakeKernel, FailedOpensLeaveNothing) {
  FakeKernel kernel;
  FakeTty tty;
  kernel.add(kPath, tty);
  kernel.fail_open(kPath, EACCES, 2);
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(open_fake(), -1);
    EXPECT_EQ(errno, EACCES);
  }
  tty.unplug();
  EXPECT_EQ(open_fake(), -1);
  EXPECT_EQ(errno, ENXIO);
  EXPECT_EQ(kernel.open_descriptors(), 0U);
}

TEST(FakeKernel, AFileHasItsTextAndADeviceMakesFurtherDescriptors) {
  FakeKernel kernel;
  FakeFile file("254:0\n");
  kernel.add("/sys/bus/gpio/devices/gpiochip0/dev", file);
  const int fd = ::open("/sys/bus/gpio/devices/gpiochip0/dev", O_RDONLY);
  std::array<char, 16> text{};
  EXPECT_EQ(::read(fd, text.data(), text.size()), 6);
  EXPECT_STREQ(text.data(), "254:0\n");
  EXPECT_EQ(::read(fd, text.data(), text.size()), 0);
  const int further = kernel.make_descriptor(file, O_RDONLY);
  EXPECT_NE(further, fd);
  EXPECT_EQ(::read(further, text.data(), 3), 3);
  EXPECT_EQ(kernel.open_descriptors(), 2U);
  ::close(further);
  ::close(fd);
}

TEST(FakeTty, AnUnpluggedOneAnswersLikeAHangUp) {
  FakeKernel kernel;
  FakeTty tty;
  kernel.add(kPath, tty);
  const int fd = open_fake();
  tty.unplug();
  char byte = 0;
  EXPECT_EQ(::read(fd, &byte, 1), 0);
  EXPECT_EQ(::write(fd, &byte, 1), -1);
  EXPECT_EQ(errno, EIO);
  EXPECT_EQ(::ioctl(fd, TIOCEXCL), -1);
  EXPECT_EQ(errno, EIO);
  ::close(fd);
}

TEST(FakeTty, WithoutADriverForItRs485IsNotATerminalsIoctl) {
  FakeKernel kernel;
  FakeTty tty;
  kernel.add(kPath, tty);
  const int fd = open_fake();
  serial_rs485 wished{};
  wished.flags = SER_RS485_ENABLED | SER_RS485_RX_DURING_TX;
  EXPECT_EQ(::ioctl(fd, TIOCSRS485, &wished), -1);
  EXPECT_EQ(errno, ENOTTY);
  tty.has_rs485 = true;
  tty.rs485_mask = SER_RS485_ENABLED;
  EXPECT_EQ(::ioctl(fd, TIOCSRS485, &wished), 0);
  EXPECT_EQ(wished.flags, std::uint32_t{SER_RS485_ENABLED});
  ::close(fd);
}

}  // namespace
}  // namespace tm485::linux_hal::fake
