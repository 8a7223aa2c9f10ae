// SharedLatest: its steps one by one, through an atomics policy that calls back at each fence, and several readers
// in threads.
#include "tm485/sync/shared_latest.hpp"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <functional>
#include <optional>
#include <thread>
#include <vector>

#include "sync/checked.hpp"

namespace tm485::test {
namespace {

/// Calls back at each fence: in put() before the first word, in try_get() after the last.
struct SteppedAtomics : StdAtomics {
  static inline std::function<void(std::memory_order)> on_fence;

  static void fence(std::memory_order order) {
    StdAtomics::fence(order);
    if (on_fence) on_fence(order);
  }
};

class SharedLatestSteps : public testing::Test {
 protected:
  ~SharedLatestSteps() override { SteppedAtomics::on_fence = nullptr; }

  SharedLatest<Checked, SteppedAtomics> shared_;
};

TEST_F(SharedLatestSteps, IsEmptyBeforeTheFirst) {
  Checked value = Checked::of(99);
  ASSERT_TRUE(shared_.try_get(value));
  EXPECT_EQ(value.number(), 0U);
  EXPECT_TRUE(value.whole());
}

TEST_F(SharedLatestSteps, GivesTheNewest) {
  for (std::uint64_t number = 1; number < 100; ++number) {
    shared_.put(Checked::of(number));
    Checked value;
    ASSERT_TRUE(shared_.try_get(value, 1));
    ASSERT_EQ(value.number(), number);
    ASSERT_TRUE(value.whole());
  }
}

TEST_F(SharedLatestSteps, FailsInsteadOfWaitingWhileTheWriterIsAtWork) {
  shared_.put(Checked::of(1));
  std::optional<bool> got;
  Checked value = Checked::of(7);
  SteppedAtomics::on_fence = [&](std::memory_order order) {
    if (order == std::memory_order_release) got = shared_.try_get(value, 1'000);
  };
  shared_.put(Checked::of(2));
  EXPECT_EQ(got, false);
  EXPECT_EQ(value.number(), 7U) << "and leaves the caller's value alone";
  SteppedAtomics::on_fence = nullptr;
  ASSERT_TRUE(shared_.try_get(value, 1));
  EXPECT_EQ(value.number(), 2U);
}

TEST_F(SharedLatestSteps, TriesAgainAfterAWriterCameBetween) {
  shared_.put(Checked::of(1));
  int copies = 0;
  SteppedAtomics::on_fence = [&](std::memory_order order) {
    if (order == std::memory_order_acquire && ++copies == 1) shared_.put(Checked::of(2));
  };
  Checked value;
  ASSERT_TRUE(shared_.try_get(value, 2));
  EXPECT_EQ(copies, 2);
  EXPECT_EQ(value.number(), 2U);
}

TEST_F(SharedLatestSteps, GivesUpAfterTheGivenNumberOfTries) {
  for (const unsigned tries : {0U, 1U, 3U, 8U}) {
    unsigned copies = 0;
    std::uint64_t number = 0;
    SteppedAtomics::on_fence = [&](std::memory_order order) {
      if (order != std::memory_order_acquire) return;
      ++copies;
      shared_.put(Checked::of(++number));
    };
    Checked value;
    EXPECT_FALSE(shared_.try_get(value, tries));
    EXPECT_EQ(copies, tries);
  }
}

TEST(SharedLatestStress, SeveralReadersSeeWholeValuesThatNeverGoBack) {
  constexpr std::uint64_t kPuts = 50'000;
  constexpr std::size_t kReaders = 3;
  const auto shared = on_heap<SharedLatest<Checked>>();
  std::atomic<std::size_t> ready{0};
  std::atomic<bool> done{false};
  std::array<Findings, kReaders> findings;
  std::vector<std::thread> readers;
  for (Findings& found : findings) {
    readers.emplace_back([&] {
      ready.fetch_add(1);
      Findings own;
      while (!done.load()) {
        Checked value;
        if (shared->try_get(value))
          own.see(value);
        else
          std::this_thread::yield();
      }
      Checked value;
      if (shared->try_get(value, 1)) own.see(value);  // nobody writes any more: the first try succeeds
      found = own;
    });
  }
  while (ready.load() != kReaders) std::this_thread::yield();
  Dice dice(5);
  for (std::uint64_t number = 1; number <= kPuts; ++number) {
    shared->put(Checked::of(number));
    if (dice.roll(512) == 0) std::this_thread::yield();
  }
  done.store(true);
  for (std::thread& reader : readers) reader.join();
  for (const Findings& found : findings) {
    EXPECT_EQ(found.torn, 0U);
    EXPECT_EQ(found.backwards, 0U);
    EXPECT_EQ(found.last, kPuts);
  }
}

}  // namespace
}  // namespace tm485::test
