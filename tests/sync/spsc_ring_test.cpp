// SpscRing: its edges in one thread, its order between two, and its counters across 2^32.
#include "tm485/sync/spsc_ring.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <numeric>
#include <thread>
#include <vector>

#include "sync/checked.hpp"

namespace tm485::test {
namespace {

template <class Ring>
struct Ends {
  Ring ring;
  typename Ring::Producer producer{ring};
  typename Ring::Consumer consumer{ring};
};

template <std::uint32_t N>
void fills_and_empties() {
  Ends<SpscRing<std::uint32_t, N>> ends;
  std::uint32_t in = 0;
  std::uint32_t out = 0;
  for (std::uint32_t round = 0; round < 3 * N + 2; ++round) {  // every offset of the two counters
    std::uint32_t item = 0;
    ASSERT_FALSE(ends.consumer.try_pop(item));
    for (std::uint32_t i = 0; i < N; ++i) ASSERT_TRUE(ends.producer.try_push(in++));
    ASSERT_FALSE(ends.producer.try_push(in)) << "full";
    for (std::uint32_t i = 0; i < N; ++i) {
      ASSERT_TRUE(ends.consumer.try_pop(item));
      ASSERT_EQ(item, out++);
    }
    ASSERT_FALSE(ends.consumer.try_pop(item)) << "empty";
    ASSERT_EQ(item, out - 1) << "a failed pop leaves the caller's item alone";
    ASSERT_TRUE(ends.producer.try_push(in++));  // shifts the next round by one
    ASSERT_TRUE(ends.consumer.try_pop(item));
    ASSERT_EQ(item, out++);
  }
}

TEST(SpscRing, FillsToItsCapacityAndEmptiesInOrder) {
  fills_and_empties<1>();
  fills_and_empties<2>();
  fills_and_empties<8>();
  static_assert(SpscRing<int, 8>::capacity() == 8);
}

TEST(SpscRing, SlotsOfSinglePopsComeBackInTime) {
  constexpr std::uint32_t kCapacity = 64;
  constexpr std::uint32_t kPortion = kCapacity / 8;
  for (std::uint32_t popped = 1; popped <= kCapacity; ++popped) {
    Ends<SpscRing<std::uint32_t, kCapacity>> ends;
    std::vector<std::uint32_t> items(kCapacity);
    std::uint32_t item = 0;
    ASSERT_EQ(ends.producer.try_push(std::span<const std::uint32_t>(items)), kCapacity);
    for (std::uint32_t i = 0; i < popped; ++i) ASSERT_TRUE(ends.consumer.try_pop(item));
    const std::size_t room = ends.producer.try_push(std::span<const std::uint32_t>(items));
    EXPECT_LE(room, popped);
    EXPECT_GT(room + kPortion, popped) << "less than a portion is held back";
  }
  Ends<SpscRing<std::uint32_t, kCapacity>> ends;
  std::vector<std::uint32_t> items(kCapacity);
  std::uint32_t item = 0;
  for (int round = 0; round < 5; ++round) {  // all that is there has been popped: all room is back
    ASSERT_EQ(ends.producer.try_push(std::span<const std::uint32_t>(items).first(3)), 3U);
    for (int i = 0; i < 3; ++i) ASSERT_TRUE(ends.consumer.try_pop(item));
    ASSERT_EQ(ends.producer.try_push(std::span<const std::uint32_t>(items)), kCapacity);
    ASSERT_TRUE(ends.consumer.try_pop(item));
    ASSERT_EQ(ends.consumer.try_pop(std::span<std::uint32_t>(items).first(2)), 2U);
    ASSERT_EQ(ends.producer.try_push(std::span<const std::uint32_t>(items)), 3U)
        << "a batch gives back everything before it";
    ASSERT_EQ(ends.consumer.try_pop(std::span<std::uint32_t>(items)), kCapacity);
  }
}

TEST(SpscRing, ABatchTakesWhatFits) {
  Ends<SpscRing<std::uint32_t, 8>> ends;
  std::array<std::uint32_t, 20> in{};
  std::array<std::uint32_t, 20> out{};
  std::iota(in.begin(), in.end(), 1U);
  EXPECT_EQ(ends.producer.try_push(std::span<const std::uint32_t>{}), 0U);
  EXPECT_EQ(ends.consumer.try_pop(std::span<std::uint32_t>(out)), 0U);
  EXPECT_EQ(ends.producer.try_push(std::span<const std::uint32_t>(in).first(5)), 5U);
  EXPECT_EQ(ends.producer.try_push(std::span<const std::uint32_t>(in).subspan(5)), 3U)
      << "three of fifteen fit";
  EXPECT_EQ(ends.producer.try_push(std::span<const std::uint32_t>(in)), 0U) << "full";
  EXPECT_EQ(ends.consumer.try_pop(std::span<std::uint32_t>{}), 0U);
  EXPECT_EQ(ends.consumer.try_pop(std::span<std::uint32_t>(out).first(3)), 3U);
  EXPECT_EQ(ends.producer.try_push(std::span<const std::uint32_t>(in).subspan(8)), 3U)
      << "three came free, across the seam";
  EXPECT_EQ(ends.consumer.try_pop(std::span<std::uint32_t>(out).subspan(3)), 8U);
  EXPECT_TRUE(std::equal(out.begin(), out.begin() + 11, in.begin()));
  EXPECT_EQ(out[11], 0U) << "nothing is written beyond what was popped";
}

TEST(SpscRing, EveryBatchSizeAtEveryOffset) {
  constexpr std::uint32_t kCapacity = 8;
  for (std::uint32_t offset = 0; offset < kCapacity; ++offset) {
    for (std::uint32_t held = 0; held <= kCapacity; ++held) {
      for (std::uint32_t size = 0; size <= kCapacity + 2; ++size) {
        Ends<SpscRing<std::uint32_t, kCapacity>> ends;
        std::uint32_t item = 0;
        for (std::uint32_t i = 0; i < offset; ++i) {
          ASSERT_TRUE(ends.producer.try_push(0));
          ASSERT_TRUE(ends.consumer.try_pop(item));
        }
        for (std::uint32_t i = 0; i < held; ++i) ASSERT_TRUE(ends.producer.try_push(i));
        std::vector<std::uint32_t> batch(size);
        std::iota(batch.begin(), batch.end(), held);
        const std::size_t taken = ends.producer.try_push(std::span<const std::uint32_t>(batch));
        ASSERT_EQ(taken, std::min(size, kCapacity - held));
        std::vector<std::uint32_t> out(kCapacity + 2);
        const std::size_t count = ends.consumer.try_pop(std::span<std::uint32_t>(out));
        ASSERT_EQ(count, held + taken);
        for (std::uint32_t i = 0; i < count; ++i) ASSERT_EQ(out[i], i);
      }
    }
  }
}

/// Sends kItems through a ring of N; sides choose single items and batches at random.
template <std::uint32_t N>
void stress(std::uint32_t largest_batch) {
  constexpr std::uint64_t kItems = 200'000;
  const auto ring = on_heap<SpscRing<Checked, N>>();
  std::thread producing([&] {
    typename SpscRing<Checked, N>::Producer producer(*ring);
    Dice dice(6);
    std::vector<Checked> batch(largest_batch);
    std::uint64_t next = 1;
    while (next <= kItems) {
      const std::size_t wanted = std::min<std::size_t>(1 + dice.roll(largest_batch), kItems + 1 - next);
      for (std::size_t i = 0; i < wanted; ++i) batch[i] = Checked::of(next + i);
      const std::size_t taken = wanted == 1
                                    ? (producer.try_push(batch[0]) ? 1U : 0U)
                                    : producer.try_push(std::span<const Checked>(batch).first(wanted));
      next += taken;
      if (taken == 0) std::this_thread::yield();
    }
  });
  typename SpscRing<Checked, N>::Consumer consumer(*ring);
  Dice dice(7);
  std::vector<Checked> batch(largest_batch);
  std::uint64_t expected = 1;
  std::uint64_t wrong = 0;
  while (expected <= kItems) {
    const std::size_t room = 1 + dice.roll(largest_batch);
    const std::size_t got = room == 1 ? (consumer.try_pop(batch[0]) ? 1U : 0U)
                                      : consumer.try_pop(std::span<Checked>(batch).first(room));
    for (std::size_t i = 0; i < got; ++i, ++expected)
      wrong += batch[i].number() == expected && batch[i].whole() ? 0U : 1U;  // lost, doubled, reordered, torn
    if (got == 0) std::this_thread::yield();
  }
  producing.join();
  EXPECT_EQ(wrong, 0U);
  EXPECT_FALSE(consumer.try_pop(batch[0])) << "nothing is left over";
}

TEST(SpscRingStress, OneByOne) { stress<64>(1); }
TEST(SpscRingStress, OneByOneThroughASingleSlot) { stress<1>(1); }
TEST(SpscRingStress, BatchesAndSingles) { stress<64>(100); }
TEST(SpscRingStress, BatchesLargerThanTheRing) { stress<4>(9); }

/// The counters of a ring go round at 2^32: a byte ring gets there in full batches.
class SpscRingWrap : public testing::Test {
 protected:
  static constexpr std::uint32_t kCapacity = 1U << 18;
  using Ring = SpscRing<std::uint8_t, kCapacity>;

