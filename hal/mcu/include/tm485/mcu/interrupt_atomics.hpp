// The atomics of what an interrupt and the context that it interrupts share, on one core.
#pragma once

#include <atomic>
#include <cstddef>

#include "tm485/sync/atomics.hpp"

namespace tm485::mcu {

/// As StdAtomics, on one core: only loads and stores are used with it (Cortex-M0 has nothing more), and nothing is spread
/// over cache lines.
struct InterruptAtomics : StdAtomics {
  static constexpr std::size_t kCacheLine = alignof(void*);

  /// Keeps the compiler from moving accesses across it; one core sees its own in order.
  static void fence() noexcept { std::atomic_signal_fence(std::memory_order_seq_cst); }
};

}  // namespace tm485::mcu
