// The queue of background exchanges: classes, their order, waiting, and that nothing offered is lost.
#include <gtest/gtest.h>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "tm485/bus/background.hpp"

namespace tm485 {
namespace {

using test::error_of;

const Request kReset = *Request::make(DataId::reset_errors);
const Request kRead = *Request::eeprom_read(5);
const Request kEnid = *Request::make(DataId::encoder_id);

TEST(BackgroundQueue, TheClassFollowsFromTheId) {
  EXPECT_EQ(priority_of(kReset), Priority::reset_run);
  EXPECT_EQ(priority_of(*Request::make(DataId::reset_single_turn)), Priority::reset_run);
  EXPECT_EQ(priority_of(*Request::make(DataId::reset_multi_turn)), Priority::reset_run);
  EXPECT_EQ(priority_of(kRead), Priority::eeprom);
  EXPECT_EQ(priority_of(*Request::eeprom_write(1, 2)), Priority::eeprom);
  for (const DataId id : {DataId::single_turn, DataId::multi_turn, DataId::encoder_id, DataId::everything})
    EXPECT_EQ(priority_of(*Request::make(id)), Priority::diagnostics);
}

TEST(BackgroundQueue, TheMostUrgentIsNext) {
  BackgroundQueue queue;
  EXPECT_EQ(queue.next(), nullptr);
  ASSERT_TRUE(queue.offer(kEnid, 1));
  EXPECT_EQ(queue.next()->id(), DataId::encoder_id);
  ASSERT_TRUE(queue.offer(kRead, 2));
  EXPECT_EQ(queue.next()->id(), DataId::eeprom_read);
  EXPECT_FALSE(queue.has_reset());
  ASSERT_TRUE(queue.offer(kReset, 3));
  EXPECT_EQ(queue.next()->id(), DataId::reset_errors);
  EXPECT_TRUE(queue.has_reset());
}

TEST(BackgroundQueue, APlaceIsTakenUntilItsCompletionIs) {
  BackgroundQueue queue;
  ASSERT_TRUE(queue.offer(kRead, 7));
  EXPECT_EQ(error_of(queue.offer(kRead, 8)), Errc::busy);
  EXPECT_FALSE(queue.take()) << "it is not done";
  queue.complete(Priority::eeprom, std::unexpected(Errc::timeout));
  EXPECT_EQ(queue.next(), nullptr);
  EXPECT_EQ(error_of(queue.offer(kRead, 8)), Errc::busy) << "its completion was not taken";
  queue.complete(Priority::eeprom, std::unexpected(Errc::crc_error));  // twice: the first one holds
  const auto completion = queue.take();
  ASSERT_TRUE(completion);
  EXPECT_EQ(completion->ticket, 7U);
  EXPECT_EQ(completion->request.address(), 5U);
  EXPECT_EQ(error_of(completion->result), Errc::timeout);
  EXPECT_FALSE(queue.take()) << "once";
  EXPECT_TRUE(queue.offer(kRead, 8));
}

TEST(BackgroundQueue, AgedDiagnosticsGoBeforeAStreamOfEeprom) {
  BackgroundQueue queue;
  ASSERT_TRUE(queue.offer(kEnid, 1));
  int slots = 0;
  ASSERT_TRUE(queue.offer(kRead, 2));
  for (; slots < 100; ++slots) {
    if (queue.next()->id() == DataId::encoder_id) break;
    queue.complete(Priority::eeprom, std::unexpected(Errc::timeout));
    (void)queue.take();
    ASSERT_TRUE(queue.offer(kRead, 2));
    EXPECT_FALSE(queue.on_slot_passed(64));
  }
  EXPECT_EQ(slots, BackgroundQueue::kAged);
}

TEST(BackgroundQueue, WaitingHasAnEnd) {
  BackgroundQueue queue;
  ASSERT_TRUE(queue.offer(kRead, 1));
  for (int i = 1; i < 64; ++i) EXPECT_FALSE(queue.on_slot_passed(64));
  EXPECT_EQ(queue.waited(Priority::eeprom), 63U);
  EXPECT_EQ(queue.on_slot_passed(64), Priority::eeprom);
}

TEST(BackgroundQueue, EverythingThatWaitsEnds) {
  BackgroundQueue queue;
  ASSERT_TRUE(queue.offer(kReset, 1));
  ASSERT_TRUE(queue.offer(kRead, 2));
  ASSERT_TRUE(queue.offer(kEnid, 3));
  queue.complete_all(Errc::bad_state, Priority::eeprom, Errc::abandoned);
  const Errc expected[] = {Errc::bad_state, Errc::abandoned, Errc::bad_state};
  for (std::uint32_t i = 0; i < 3; ++i) {
    const auto completion = queue.take();
    ASSERT_TRUE(completion);
    EXPECT_EQ(completion->ticket, i + 1);
    EXPECT_EQ(error_of(completion->result), expected[i]);
  }
  EXPECT_FALSE(queue.take());
}

}  // namespace
}  // namespace tm485
