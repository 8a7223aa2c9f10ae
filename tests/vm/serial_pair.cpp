// tm485_vm_serial_pair TTY TTY COUNT [DIRECTION SEEN]: exchanges COUNT requests and answers between two SerialPorts
// whose lines are crossed, at 2.5 Mbit/s. DIRECTION (gpio:CHIP:LINE[:low]) is that of the first; its line must be seen
// (seen_level.hpp) active while a request is held up in the tty, and inactive when it is sent.
// Exit code 1 on the first byte that is lost, wrong or too many, and on a wrong level.
#include <termios.h>

#include <array>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <optional>
#include <span>

#include "seen_level.hpp"
#include "tm485/linux/clock.hpp"
#include "tm485/linux/directed_port.hpp"
#include "tm485/linux/serial_port.hpp"

namespace {

using tm485::Time;
using tm485::Transmission;
using tm485::linux_hal::DirectedPort;
using tm485::linux_hal::MonotonicClock;
using tm485::linux_hal::OsError;
using tm485::linux_hal::Rs485Direction;
using tm485::linux_hal::SerialPort;

/// Emulation stops for as long as its host pleases.
constexpr Time kPatience = std::chrono::seconds(5);
constexpr std::size_t kLongest = 4;

/// The driver-enable line of a port, if its direction is switched by our code.
class Watch {
 public:
  Watch() = default;
  Watch(const char* where, bool active_low) : seen_(std::in_place, where), active_low_(active_low) {}

  [[nodiscard]] bool is(bool active) const {
    if (!seen_) return true;
    const int level = seen_->level();
    if (level == (active != active_low_ ? 1 : 0)) return true;
    std::printf("level %d while the line should be %s\n", level, active ? "active" : "inactive");
    return false;
  }

 private:
  std::optional<tm485::vm::SeenLevel> seen_;
  bool active_low_ = false;
};

bool begin_send(SerialPort& port, std::span<const std::uint8_t> bytes, Time now, const Watch&) {
  return port.try_send(bytes, now).has_value();
}

/// QEMU's transmitter is empty at once, and the line would be active for too short a time to be seen.
bool begin_send(DirectedPort<SerialPort>& port, std::span<const std::uint8_t> bytes, Time now,
                const Watch& watch) {
  const int fd = port.port().descriptor();
  if (tcflow(fd, TCOOFF) != 0) return false;
  const bool taken = port.try_send(bytes, now).has_value();
  const bool held = port.driving() && port.transmission(now).state == Transmission::State::sending;
  const bool seen = watch.is(true);
  return tcflow(fd, TCOON) == 0 && taken && held && seen;
}

/// Sends `bytes` and waits for the end of the transmission and for the same bytes at the other end.
template <class From, class To>
bool transfer(const MonotonicClock& clock, From& from, To& to, std::span<const std::uint8_t> bytes,
              const Watch& watch) {
  const Time begin = clock.now();
  if (!watch.is(false) || !begin_send(from, bytes, begin, watch)) {
    std::printf("send failed\n");
    return false;
  }
  std::array<std::uint8_t, kLongest + 1> found{};
  std::size_t count = 0;
  bool sent = false;
  while (!sent || count < bytes.size()) {
    const Time now = clock.now();
    const Transmission transmission = from.transmission(now);
    sent = transmission.state == Transmission::State::sent;
    if (transmission.state == Transmission::State::failed || now - begin > kPatience) {
      std::printf("%s, %zu of %zu bytes received\n", sent ? "sent" : "not sent", count, bytes.size());
      return false;
    }
    if (sent && !watch.is(false)) return false;
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

template <class First>
bool exchange(First& first, SerialPort& second, int times, const Watch& watch) {
  const MonotonicClock clock;
  const Watch nobody;
  for (int i = 0; i < times; ++i) {
    const auto byte = static_cast<std::uint8_t>(i);
    const std::array<std::uint8_t, kLongest> request{byte, 0xFF, 0x00, static_cast<std::uint8_t>(~byte)};
    if (!transfer(clock, first, second, request, watch) ||
        !transfer(clock, second, first, std::span(request).first(1), nobody)) {
      std::printf("in exchange %d of %d\n", i, times);
      return false;
    }
  }
  return times > 0;
}

int fail(const OsError& error) {
  std::printf("%s\n", error.message().c_str());
  return 1;
}

}  // namespace

int main(int count, char** arguments) {
  if (count != 4 && count != 6) return 2;
  auto first = SerialPort::open(arguments[1]);
  if (!first) return fail(first.error());
  auto second = SerialPort::open(arguments[2]);
  if (!second) return fail(second.error());
  const int times = std::atoi(arguments[3]);
  std::printf("%u and %u bit/s\n", first->achieved_rate(), second->achieved_rate());
  if (count == 4) return exchange(*first, *second, times, Watch()) ? 0 : 1;
  const auto config = tm485::linux_hal::parse_direction(arguments[4]);
  if (!config) return fail(config.error());
  auto direction = Rs485Direction::open(*config, first->descriptor(), arguments[1]);
  if (!direction) return fail(direction.error());
  std::printf("%s\n", direction->description().c_str());
  DirectedPort directed(std::move(*first), std::move(*direction), {.give_up = kPatience});
  const Watch watch(arguments[5], config->gpio.active_low);
  return exchange(directed, *second, times, watch) ? 0 : 1;
}
