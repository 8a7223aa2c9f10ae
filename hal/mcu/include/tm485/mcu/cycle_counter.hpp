// CycleCounter: the cycle counter of Cortex-M3, M4, M7 and M33 (DWT), detected, and the clock on it. Registers: ARM DDI
// 0403 (ARMv7-M), C1.6.5 and C1.8. Cortex-M0 and M0+ have none, and emulators show one that does not count: use a
// TimerClock over a timer there.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "tm485/mcu/register_access.hpp"
#include "tm485/mcu/timer_clock.hpp"

namespace tm485::mcu {

template <RegisterAccess R>
class CycleCounter {
 public:
  static constexpr unsigned kBits = 32;
  /// Where the block of registers begins that `registers` gives access to.
  static constexpr std::uintptr_t kBase = 0xE000'0000;

  constexpr explicit CycleCounter(R registers) noexcept : registers_(std::move(registers)) {}

  /// Switches the counter on. False: there is none, or it does not count. Set-up; some ten register accesses. On
  /// Cortex-M0 and M0+, where nothing answers at these addresses, it must not be called.
  [[nodiscard]] bool start() noexcept {
    registers_.write32(kDebugControl, registers_.read32(kDebugControl) | kTraceEnable);
    registers_.write32(kLock, kUnlock);  // Cortex-M7; the others ignore it
    const std::uint32_t control = registers_.read32(kControl);
    if ((control & kNoCounter) != 0) return false;
    registers_.write32(kControl, control | kCount);
    const std::uint32_t before = read();
    constexpr int kReads = 8;  // each takes a cycle or more
    for (int i = 0; i < kReads; ++i)
      if (read() != before) return true;
    return false;
  }

  [[nodiscard]] std::uint32_t read() noexcept { return registers_.read32(kCycles); }

 private:
  // Offsets.
  static constexpr std::size_t kControl = 0x1000;
  static constexpr std::size_t kCycles = 0x1004;
  static constexpr std::size_t kLock = 0x1FB0;
  static constexpr std::size_t kDebugControl = 0xEDFC;

  static constexpr std::uint32_t kCount = 1U << 0;
  static constexpr std::uint32_t kNoCounter = 1U << 25;
  static constexpr std::uint32_t kTraceEnable = 1U << 24;
  static constexpr std::uint32_t kUnlock = 0xC5AC'CE55;

  R registers_;
};

/// Time by the core's clock: CycleCounterClock<VolatileRegisters> clock(CycleCounter(VolatileRegisters(kBase)), hz);
/// if (!clock.counter().start()) ...; clock.start(). At 170 MHz now() must be called every 25 s.
template <RegisterAccess R>
using CycleCounterClock = TimerClock<CycleCounter<R>>;

}  // namespace tm485::mcu
