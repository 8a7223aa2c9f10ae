// LatestValue, TripleBuffer and FourSlot: the newest value, never half of one, never an older one after a newer.
#include "tm485/sync/latest_value.hpp"

#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "tm485/motion/sample.hpp"

namespace tm485 {
namespace {

/// Big enough to be torn, and able to tell.
struct Payload {
  std::uint64_t number = 0;
  std::array<std::uint64_t, 6> body{};
  std::uint64_t sum = 0;

  static std::uint64_t mix(std::uint64_t x) { return (x ^ (x >> 29)) * 0x9E3779B97F4A7C15ULL; }
  static Payload of(std::uint64_t number) {
    Payload payload;
    payload.number = number;
    for (std::size_t i = 0; i < payload.body.size(); ++i)
      payload.sum += payload.body[i] = mix(number * 8 + i);
    return payload;
  }
  [[nodiscard]] bool whole() const {
    std::uint64_t expected = 0;
    for (std::size_t i = 0; i < body.size(); ++i) {
      if (number != 0 && body[i] != mix(number * 8 + i)) return false;
      expected += body[i];
    }
    return sum == expected;
  }
};

template <class Buffer>
class LatestValueTest : public testing::Test {};
using Buffers = testing::Types<TripleBuffer<Payload>, FourSlot<Payload>, LatestValue<Payload>>;
TYPED_TEST_SUITE(LatestValueTest, Buffers);

TYPED_TEST(LatestValueTest, IsEmptyBeforeTheFirst) {
  TypeParam buffer;
  EXPECT_EQ(buffer.get().number, 0U);
  EXPECT_EQ(buffer.get().number, 0U);
}

TYPED_TEST(LatestValueTest, GivesTheNewestHoweverManyWerePut) {
  TypeParam buffer;
  std::uint64_t number = 0;
  for (int puts = 1; puts < 20; ++puts) {
    for (int i = 0; i < puts; ++i) buffer.put(Payload::of(++number));
    ASSERT_EQ(buffer.get().number, number);
    ASSERT_EQ(buffer.get().number, number) << "and again, until there is a newer one";
    ASSERT_TRUE(buffer.get().whole());
  }
}

TYPED_TEST(LatestValueTest, AReferenceStaysGoodUntilTheNextGet) {
  TypeParam buffer;
  buffer.put(Payload::of(1));
  const Payload& first = buffer.get();
  for (std::uint64_t number = 2; number < 50; ++number) {
    buffer.put(Payload::of(number));
    ASSERT_EQ(first.number, 1U) << number;
    ASSERT_TRUE(first.whole());
  }
  EXPECT_EQ(buffer.get().number, 49U);
}

TYPED_TEST(LatestValueTest, ADraftIsInvisibleUntilItIsPublished) {
  TypeParam buffer;
  buffer.put(Payload::of(1));
  for (std::uint64_t number = 2; number < 20; ++number) {
    buffer.draft() = Payload::of(number);
    ASSERT_EQ(buffer.get().number, number - 1);
    buffer.publish();
    ASSERT_EQ(buffer.get().number, number);
    ASSERT_TRUE(buffer.get().whole());
  }
}

TYPED_TEST(LatestValueTest, IsNeverTornAndNeverGoesBackBetweenTwoThreads) {
  constexpr std::uint64_t kPuts = 500'000;
  TypeParam buffer;
  std::atomic<bool> reading{false};
  std::thread writer([&] {
    while (!reading.load()) std::this_thread::yield();
    for (std::uint64_t number = 1; number <= kPuts; ++number) buffer.put(Payload::of(number));
  });
  reading.store(true);
  std::uint64_t last = 0;
  std::uint64_t torn = 0;
  std::uint64_t backwards = 0;
  while (last < kPuts) {
    const Payload& value = buffer.get();
    const std::uint64_t number = value.number;
    torn += value.whole() && value.number == number ? 0U : 1U;
    backwards += number < last ? 1U : 0U;
    last = number;
    if (torn + backwards > 0) break;
  }
  writer.join();
  EXPECT_EQ(torn, 0U);
  EXPECT_EQ(backwards, 0U);
  EXPECT_EQ(buffer.get().number, kPuts);
}

static_assert(std::is_same_v<LatestValue<Sample>, TripleBuffer<Sample>>);

}  // namespace
}  // namespace tm485
