// tm485_vm_serial_pair TTY TTY COUNT: exchanges COUNT requests and answers between two SerialPorts whose lines are
// crossed, at 2.5 Mbit/s. Exit code 1 on the first byte that is lost, wrong or too many.
#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <span>

#include "tm485/linux/clock.hpp"
#include "tm485/linux/serial_port.hpp"

namespace {

using tm485::Time;
using tm485::linux_hal::MonotonicClock;
using tm485::linux_hal::SerialPort;

/// Emulation stops for as long as its host pleases.
constexpr Time kPatience = std::chrono::seconds(5);
constexpr std::size_t kLongest = 4;

/// Sends `bytes` and waits for the end of the transmission and for the same bytes at the other end.
bool transfer(const MonotonicClock& clock, SerialPort& from, SerialPort& to,
              std::span<const std::uint8_t> bytes) {
  const Time begin = clock.now();
  if (!from.try_send(bytes, begin)) {
    std::printf("send failed, errno %d\n", from.last_errno());
    return false;
  }
  std::array<std::uint8_t, kLongest + 1> found{};
  std::size_t count = 0;
  bool sent = false;
  while (!sent || count < bytes.size()) {
    const Time now = clock.now();
    if (now - begin > kPatience) {
      std::printf("%s, %zu of %zu bytes received\n", sent ? "sent" : "not sent", count, bytes.size());
      return false;
    }
    const tm485::Transmission transmission = from.transmission(now);
    if (transmission.state == tm485::Transmission::State::failed) return false;
    sent = transmission.state == tm485::Transmission::State::sent;
    count += to.try_receive(std::span(found).subspan(count), now).count;
  }
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    if (count == bytes.size() && found[i] == bytes[i]) continue;
    std::printf("byte %zu of %zu: sent %02X, received %02X; %zu received\n", i, bytes.size(),
                unsigned{bytes[i]}, unsigned{found[i]}, count);
    return false;
  }
  return true;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 4) return 2;
  auto first = SerialPort::open(arguments[1]);
  auto second = SerialPort::open(arguments[2]);
  for (const auto* port : {&first, &second}) {
    if (*port) continue;
    std::printf("%s\n%s\n", port->error().what.c_str(), port->error().remedy.c_str());
    return 1;
  }
  const MonotonicClock clock;
  const int exchanges = std::atoi(arguments[3]);
  for (int i = 0; i < exchanges; ++i) {
    const auto byte = static_cast<std::uint8_t>(i);
    const std::array<std::uint8_t, kLongest> answer{byte, 0xFF, 0x00, static_cast<std::uint8_t>(~byte)};
    if (!transfer(clock, *first, *second, std::span(answer).first(1)) ||
        !transfer(clock, *second, *first, answer)) {
      std::printf("in exchange %d of %d\n", i, exchanges);
      return 1;
    }
  }
  std::printf("%d exchanges at %u and %u bit/s\n", exchanges, first->achieved_rate(),
              second->achieved_rate());
  return exchanges > 0 ? 0 : 1;
}
