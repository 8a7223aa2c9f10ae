// FourSlot: the newest value from one writer to one reader, with atomic loads and stores only.
//
// Simpson's four-slot mechanism ("Four-slot fully asynchronous communication mechanism", IEE
// Proceedings 137 E, 1990): two pairs of two slots. The writer writes into the pair that the reader
// does not announce, and there into the slot that is not the newest; the reader announces the newest
// pair before it looks which of its slots is the newest. So both never touch the same slot at once.
// For ARMv6-M (Cortex-M0, M0+), which has no atomic read-modify-write.
#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <type_traits>

namespace tm485 {

/// One writer context, one reader context; they may be threads or interrupts of any priority.
template <class T>
class FourSlot {
  static_assert(std::is_trivially_copyable_v<T>);

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
    pair_ = reading_.load() ^ 1U;
    slot_ = newest_[pair_].load() ^ 1U;
    return slots_[pair_][slot_];
  }

  /// Writer. The draft becomes the newest value.
  void publish() noexcept {
    newest_[pair_].store(slot_);  // pairs with the load in get()
    latest_.store(pair_);         // pairs with the load in get()
  }

  /// Reader. The newest value, or T{} before the first. The reference stays good until the next get().
  [[nodiscard]] const T& get() noexcept {
    const std::uint8_t pair = latest_.load();
    reading_.store(pair);
    const std::uint8_t slot = newest_[pair].load();
    return slots_[pair][slot];
  }

 private:
  std::array<std::array<T, 2>, 2> slots_{};
  std::array<std::atomic<std::uint8_t>, 2> newest_{};
  std::atomic<std::uint8_t> latest_{0};
  std::atomic<std::uint8_t> reading_{0};
  std::uint8_t pair_ = 0;  ///< writer: where the draft is
  std::uint8_t slot_ = 0;
};

}  // namespace tm485
