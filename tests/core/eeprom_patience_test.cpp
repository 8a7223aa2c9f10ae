// How long the EEPROM manager insists, and what it says when it gives up: a page or a byte that does not take, busy, silence, no
// gap. Request by request, against replies written by hand.
#include <gtest/gtest.h>

#include <array>
#include <optional>

#include "support/eeprom_by_hand.hpp"
#include "support/print.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::us;

class EepromPatience : public test::EepromByHand {};

TEST_F(EepromPatience, APageThatIsNotTakenEndsIt) {
  std::array<std::uint8_t, 3> to{};
  ASSERT_TRUE(manager->start_read(3 * 127, to));
  unsigned selects = 0;
  while (const auto request = manager->next(now = std::max(now, manager->due()))) {
    if (request->id() == DataId::eeprom_write) ++selects;
    answer(*request, 127, request->id() == DataId::eeprom_write ? request->data() : std::uint8_t{6});
  }
  EXPECT_EQ(selects, 6U);
  EXPECT_EQ(outcome().code, Errc::eeprom_page_refused);
  EXPECT_EQ(outcome().page, 3);
  EXPECT_EQ(outcome().wanted, 3);
  EXPECT_EQ(outcome().found, 6);
}

TEST_F(EepromPatience, APageThatIsAnotherEachTimeEndsIt) {
  write(9, 0x42);
  unsigned looks = 0;
  while (const auto request = manager->next(now = std::max(now, manager->due()))) {
    ASSERT_EQ(request->address(), 127U) << "nothing else";
    ASSERT_LT(looks, 1'000U) << "for ever";
    answer(*request, 127,
           request->id() == DataId::eeprom_read ? static_cast<std::uint8_t>(looks++ % 2) : request->data());
  }
  EXPECT_EQ(outcome().code, Errc::eeprom_page_refused);
  EXPECT_EQ(manager->progress().page_selects, 0U) << "where nobody knows which it is";
}

TEST_F(EepromPatience, AByteThatDoesNotTakeEndsIt) {
  write(9, 0x42);
  unsigned writes = 0;
  while (manager->active() && now < ms(60'000)) {
    const Request request = ask();
    if (request.id() == DataId::eeprom_write) ++writes;
    answer(request, request.address(),
           request.id() == DataId::eeprom_write ? request.data() : std::uint8_t{0});
    if (writes == 1 && manager->active()) {
      ASSERT_TRUE(manager->in_doubt());
      EXPECT_EQ(manager->in_doubt()->address, 9);
      EXPECT_EQ(manager->in_doubt()->pages, 0U);
    }
  }
  EXPECT_EQ(writes, 7U) << "once, and six times more";
  EXPECT_EQ(outcome().code, Errc::eeprom_mismatch);
  EXPECT_EQ(outcome().address, 9);
  EXPECT_EQ(outcome().wanted, 0x42);
  EXPECT_EQ(outcome().found, 0);
}

TEST_F(EepromPatience, BusyIsAskedAgainButNotForEver) {
  std::array<std::uint8_t, 1> to{};
  ASSERT_TRUE(manager->start_read(2, to));
  obey(ask());
  const Time begun = now;
  unsigned looks = 0;
  while (manager->active() && looks < 1'000) {
    const Request request = ask();
    ++looks;
    answer(request, static_cast<std::uint8_t>(request.address() | 0x80), 0, Errc::eeprom_busy);
    if (manager->active()) {
      EXPECT_EQ(manager->due(), now + us(500));
    }
  }
  EXPECT_EQ(looks, 201U);
  EXPECT_EQ(outcome().code, Errc::eeprom_busy);
  EXPECT_LT(now - begun, ms(200));
}

TEST_F(EepromPatience, GivesUpOnlyWhenTheEncoderHadTimeToBoot) {
  std::array<std::uint8_t, 1> to{};
  ASSERT_TRUE(manager->start_read(2, to));
  const Time begun = now;
  unsigned asked = 0;
  Time fourth{0};
  while (manager->active() && asked < 10'000) {
    if (++asked == 4) fourth = now;
    fail(ask());
  }
  EXPECT_EQ(outcome().code, Errc::timeout);
  EXPECT_EQ(fourth - begun, us(300)) << "three times at once";
  EXPECT_GT(now - begun, ms(2'000)) << "twice the power-up time";
  EXPECT_LT(now - begun, ms(2'100));
  EXPECT_EQ(manager->progress().retries, asked);
}

TEST_F(EepromPatience, ARefusalForWantOfAGapEndsItAnyOtherIsTriedAgain) {
  std::array<std::uint8_t, 1> to{};
  ASSERT_TRUE(manager->start_read(2, to));
  (void)ask();
  manager->on_refused(Errc::busy, now);
  EXPECT_TRUE(manager->active());
  (void)ask();
  manager->on_refused(Errc::no_gap, now);
  EXPECT_EQ(outcome().code, Errc::no_gap);
}

// Found by the campaign (seed 20261122, run 400956): where the gap is often a little too short, six selects that had never
// been sent were "the page register does not take the page".
TEST_F(EepromPatience, AWriteThatWasNotSentIsNoWrite) {
  for (const Errc why : {Errc::no_gap, Errc::bad_state}) {
    manager.emplace(profile, EepromKnowledge{value, known});
    page = 0;
    write(127 + 5, 0x42);
    std::array<unsigned, 2> unsent{};  // of the page register, of the byte
    while (manager->active()) {
      const Request request = ask();
      unsigned& times = unsent.at(request.address() == 127 ? 0 : 1);
      if (request.id() == DataId::eeprom_write && times < 9) {
        ++times;
        const Time before = now;
        manager->on_completion(test::failed(request, why), now += us(100));
        EXPECT_LE(manager->due(), std::max(before + us(100), now + profile.profile().boot_time_min / 8))
            << "there is no write to wait for";
      } else {
        obey(request);
      }
    }
    EXPECT_EQ(outcome().code, Errc::ok);
    EXPECT_EQ(memory[127 + 5], 0x42);
    EXPECT_EQ(manager->progress().writes, 1U);
    EXPECT_EQ(manager->progress().page_selects, 1U);
    EXPECT_EQ(manager->progress().retries, 18U);
    EXPECT_EQ(manager->progress().unconfirmed_pages, 0U) << "nothing can have gone elsewhere";
    memory[127 + 5] = 0;
  }
}

// What can be sent beside it, a look at the page, does not make it wait for ever.
TEST_F(EepromPatience, AWriteThatNeverFindsAGapEndsIt) {
  for (const bool refused : {false, true}) {
    manager.emplace(profile);
    page = 0;
    write(127 + 5, 0x42);
    const Time begun = now;
    unsigned unsent = 0;
    for (unsigned asked = 0; manager->active() && asked < 10'000; ++asked) {
      const Request request = ask();
      if (request.id() != DataId::eeprom_write) {
        obey(request);
        continue;
      }
      ++unsent;
      now += ms(40);  // some slots: by then the page has to be looked at again
      if (refused) {
        manager->on_refused(Errc::busy, now);
      } else {
        manager->on_completion(test::failed(request, Errc::no_gap), now);
      }
    }
    EXPECT_EQ(outcome().code, refused ? Errc::busy : Errc::no_gap);
    EXPECT_GT(unsent, 6U);
    EXPECT_GT(now - begun, ms(2'000)) << "twice the power-up time";
    EXPECT_LT(now - begun, ms(2'200));
    EXPECT_FALSE(manager->in_doubt());
    EXPECT_EQ(manager->progress().page_selects, 0U);
  }
}

TEST_F(EepromPatience, APlaceThatStaysTakenIsAskedForMoreAndMoreRarelyAndNotForEver) {
  std::array<std::uint8_t, 1> to{};
  ASSERT_TRUE(manager->start_read(2, to));
  const Time begun = now;
  unsigned asked = 0;
  for (; manager->active() && asked < 1'000; ++asked) {
    now = std::max(now, manager->due());
    (void)ask();
    manager->on_refused(Errc::busy, now);
  }
  EXPECT_EQ(outcome().code, Errc::busy);
  EXPECT_EQ(manager->progress().retries, asked);
  EXPECT_GT(now - begun, ms(2'000)) << "twice the power-up time";
  EXPECT_LT(now - begun, ms(2'100));
}

}  // namespace
}  // namespace tm485
