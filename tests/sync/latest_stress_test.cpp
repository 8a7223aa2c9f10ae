// TripleBuffer and FourSlot between two threads: whole values that never go back, while both sides pause where it
// hurts most. (Behaviour in one thread: tests/core/latest_value_test.cpp.)
#include <gtest/gtest.h>

#include <atomic>
#include <thread>

#include "sync/checked.hpp"
#include "tm485/sync/four_slot.hpp"
#include "tm485/sync/triple_buffer.hpp"

namespace tm485::test {
namespace {

constexpr std::uint64_t kPuts = 200'000;

template <class Buffer>
class LatestStress : public testing::Test {};
using Buffers = testing::Types<TripleBuffer<Checked>, FourSlot<Checked>>;
TYPED_TEST_SUITE(LatestStress, Buffers);

/// Runs `write(number)` for 1 to kPuts in a second thread and `read()` in this one until that has ended.
template <class Write, class Read>
void run_together(Write write, Read read) {
  std::atomic<bool> go{false};
  std::atomic<bool> done{false};
  std::thread writer([&] {
    while (!go.load()) std::this_thread::yield();
    for (std::uint64_t number = 1; number <= kPuts; ++number) write(number);
    done.store(true);
  });
  go.store(true);
  while (!done.load()) read();
  writer.join();
}

TYPED_TEST(LatestStress, WholeAndNeverOlderUnderBurstsAndPauses) {
  const auto buffer = on_heap<TypeParam>();
  Findings findings;
  Dice writer_dice(1);
  Dice reader_dice(2);
  run_together(
      [&](std::uint64_t number) {
        buffer->put(Checked::of(number));
        if (writer_dice.roll(256) == 0) std::this_thread::yield();
      },
      [&] {
        findings.see(buffer->get());
        if (reader_dice.roll(64) == 0) std::this_thread::yield();
      });
  findings.see(buffer->get());
  EXPECT_EQ(findings.torn, 0U);
  EXPECT_EQ(findings.backwards, 0U);
  EXPECT_EQ(findings.last, kPuts) << "the first get() after the last put() gives it";
}

TYPED_TEST(LatestStress, ADraftInTheMakingIsNeverSeen) {
  const auto buffer = on_heap<TypeParam>();
  Findings findings;
  Dice dice(3);
  run_together(
      [&](std::uint64_t number) {
        Checked& draft = buffer->draft();
        for (std::size_t i = 0; i < draft.words.size(); ++i) {
          draft.words[i] = Checked::of(number).words[i];
          if (dice.roll(4096) == 0) std::this_thread::yield();  // the reader runs while half of it is written
        }
        buffer->publish();
      },
      [&] { findings.see(buffer->get()); });
  findings.see(buffer->get());
  EXPECT_EQ(findings.torn, 0U);
  EXPECT_EQ(findings.backwards, 0U);
  EXPECT_EQ(findings.last, kPuts);
}

TYPED_TEST(LatestStress, AReferenceIsLeftAloneUntilTheNextGet) {
  const auto buffer = on_heap<TypeParam>();
  Findings findings;
  std::uint64_t changed = 0;
  Dice dice(4);
  run_together([&](std::uint64_t number) { buffer->put(Checked::of(number)); },
               [&] {
                 const Checked& held = buffer->get();
                 const std::uint64_t number = held.number();
                 for (std::uint32_t looks = dice.roll(200); looks > 0; --looks) {
                   if (looks % 64 == 0) std::this_thread::yield();
                   changed += held.number() == number && held.whole() ? 0U : 1U;
                 }
                 findings.see(held);
               });
  EXPECT_EQ(changed, 0U);
  EXPECT_EQ(findings.torn, 0U);
  EXPECT_EQ(findings.backwards, 0U);
}

}  // namespace
}  // namespace tm485::test
