// The atomics that the types of this folder are made of, as a policy.
//
// The types are templates on it so that a model checker can run the very headers with its own
// atomics. Everything else uses StdAtomics and need not know.
#pragma once

#include <atomic>
#include <cstddef>

namespace tm485 {

/// The atomics of the language.
struct StdAtomics {
  template <class T>
  using Atomic = std::atomic<T>;

  static constexpr auto kRelaxed = std::memory_order_relaxed;
  static constexpr auto kAcquire = std::memory_order_acquire;
  static constexpr auto kRelease = std::memory_order_release;
  static constexpr auto kAcqRel = std::memory_order_acq_rel;
  static constexpr auto kSeqCst = std::memory_order_seq_cst;

  /// Data that two contexts write stand this far apart: the cache line of cores that have caches and share them. On a
  /// Cortex-M the contexts are interrupts of one core, so there is nothing to keep apart.
#if defined(__ARM_ARCH_PROFILE) && __ARM_ARCH_PROFILE == 'M'
  static constexpr std::size_t kCacheLine = 8;
#else
  static constexpr std::size_t kCacheLine = 64;
#endif

  static void fence(std::memory_order order) noexcept { std::atomic_thread_fence(order); }
};

}  // namespace tm485
