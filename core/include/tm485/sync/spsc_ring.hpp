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

  /// How many of `count` slots from `begin` on come before the end of the storage; the others are at its beginning.
  [[nodiscard]] static constexpr std::uint32_t before_seam(std::uint32_t begin,
                                                           std::uint32_t count) noexcept {
    return std::min(count, N - (begin & (N - 1)));
  }

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
  [[nodiscard]] bool try_push(const T& item) noexcept {
    if (room_for(1) == 0) return false;
    ring_->at(pushed_) = item;
    publish(1);
    return true;
  }

  /// Takes as many from the front of `items` as there is room for; answers how many.
  std::size_t try_push(std::span<const T> items) noexcept {
    const std::uint32_t count = room_for(static_cast<std::uint32_t>(std::min<std::size_t>(items.size(), N)));
    if (count == 0) return 0;
    const std::uint32_t head = before_seam(pushed_, count);
    std::copy_n(items.data(), head, &ring_->at(pushed_));
    std::copy_n(items.data() + head, count - head, ring_->slots_.data());
    publish(count);
    return count;
  }

 private:
  /// The free slots, at most `wanted`. Looks at the consumer's count only if the last look does not tell enough.
  [[nodiscard]] std::uint32_t room_for(std::uint32_t wanted) noexcept {
    if (N - (pushed_ - popped_seen_) < wanted) {
      // acquire: pairs with the release in Consumer, so that the consumer has done with the slots it gave back.
      popped_seen_ = ring_->popped_.load(Atomics::kAcquire);
    }
    return std::min(wanted, N - (pushed_ - popped_seen_));
  }

  void publish(std::uint32_t count) noexcept {
    pushed_ += count;
    // release: pairs with the acquire in Consumer, so that it sees the items before the count.
    ring_->pushed_.store(pushed_, Atomics::kRelease);
  }

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

  /// True if an item was there; it is then in `item`. Its slot is free again at the latest after N / 8 single pops, or
  /// when all that was seen has been popped.
  [[nodiscard]] bool try_pop(T& item) noexcept {
    if (available(1) == 0) return false;
    item = ring_->at(popped_);
    ++popped_;
    if (popped_ == pushed_seen_ || popped_ - given_back_ >= kGiveBack) give_back();
    return true;
  }

  /// Moves as many items as there are, and as `items` holds, to its front; answers how many. Their slots, and all that
  /// were popped before, are free again at once.
  std::size_t try_pop(std::span<T> items) noexcept {
    const std::uint32_t count = available(static_cast<std::uint32_t>(std::min<std::size_t>(items.size(), N)));
    if (count == 0) return 0;
    const std::uint32_t head = before_seam(popped_, count);
    std::copy_n(&ring_->at(popped_), head, items.data());
    std::copy_n(ring_->slots_.data(), count - head, items.data() + head);
    popped_ += count;
    give_back();
    return count;
  }

 private:
  /// The items there are, at most `wanted`. Looks at the producer's count only if the last look does not tell enough.
  [[nodiscard]] std::uint32_t available(std::uint32_t wanted) noexcept {
    if (pushed_seen_ - popped_ < wanted) {
      // acquire: pairs with the release in Producer, so that the items are there.
      pushed_seen_ = ring_->pushed_.load(Atomics::kAcquire);
    }
    return std::min(wanted, pushed_seen_ - popped_);
  }

  void give_back() noexcept {
    given_back_ = popped_;
    // release: pairs with the acquire in Producer, so that our reads are over before it reuses the slots.
    ring_->popped_.store(popped_, Atomics::kRelease);
  }

  /// A producer that waits at a full ring gets the slots in portions: at one by one, the line of the count would go to
  /// and fro between the cores with each item.
  static constexpr std::uint32_t kGiveBack = N < 16 ? 1 : N / 8;

  SpscRing* ring_;
  std::uint32_t popped_ = 0;
  std::uint32_t given_back_ = 0;  ///< what the producer has been told of popped_
  std::uint32_t pushed_seen_ = 0;
};

}  // namespace tm485
