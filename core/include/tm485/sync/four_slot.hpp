// FourSlot: the newest value from one writer to one reader, with atomic loads and stores only.
//
// Simpson's four-slot mechanism ("Four-slot fully asynchronous communication mechanism", IEE
// Proceedings 137 E, 1990): two pairs of two slots. The writer writes into the pair that the reader
// does not announce, and there into the slot that is not the newest; the reader announces the newest
// pair before it looks which of its slots is the newest. So both never touch the same slot at once.
// For ARMv6-M (Cortex-M0, M0+), which has no atomic read-modify-write. The argument is in
// docs/concurrency.md.
#pragma once

#include <array>
#include <cstdint>

#include "tm485/sync/atomics.hpp"

namespace tm485 {

/// One writer context, one reader context; they may be threads or interrupts of any priority.
template <class T, class Atomics = StdAtomics>
class FourSlot {
 public:
  /// Writer. Replaces the newest value. One copy of T, two loads, two stores.
  void put(const T& value) noexcept {
    draft() = value;
    publish();
  }

  /// Writer. The slot that the next publish() makes the newest value: fill it in place. It holds some
  /// older value; every part of it must be written, and publish() must follow before the next draft().
  [[nodiscard]] T& draft() noexcept {
    // seq_cst throughout: the argument needs one order of the announcements that both sides agree on.
    // reading_ pairs with its store in get().
    pair_ = static_cast<std::uint32_t>(reading_.load(Atomics::kSeqCst)) ^ 1U;
    slot_ = static_cast<std::uint32_t>(newest_[pair_].load(Atomics::kSeqCst)) ^ 1U;
    return slots_[pair_][slot_];
  }

  /// Writer. The draft becomes the newest value.
  void publish() noexcept {
    newest_[pair_].store(slot_, Atomics::kSeqCst);  // pairs with the load in get()
    latest_.store(pair_, Atomics::kSeqCst);         // pairs with the load in get()
  }

  /// Reader. The newest value, or T{} before the first. The reference stays good until the next get().
  [[nodiscard]] const T& get() noexcept {
    const auto pair = static_cast<std::uint32_t>(latest_.load(Atomics::kSeqCst));
    reading_.store(pair, Atomics::kSeqCst);  // pairs with the load in draft()
    const auto slot = static_cast<std::uint32_t>(newest_[pair].load(Atomics::kSeqCst));
    return slots_[pair][slot];
  }

 private:
  using Word = typename Atomics::template Atomic<std::uint32_t>;

  std::array<std::array<T, 2>, 2> slots_{};
  std::array<Word, 2> newest_{{Word{0U}, Word{0U}}};
  Word latest_{0U};
  Word reading_{0U};
  std::uint32_t pair_ = 0;  ///< writer: where the draft is
  std::uint32_t slot_ = 0;
};

}  // namespace tm485
