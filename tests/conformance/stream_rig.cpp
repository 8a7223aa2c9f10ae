// SerialPort on a pseudo-terminal and UnixPort under the contract, in real time: no instant is asserted.
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <cstring>
#include <optional>
#include <stdexcept>

#include "conformance/rigs.hpp"
#include "linux/pseudo_terminal.hpp"
#include "tm485/linux/clock.hpp"
#include "tm485/linux/serial_port.hpp"
#include "tm485/linux/unix_port.hpp"

namespace tm485::test {
namespace {

using linux_hal::SerialPort;
using linux_hal::UnixPort;

/// A port of the kernel; `far_end` is the descriptor of the other side.
template <class P>
class StreamRig : public Rig {
 public:
  PortCapability capability() override { return port_->capability(); }
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request) override {
    return port_->try_send(request, now());
  }
  Transmission transmission() override { return port_->transmission(now()); }
  Reception try_receive(std::span<std::uint8_t> buffer) override { return port_->try_receive(buffer, now()); }

  Time now() override { return clock_.now(); }
  void pass(Time span) override { clock_.wait_until(clock_.now() + span); }
  [[nodiscard]] Time grain() const override { return std::chrono::microseconds(20); }
  [[nodiscard]] Time patience() const override { return std::chrono::seconds(5); }

  std::vector<HeardByte> heard() override {
    std::vector<HeardByte> bytes;
    std::array<std::uint8_t, 256> buffer{};
    const ssize_t count = ::read(far_end(), buffer.data(), buffer.size());
    for (ssize_t i = 0; i < count; ++i) bytes.push_back({.byte = buffer[static_cast<std::size_t>(i)]});
    return bytes;
  }
  void answer(std::span<const std::uint8_t> bytes, Time) override {
    EXPECT_EQ(::write(far_end(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  [[nodiscard]] bool wire_time() const override { return false; }

 protected:
  [[nodiscard]] virtual int far_end() const = 0;

  linux_hal::MonotonicClock clock_;
  std::optional<P> port_;
};

class PseudoTerminalRig : public StreamRig<SerialPort> {
 public:
  PseudoTerminalRig() {
    auto port = SerialPort::open(terminal_.path());
    if (!port) throw std::runtime_error(port.error().message());
    port_.emplace(std::move(*port));
  }
  bool vanish() override { return terminal_.close(), true; }

 private:
  [[nodiscard]] int far_end() const override { return terminal_.master(); }
  linux_hal::test::PseudoTerminal terminal_;
};

class UnixSocketRig : public StreamRig<UnixPort> {
 public:
  UnixSocketRig() {
    const std::string path = folder_ / "encoder";
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, path.data(), path.size());
    const posix::FileDescriptor listener(socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0));
    EXPECT_EQ(bind(listener.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address), 0);
    EXPECT_EQ(listen(listener.get(), 1), 0);
    auto port = UnixPort::connect(path);
    if (!port) throw std::runtime_error(port.error().message());
    port_.emplace(std::move(*port));
    server_ = posix::FileDescriptor(accept4(listener.get(), nullptr, nullptr, SOCK_NONBLOCK | SOCK_CLOEXEC));
    EXPECT_TRUE(server_.valid());
  }
  bool vanish() override { return server_.close(), true; }

 private:
  [[nodiscard]] int far_end() const override { return server_.get(); }
  linux_hal::test::TemporaryFolder folder_;
  posix::FileDescriptor server_;
};

std::unique_ptr<Rig> unix_socket() { return std::make_unique<UnixSocketRig>(); }

INSTANTIATE_TEST_SUITE_P(Streams, PortConformance,
                         conformance_of({{"PseudoTerminal", make_pseudo_terminal_rig},
                                         {"UnixSocket", unix_socket}}),
                         conformance_name);

}  // namespace

std::unique_ptr<Rig> make_pseudo_terminal_rig() { return std::make_unique<PseudoTerminalRig>(); }

}  // namespace tm485::test
