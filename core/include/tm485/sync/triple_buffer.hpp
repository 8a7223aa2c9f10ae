// TripleBuffer: the newest value from one writer to one reader, wait-free on both sides.
//
// Three slots: the writer owns one, the reader owns one, the third lies between them. Writing or
// taking a value is one exchange of the index between them, so neither side ever waits, retries or
// sees half a value. Needs an atomic exchange; see four_slot.hpp for cores that have none.
// The argument is in docs/concurrency.md.
#pragma once

#include <array>
#include <cstdint>

#include "tm485/sync/atomics.hpp"

namespace tm485 {

/// One writer context, one reader context; they may be threads or interrupts of any priority.
template <class T, class Atomics = StdAtomics>
class TripleBuffer {
 public:
  /// Writer. Replaces the newest value. One copy of T and one exchange.
  void put(const T& value) noexcept {
    draft() = value;
    publish();
  }

  /// Writer. The slot that the next publish() makes the newest value: fill it in place. It holds some
  /// older value; every part of it must be written.
  [[nodiscard]] T& draft() noexcept { return slots_[writer_].value; }

  /// Writer. The draft becomes the newest value. One exchange.
  void publish() noexcept {
    // release: pairs with the acquire in get(), so that the reader who takes this index sees the value.
    // acquire: pairs with the release in get(), so that the reader has done with the slot we take back.
    writer_ = static_cast<std::uint32_t>(between_.exchange(writer_ | kNew, Atomics::kAcqRel)) & kIndex;
  }

  /// Reader. The newest value, or T{} before the first. The reference stays good until the next get().
  [[nodiscard]] const T& get() noexcept {
    // relaxed: only a hint; the exchange orders. A value put after this load is found by the next get().
    if ((between_.load(Atomics::kRelaxed) & kNew) != 0) {
      // acquire: pairs with the release in publish(). release: pairs with the acquire in publish().
      reader_ = static_cast<std::uint32_t>(between_.exchange(reader_, Atomics::kAcqRel)) & kIndex;
    }
    return slots_[reader_].value;
  }

 private:
  static constexpr std::uint32_t kIndex = 0b011;
  static constexpr std::uint32_t kNew = 0b100;  ///< the slot between them holds a value that was not read yet

  struct alignas(alignof(T) > Atomics::kCacheLine ? alignof(T) : Atomics::kCacheLine) Slot {
    T value{};
  };

  std::array<Slot, 3> slots_{};
  alignas(Atomics::kCacheLine) std::uint32_t writer_ = 0;
  alignas(Atomics::kCacheLine) typename Atomics::template Atomic<std::uint32_t> between_{1U};
  alignas(Atomics::kCacheLine) std::uint32_t reader_ = 2;
};

}  // namespace tm485
