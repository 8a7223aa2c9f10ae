#include "tm485/linux/unix_port.hpp"

#include <gmock/gmock.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <vector>

#include "pseudo_terminal.hpp"

namespace tm485::linux_hal {
namespace {

using test::TemporaryFolder;
using ::testing::HasSubstr;

constexpr std::array<std::uint8_t, 4> kFour{0x32, 0x05, 0xA5, 0x92};

posix::FileDescriptor bind_to(const std::string& path, int type) {
  posix::FileDescriptor fd(socket(AF_UNIX, type | SOCK_CLOEXEC, 0));
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  std::memcpy(address.sun_path, path.data(), path.size());
  EXPECT_EQ(bind(fd.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
  return fd;
}

posix::FileDescriptor listen_on(const std::string& path, int backlog) {
  posix::FileDescriptor fd = bind_to(path, SOCK_STREAM);
  EXPECT_EQ(listen(fd.get(), backlog), 0);
  return fd;
}

class UnixPortTest : public ::testing::Test {
 protected:
  TemporaryFolder folder_;
  std::string path_ = folder_ / "encoder";
};

TEST_F(UnixPortTest, ExchangesBytesUntilTheServerCloses) {
  const posix::FileDescriptor listener = listen_on(path_, 1);
  auto port = UnixPort::connect(path_);
  ASSERT_TRUE(port) << port.error().message();
  posix::FileDescriptor server(accept(listener.get(), nullptr, nullptr));
  ASSERT_TRUE(server.valid());
  ASSERT_EQ(port->try_send(kFour, Time{7}), Time{7});
  EXPECT_EQ(port->transmission(Time{7}).state, Transmission::State::sending);
  EXPECT_EQ(port->transmission(Time{16'007}).state, Transmission::State::sent);
  std::array<std::uint8_t, 16> buffer{};
  ASSERT_EQ(read(server.get(), buffer.data(), buffer.size()), 4);
  ASSERT_EQ(write(server.get(), buffer.data(), 3), 3);
  EXPECT_EQ(port->try_receive(buffer, Time{0}).count, 3U);
  EXPECT_EQ(port->try_receive(buffer, Time{0}).fault, Errc::ok);
  server.close();
  EXPECT_EQ(port->try_receive(buffer, Time{0}).fault, Errc::port_gone);
  EXPECT_EQ(port->try_send(kFour, Time{0}), std::unexpected(Errc::port_gone));
}

TEST_F(UnixPortTest, StatesAndTakesACapability) {
  const posix::FileDescriptor listener = listen_on(path_, 2);
  const auto port = UnixPort::connect(path_);
  ASSERT_TRUE(port);
  EXPECT_EQ(port->capability().shortest_exchange, Time{0});
  EXPECT_EQ(port->capability().latency_allowance, std::chrono::milliseconds(50));
  EXPECT_FALSE(port->capability().wire_timestamps);
  EXPECT_EQ(port->capability().timing, TimingClass::best_effort);
  const auto other = UnixPort::connect(path_, {.latency_allowance = Time{5}, .shortest_exchange = Time{6}});
  ASSERT_TRUE(other);
  EXPECT_EQ(other->capability().latency_allowance, Time{5});
  EXPECT_EQ(other->capability().shortest_exchange, Time{6});
}

TEST_F(UnixPortTest, NoSocketAsksForTheServer) {
  const auto port = UnixPort::connect(path_);
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, Errc::port_gone);
  EXPECT_EQ(port.error().error_number, ENOENT);
  EXPECT_THAT(port.error().what, HasSubstr(path_));
  EXPECT_THAT(port.error().remedy, HasSubstr("tm485 sim --unix"));
}

TEST_F(UnixPortTest, ALeftOverSocketAsksForTheServer) {
  bind_to(path_, SOCK_STREAM).close();
  const auto port = UnixPort::connect(path_);
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().error_number, ECONNREFUSED);
  EXPECT_THAT(port.error().remedy, HasSubstr("tm485 sim --unix"));
}

TEST_F(UnixPortTest, OtherThingsAreRefused) {
  std::ofstream(folder_ / "file") << "x";
  EXPECT_EQ(UnixPort::connect(folder_ / "file").error().error_number, ECONNREFUSED);
  const posix::FileDescriptor datagrams = bind_to(folder_ / "datagrams", SOCK_DGRAM);
  EXPECT_EQ(UnixPort::connect(folder_ / "datagrams").error().error_number, EPROTOTYPE);
  EXPECT_EQ(UnixPort::connect("").error().error_number, EINVAL);
  EXPECT_EQ(UnixPort::connect(path_, {.bit_rate = 0}).error().error_number, EINVAL);
}

TEST_F(UnixPortTest, AnOverlongPathIsRefusedAndTheLongestIsNot) {
  std::string longest = folder_ / "";
  longest.append(sizeof(sockaddr_un::sun_path) - 1 - longest.size(), 'x');
  const posix::FileDescriptor listener = listen_on(longest, 1);
  EXPECT_TRUE(UnixPort::connect(longest));
  const auto port = UnixPort::connect(longest + "x");
  ASSERT_FALSE(port);
  EXPECT_EQ(port.error().code, Errc::bad_argument);
  EXPECT_EQ(port.error().error_number, ENAMETOOLONG);
}

TEST_F(UnixPortTest, AServerThatDoesNotAcceptIsGivenUp) {
  const posix::FileDescriptor listener = listen_on(path_, 0);
  const UnixOptions options{.connect_time = std::chrono::milliseconds(20)};
  std::vector<UnixPort> waiting;
  for (int i = 0; i < 16; ++i) {
    auto port = UnixPort::connect(path_, options);
    if (port) {
      waiting.push_back(std::move(*port));
      continue;
    }
    EXPECT_EQ(port.error().error_number, EAGAIN);
    EXPECT_THAT(port.error().remedy, HasSubstr("does not accept"));
    return;
  }
  FAIL() << "a queue of length 0 took 16 clients";
}

TEST_F(UnixPortTest, LeaksNoDescriptor) {
  const std::size_t before = test::open_descriptors();
  {
    const posix::FileDescriptor listener = listen_on(path_, 1);
    for (int i = 0; i < 1000; ++i) {
      EXPECT_TRUE(UnixPort::connect(path_));
      posix::FileDescriptor(accept(listener.get(), nullptr, nullptr)).close();
      EXPECT_FALSE(UnixPort::connect(path_ + "missing"));
    }
  }
  EXPECT_EQ(test::open_descriptors(), before);
}

}  // namespace
}  // namespace tm485::linux_hal
