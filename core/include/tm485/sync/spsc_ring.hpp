// SpscRing: a queue of fixed capacity from one producer to one consumer; neither ever waits.
//
// Two counters that only grow: what was pushed and what was popped. Each side writes its own and
// keeps a copy of the other's, so that it reads shared memory only when the copy no longer tells
// enough. Atomic loads and stores of 32 bits are all it needs. The argument is in docs/concurrency.md.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "tm485/sync/atomics.hpp"

namespace tm485 {

/// Capacity N, a power of two up to 2^31. The ring holds the storage; one Producer and one Consumer, each made
/// once and owned by one context (a thread or an interrupt), do the work.
template <class T, std::uint32_t N, class Atomics = StdAtomics>
class SpscRing {
  static_assert(N != 0 && (N & (N - 1)) == 0 && N <= (1U << 31), "the capacity is a power of two");

 public:
  class Producer;
  class Consumer;

  SpscRing() = default;
  SpscRing(const SpscRing&) = delete;
  SpscRing& operator=(const SpscRing&) = delete;

  [[nodiscard]] static constexpr std::uint32_t capacity() noexcept { return N; }

 private:
  using Word = typename Atomics::template Atomic<std::uint32_t>;

  [[nodiscard]] T& at(std::uint32_t count) noexcept { return slots_[count & (N - 1)]; }

  alignas(Atomics::kCacheLine) Word pushed_{0U};
  alignas(Atomics::kCacheLine) Word popped_{0U};
  alignas(Atomics::kCacheLine) std::array<T, N> slots_{};
};

/// Constant time for one item, linear in the batch for many; never blocks.
template <class T, std::uint32_t N, class Atomics>
class alignas(Atomics::kCacheLine) SpscRing<T, N, Atomics>::Producer {
 public:
  /// `ring` must outlive the producer and have no other.
  explicit Producer(SpscRing& ring) noexcept : ring_(&ring) {}

  /// True if the item was taken, false if the ring is full.
  [[nodiscard]] bool try_push(const T& item) noexcept { return try_push(std::span<const T>(&item, 1)) == 1; }

  /// Takes as many from the front of `items` as there is room for; answers how many.
  std::size_t try_push(std::span<const T> items) noexcept {
    const auto wanted = static_cast<std::uint32_t>(std::min<std::size_t>(items.size(), N));
    if (N - (pushed_ - popped_seen_) < wanted) {
      // acquire: pairs with the release in Consumer, so that the consumer has done with the slots it gave back.
      popped_seen_ = ring_->popped_.load(Atomics::kAcquire);
    }
    const std::uint32_t count = std::min(wanted, N - (pushed_ - popped_seen_));
    for (std::uint32_t i = 0; i < count; ++i) ring_->at(pushed_ + i) = items[i];
    pushed_ += count;
    // release: pairs with the acquire in Consumer, so that it sees the items before the count.
    if (count != 0) ring_->pushed_.store(pushed_, Atomics::kRelease);
    return count;
  }

 private:
  SpscRing* ring_;
  std::uint32_t pushed_ = 0;
  std::uint32_t popped_seen_ = 0;
};

/// Constant time for one item, linear in the batch for many; never blocks.
template <class T, std::uint32_t N, class Atomics>
class alignas(Atomics::kCacheLine) SpscRing<T, N, Atomics>::Consumer {
 public:
  /// `ring` must outlive the consumer and have no other.
  explicit Consumer(SpscRing& ring) noexcept : ring_(&ring) {}

  /// True if an item was there; it is then in `item`.
  [[nodiscard]] bool try_pop(T& item) noexcept { return try_pop(std::span<T>(&item, 1)) == 1; }

  /// Moves as many items as there are, and as `items` holds, to its front; answers how many.
  std::size_t try_pop(std::span<T> items) noexcept {
    const auto wanted = static_cast<std::uint32_t>(std::min<std::size_t>(items.size(), N));
    if (pushed_seen_ - popped_ < wanted) {
      // acquire: pairs with the release in Producer, so that the items are there.
      pushed_seen_ = ring_->pushed_.load(Atomics::kAcquire);
    }
    const std::uint32_t count = std::min(wanted, pushed_seen_ - popped_);
    for (std::uint32_t i = 0; i < count; ++i) items[i] = ring_->at(popped_ + i);
    popped_ += count;
    // release: pairs with the acquire in Producer, so that our reads are over before it reuses the slots.
    if (count != 0) ring_->popped_.store(popped_, Atomics::kRelease);
    return count;
  }

 private:
  SpscRing* ring_;
  std::uint32_t popped_ = 0;
  std::uint32_t pushed_seen_ = 0;
};

}  // namespace tm485