  /// Pushes and pops until `left` items are missing to 2^32.
  void go_to_the_brink(std::uint32_t left) {
    const std::vector<std::uint8_t> in(kCapacity, 1);
    std::vector<std::uint8_t> out(kCapacity);
    std::uint64_t rest = (std::uint64_t{1} << 32) - left;
    while (rest > 0) {
      const std::size_t size = std::min<std::uint64_t>(rest, kCapacity);
      ASSERT_EQ(ends_->producer.try_push(std::span<const std::uint8_t>(in).first(size)), size);
      ASSERT_EQ(ends_->consumer.try_pop(std::span<std::uint8_t>(out).first(size)), size);
      rest -= size;
    }
  }
  /// A prime, so that no number of slots of the ring is a whole number of its periods.
  static std::uint8_t item(std::uint64_t number) { return static_cast<std::uint8_t>(number % 251); }

  std::unique_ptr<Ends<Ring>> ends_ = on_heap<Ends<Ring>>();
};

TEST_F(SpscRingWrap, FullAndEmptyAreToldApartAcrossTheWrap) {
  ASSERT_NO_FATAL_FAILURE(go_to_the_brink(5));
  std::uint8_t out = 0;
  EXPECT_FALSE(ends_->consumer.try_pop(out));
  for (std::uint32_t i = 0; i < kCapacity; ++i) ASSERT_TRUE(ends_->producer.try_push(item(i)));
  EXPECT_FALSE(ends_->producer.try_push(1)) << "full, its counter beyond 2^32 and the other not";
  for (std::uint32_t i = 0; i < kCapacity; ++i) {
    ASSERT_TRUE(ends_->consumer.try_pop(out));
    ASSERT_EQ(out, item(i));
  }
  EXPECT_FALSE(ends_->consumer.try_pop(out));
}

TEST_F(SpscRingWrap, ThreadsCrossItInOrder) {
  constexpr std::uint64_t kItems = 300'000;
  ASSERT_NO_FATAL_FAILURE(go_to_the_brink(kItems / 2));
  std::thread producing([&] {
    Dice dice(8);
    std::vector<std::uint8_t> batch(100);
    for (std::uint64_t next = 0; next < kItems;) {
      const std::size_t wanted = std::min<std::size_t>(1 + dice.roll(100), kItems - next);
      for (std::size_t i = 0; i < wanted; ++i) batch[i] = item(next + i);
      next += ends_->producer.try_push(std::span<const std::uint8_t>(batch).first(wanted));
    }
  });
  Dice dice(9);
  std::vector<std::uint8_t> batch(100);
  std::uint64_t wrong = 0;
  for (std::uint64_t expected = 0; expected < kItems;) {
    const std::size_t got = ends_->consumer.try_pop(std::span<std::uint8_t>(batch).first(1 + dice.roll(100)));
    for (std::size_t i = 0; i < got; ++i, ++expected) wrong += batch[i] == item(expected) ? 0U : 1U;
    if (got == 0) std::this_thread::yield();
  }
  producing.join();
  EXPECT_EQ(wrong, 0U);
}

}  // namespace
}  // namespace tm485::test
