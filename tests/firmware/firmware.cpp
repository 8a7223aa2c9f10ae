// The smallest firmware with the whole bus in it: start-up, cyclic reads, a background exchange, samples.
// It is built for each Cortex-M and never run; its size and its undefined symbols are what tools/check.sh looks at.
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>

#include "tm485/bus/bus.hpp"

namespace {

using tm485::Errc;
using tm485::Time;

// A UART as registers, without a chip behind them.
struct Uart {
  std::uint32_t status;  // bit 0: a byte was received, bit 1: the last stop bit has left
  std::uint32_t data;
  std::uint32_t nanoseconds;
};

class RegisterPort {
 public:
  explicit RegisterPort(volatile Uart& uart) : uart_(&uart) {}

  [[nodiscard]] tm485::PortCapability capability() const noexcept {
    return {.latency_allowance = Time{4'000}, .timing = tm485::TimingClass::hard};
  }
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    for (const std::uint8_t byte : request) uart_->data = byte;
    return now;
  }
  [[nodiscard]] tm485::Transmission transmission(Time) const noexcept {
    using State = tm485::Transmission::State;
    return {.state = (uart_->status & 2U) != 0 ? State::sent : State::sending};
  }
  tm485::Reception try_receive(std::span<std::uint8_t> buffer, Time) noexcept {
    tm485::Reception reception;
    while (reception.count < buffer.size() && (uart_->status & 1U) != 0)
      buffer[reception.count++] = static_cast<std::uint8_t>(uart_->data);
    return reception;
  }

 private:
  volatile Uart* uart_;
};

constexpr tm485::CompiledProfile kProfile = *tm485::CompiledProfile::compile(tm485::Profile{});

}  // namespace

/// Where the samples go.
extern "C" volatile std::int64_t firmware_position;
volatile std::int64_t firmware_position;

extern "C" void firmware_entry(volatile Uart* uart) {
  RegisterPort port(*uart);
  tm485::Bus bus(port, kProfile, tm485::BusConfig{});
  Time now{0};
  if (!bus.start(now)) return;
  for (;;) {
    now = Time{now.count() + uart->nanoseconds};
    bus.poll(now);
    const tm485::Sample& sample = bus.latest();
    firmware_position = sample.position();
    if (bus.state() == tm485::BusState::running && !bus.take_completion()) {
      const auto request = tm485::Request::make(tm485::DataId::encoder_id);
      if (request) (void)bus.offer(*request);
    }
  }
}
