// Clocks of microcontrollers: exact, without drift, over wraps; and the cycle counter, which is not everywhere.
#include "tm485/mcu/timer_clock.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <random>

#include "mcu/model_access.hpp"
#include "tm485/mcu/cycle_counter.hpp"

namespace tm485::test {
namespace {

/// Shows the low bits of `ticks`.
template <unsigned Bits>
struct Counter {
  static constexpr unsigned kBits = Bits;
  const std::uint64_t* ticks;
  std::uint32_t read() noexcept {
    return static_cast<std::uint32_t>(*ticks & ((std::uint64_t{1} << Bits) - 1));
  }
};

/// By another way: 128 bits, divided.
std::int64_t exact_ns(std::uint64_t ticks, std::uint32_t rate) {
  __extension__ using Wide = unsigned __int128;
  return static_cast<std::int64_t>(static_cast<Wide>(ticks) * 1'000'000'000U / rate);
}

template <unsigned Bits>
void expect_exact(std::uint32_t rate, std::uint64_t begin) {
  std::uint64_t ticks = begin;
  mcu::TimerClock clock(Counter<Bits>{&ticks}, rate);
  clock.start();
  EXPECT_EQ(clock.now(), Time{0});
  std::mt19937_64 random(rate);
  const std::uint64_t wrap = std::uint64_t{1} << Bits;
  Time before{0};
  for (int i = 0; i < 20'000; ++i) {
    // Short steps, and now and then nearly a wrap.
    ticks += i % 7 == 0 ? wrap - 1 - random() % 1'000 : random() % 5'000;
    const Time now = clock.now();
    const std::int64_t exact = exact_ns(ticks - begin, rate);
    ASSERT_LE(now.count(), exact) << rate << " Hz, step " << i;
    ASSERT_GE(now.count(), exact - 1) << rate << " Hz, step " << i;
    ASSERT_GE(now, before);
    before = now;
  }
}

TEST(TimerClock, IsExactOverWraps) {
  for (const std::uint32_t rate : {32'768U, 1'000'000U, 16'000'000U, 48'000'000U, 72'000'000U, 84'000'000U,
                                   168'000'000U, 170'000'000U, 550'000'000U, 999'999'937U, 1'000'000'000U}) {
    if (rate >= 16'000'000) expect_exact<32>(rate, 0xFFFF'FF00);
    if (rate >= 1'000'000) expect_exact<24>(rate, 12'345);
    expect_exact<16>(rate, 0xFFF0);
  }
}

/// A hundred days at a rate that no power of two divides well.
TEST(TimerClock, DoesNotDrift) {
  constexpr std::uint32_t kRate = 169'999'999;
  std::uint64_t ticks = 0;
  mcu::TimerClock clock(Counter<32>{&ticks}, kRate);
  clock.start();
  Time now{0};
  while (now < std::chrono::hours(24 * 100)) {
    ticks += 4'000'000'000;
    now = clock.now();
  }
  EXPECT_LE(now.count(), exact_ns(ticks, kRate));
  EXPECT_GE(now.count(), exact_ns(ticks, kRate) - 1);
}

TEST(TimerClock, CopiesAgree) {
  std::uint64_t ticks = 77;
  mcu::TimerClock clock(Counter<24>{&ticks}, 72'000'000);
  clock.start();
  auto other = clock;
  for (int i = 1; i < 100'000; ++i) {
    ticks += static_cast<std::uint64_t>(i % 1'000);
    const Time now = clock.now();
    if (i % 100 == 0) {
      ASSERT_EQ(other.now(), now);
    }
  }
}

// With a rate that is known then, nothing is divided after compilation.
constexpr std::uint64_t kNoTicks = 0;
[[maybe_unused]] constexpr mcu::TimerClock<Counter<32>> kConstant(Counter<32>{&kNoTicks}, 170'000'000);

/// The debug registers as the manual has them.
struct DwtModel {
  bool counts = true;
  bool has_counter = true;
  bool locked = false;
  std::map<std::size_t, std::uint32_t> registers = {};

  std::uint8_t read8(std::size_t) noexcept { return 0; }
  std::uint16_t read16(std::size_t) noexcept { return 0; }
  void write8(std::size_t, std::uint8_t) noexcept { wrong = true; }
  void write16(std::size_t, std::uint16_t) noexcept { wrong = true; }
  std::uint32_t read32(std::size_t offset) noexcept {
    // Trace is on, the counter is on: it counts.
    const bool on = (registers[0xEDFC] & 0x0100'0000) != 0 && (registers[0x1000] & 1) != 0;
    if (offset == 0x1004 && counts && has_counter && on) registers[0x1004] += 3;
    if (offset == 0x1000 && !has_counter) return registers[0x1000] | 0x0200'0000;
    return registers[offset];
  }
  void write32(std::size_t offset, std::uint32_t value) noexcept {
    if (offset == 0x1FB0 && value == 0xC5AC'CE55) locked = false;
    if (offset == 0x1000 && locked) return;
    registers[offset] = value;
  }
  bool wrong = false;
};

TEST(CycleCounter, IsDetected) {
  DwtModel present{.registers = {{0xEDFC, 0x0000'0001}, {0x1000, 0x4000'0000}}};
  mcu::CycleCounterClock<ModelAccess<DwtModel>> clock(
      mcu::CycleCounter<ModelAccess<DwtModel>>(ModelAccess<DwtModel>(present)), 100'000'000);
  EXPECT_TRUE(clock.counter().start());
  EXPECT_EQ(present.registers[0xEDFC], 0x0100'0001U) << "what was set stays";
  EXPECT_EQ(present.registers[0x1000], 0x4000'0001U);
  clock.start();
  EXPECT_EQ(clock.now(), Time{30});
  EXPECT_EQ(clock.now(), Time{60});

  DwtModel locked{.locked = true};
  EXPECT_TRUE(mcu::CycleCounter(ModelAccess(locked)).start());
  DwtModel emulated{.counts = false};
  EXPECT_FALSE(mcu::CycleCounter(ModelAccess(emulated)).start());
  DwtModel without{.has_counter = false};
  EXPECT_FALSE(mcu::CycleCounter(ModelAccess(without)).start());
  EXPECT_FALSE(present.wrong);
}

}  // namespace
}  // namespace tm485::test
