// No heap after construction: every allocation of this program is counted, and a running bus makes none.
#include <gtest/gtest.h>

#include <array>
#include <new>

#include "heap_count.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/bus.hpp"

namespace tm485 {
namespace {

/// Answers at once, out of fixed buffers; every `spoil_every`-th reply has a wrong CRC.
class FixedPort {
 public:
  std::uint32_t spoil_every = 0;

  [[nodiscard]] PortCapability capability() const noexcept { return {.wire_timestamps = true}; }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    switch (request[0]) {
      case 0x92:
        reply_ = {0x92, 0x00, 0x11, 0x83};
        size_ = 4;
        break;
      case 0xEA:
        reply_ = {0xEA, request[1], 0xA5, static_cast<std::uint8_t>(0xEA ^ request[1] ^ 0xA5)};
        size_ = 4;
        break;
      default:
        reply_ = {0x1A, 0x00, 0xFF, 0xFF, 0x01, 0x11, 0x01, 0x00, 0x00, 0x00, 0x0B};
        size_ = 11;
        break;
    }
    if (spoil_every != 0 && ++sent_ % spoil_every == 0) reply_[2] ^= 0x01;
    start_ = now + Time{4'000} * static_cast<std::int64_t>(request.size()) + Time{3'000};
    taken_ = 0;
    return now;
  }
  [[nodiscard]] Transmission transmission(Time) const noexcept {
    return {.state = Transmission::State::sent};
  }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    Reception reception{.first_start = start_ + Time{4'000} * static_cast<std::int64_t>(taken_)};
    while (reception.count < buffer.size() && taken_ < size_ &&
           start_ + Time{4'000} * static_cast<std::int64_t>(taken_ + 1) <= now)
      buffer[reception.count++] = reply_[taken_++];
    return reception;
  }
  /// When the whole reply is there.
  [[nodiscard]] Time complete() const noexcept {
    return start_ + Time{4'000} * static_cast<std::int64_t>(size_);
  }

 private:
  std::array<std::uint8_t, 11> reply_{};
  std::size_t size_ = 0;
  std::size_t taken_ = 0;
  std::uint32_t sent_ = 0;
  Time start_{0};
};

TEST(NoHeap, TheCounterCounts) {
  const std::uint64_t before = cli::heap_allocations();
  ::operator delete(
      ::operator new(sizeof(int)));  // a call, where `delete new int` may be left out by the compiler
  EXPECT_GE(cli::heap_allocations() - before, 1U);
}

TEST(NoHeap, ABusRunsAHundredThousandCyclesWithoutOneAllocation) {
  FixedPort port;
  const CompiledProfile profile = test::compiled("tm485_17");
  Time now{0};
  BusConfig config;
  config.cycle = Cycle{DataId::everything, Time{125'000}};
  const std::uint64_t before = cli::heap_allocations();
  Bus<FixedPort> bus(port, profile, config);
  const bool started = bus.start(now).has_value();
  std::uint32_t background = 0;
  while (bus.statistics().cycles < 100'000) {
    const Time due = bus.poll(now);
    const Time reply = port.complete();
    now = reply > now && reply < due ? reply : due;
    if (bus.state() != BusState::running) continue;
    port.spoil_every = 97;
    if (bus.statistics().cycles % 50 == 0 && bus.offer(*Request::eeprom_read(5))) ++background;
    (void)bus.take_completion();
    (void)bus.latest();
    if (bus.statistics().cycles >= 50'000 && bus.statistics().restarts == 0) bus.on_restart(now);
  }
  const std::uint64_t made = cli::heap_allocations() - before;
  EXPECT_EQ(made, 0U);
  EXPECT_TRUE(started);
  EXPECT_GT(bus.statistics().good, 90'000U);
  EXPECT_GT(bus.statistics().failed, 500U);
  EXPECT_GT(bus.statistics().background, 100U);
  EXPECT_GT(bus.statistics().restarts, 0U);
  EXPECT_GT(background, 100U);
}

}  // namespace
}  // namespace tm485
