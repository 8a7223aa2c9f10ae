// The group's schedule, with members that ask for whatever a test wants.
#include "tm485/bus/bus_group.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <deque>
#include <functional>
#include <memory>
#include <vector>

#include "support/frames.hpp"
#include "support/print.hpp"

namespace tm485 {
namespace {

using test::ms;
using test::ns;
using test::us;
using testing::ElementsAre;

/// Answers what a function says, and remembers when it was polled.
struct Asker {
  std::function<Time(Time)> answer = [](Time) { return kNever; };
  std::vector<Time> polled;

  Time poll(Time now) noexcept {
    polled.push_back(now);
    return answer(now);
  }
};

template <class Group>
void run(Group& group, Time& now, Time end) {
  for (;;) {
    const Time due = group.poll(now);
    if (due > end) break;
    now = std::max(now, due);
  }
  now = end;
}

// Spans from 1 ns to a second, so that members go through heap, wheel and heap again; all at the first instant.
TEST(BusGroup, EveryMemberIsPolledExactlyWhenItAskedToBe) {
  constexpr std::size_t kMembers = 300;
  BusGroup<Asker, kMembers> group;
  test::Rng rng(1);
  std::deque<Asker> members(kMembers);
  std::vector<Time> asked(kMembers, Time{0});
  std::uint64_t wrong = 0;
  for (std::size_t i = 0; i < kMembers; ++i) {
    members[i].answer = [&, i](Time now) {
      if (now != asked[i]) ++wrong;
      constexpr std::uint64_t kSpans[] = {2, 300, 20'000, 131'072, 140'000, 10'000'000};
      const std::uint64_t span = i == 0 ? 1'000'000'000 : kSpans[rng() % std::size(kSpans)];
      asked[i] = now + Time{static_cast<std::int64_t>(1 + rng() % span)};
      return asked[i];
    };
    ASSERT_EQ(group.add(members[i]), i);
  }
  Time now{0};
  run(group, now, ms(100));
  EXPECT_EQ(wrong, 0U);
  EXPECT_EQ(group.latest_poll(), ns(0));
  for (std::size_t i = 0; i < kMembers; ++i) {
    EXPECT_GT(asked[i], ms(100)) << i << " was left out";
    EXPECT_GT(members[i].polled.size(), i == 0 ? 0U : 10U) << i;
  }
}

TEST(BusGroup, ALateOwnerPollsInTheOrderOfTheDueTimesAndAFewAtOnce) {
  BusGroup<Asker, 4> group({.at_once = 2});
  std::deque<Asker> members(4);
  std::vector<std::size_t> order;
  constexpr Time kDue[] = {us(70), us(30), us(200), us(50)};
  for (std::size_t i = 0; i < 4; ++i) {
    members[i].answer = [&, i](Time now) {
      if (now == Time{0}) return kDue[i];
      order.push_back(i);
      return kNever;
    };
    ASSERT_TRUE(group.add(members[i]));
  }
  EXPECT_EQ(group.poll(ns(0)), ns(0)) << "two more are due";
  EXPECT_EQ(group.poll(ns(0)), us(30));
  EXPECT_EQ(group.poll(us(300)), us(300));
  EXPECT_THAT(order, ElementsAre(1, 3));
  EXPECT_EQ(group.poll(us(301)), kNever);
  EXPECT_THAT(order, ElementsAre(1, 3, 0, 2));
  EXPECT_EQ(group.latest_poll(), us(270)) << "what was due at 30 us";
}

TEST(BusGroup, AMemberThatAlwaysWantsToBePolledKeepsNobodyFromIt) {
  BusGroup<Asker, 3> group({.at_once = 1});
  std::deque<Asker> members(3);
  members[0].answer = [](Time now) { return now; };
  members[1].answer = [](Time now) { return now - us(50); };
  members[2].answer = [](Time now) { return now + us(10); };
  for (Asker& member : members) ASSERT_TRUE(group.add(member));
  Time now{0};
  for (int i = 0; i < 30'000; ++i) {
    (void)group.poll(now);
    now += ns(10);  // 300 us
  }
  EXPECT_GE(members[2].polled.size(), 29U);
  EXPECT_GE(members[1].polled.size(), 14'000U);
  EXPECT_GE(members[0].polled.size(), 14'000U);
}

TEST(BusGroup, NoMemberIsPolledTwiceInOneCall) {
  BusGroup<Asker, 1> group;
  Asker member;
  member.answer = [](Time now) { return now; };
  ASSERT_TRUE(group.add(member));
  EXPECT_EQ(group.poll(us(5)), us(5) + ns(1));
  EXPECT_EQ(member.polled.size(), 1U);
}

TEST(BusGroup, OneTooManyIsRefused) {
  BusGroup<Asker, 2> group;
  Asker members[3];
  EXPECT_EQ(group.add(members[0]), 0U);
  EXPECT_EQ(group.add(members[1]), 1U);
  EXPECT_EQ(group.add(members[2]).error(), Errc::bad_state);
  EXPECT_EQ(group.size(), group.capacity());
  EXPECT_EQ(group.poll(us(1)), kNever);
  EXPECT_EQ(members[1].polled.size(), 1U);
  EXPECT_TRUE(members[2].polled.empty());
}

TEST(BusGroup, AnEmptyGroupWantsNothing) {
  BusGroup<Asker, 2> group;
  EXPECT_EQ(group.poll(us(1)), kNever);
}

// From the wheel (alone, first, middle and last of its span), from the heap, and from nowhere.
TEST(BusGroup, AMemberThatIsWokenIsPolledWithTheNextCallAndNotWhenItWouldHaveBeen) {
  constexpr Time kSpan{2'048};  // of a wheel for so few
  const Time base = kSpan * 20;
  const Time dues[] = {base + ns(10), base + ns(20), base + ns(30), base + kSpan * 9, ms(7), kNever};
  for (std::size_t woken = 0; woken < std::size(dues); ++woken) {
    BusGroup<Asker, 6> group;
    std::deque<Asker> members(6);
    for (std::size_t i = 0; i < 6; ++i) {
      members[i].answer = [&, i](Time now) { return now == Time{0} ? dues[i] : kNever; };
      ASSERT_TRUE(group.add(members[i]));
    }
    EXPECT_EQ(group.poll(ns(0)), dues[0]);
    group.wake(woken);
    EXPECT_LE(group.poll(us(1)), dues[woken == 0 ? 1 : 0]);
    EXPECT_THAT(members[woken].polled, ElementsAre(ns(0), us(1))) << woken;
    Time now = us(1);
    run(group, now, ms(10));
    for (std::size_t i = 0; i < 6; ++i) {
      std::vector<Time> expected = {ns(0)};
      if (i == woken) expected.push_back(us(1));
      if (i != woken && dues[i] != kNever) expected.push_back(dues[i]);
      EXPECT_EQ(members[i].polled, expected) << i << " with " << woken;
    }
  }
}

TEST(BusGroup, MembersOfOneSpanCanBeWokenInAnyOrder) {
  std::vector<std::size_t> order = {0, 1, 2};
  do {
    BusGroup<Asker, 4> group;
    std::deque<Asker> members(4);
    for (std::size_t i = 0; i < 4; ++i) {
      members[i].answer = [i](Time now) {
        if (now != Time{0}) return kNever;
        if (i == 3) return us(20);  // in front, so that the span of the others stays in the wheel
        return us(41) + ns(static_cast<int>(i));
      };
      ASSERT_TRUE(group.add(members[i]));
    }
    Time now{0};
    EXPECT_EQ(group.poll(now), us(20));
    for (const std::size_t index : order) {
      now += us(1);
      group.wake(index);
      (void)group.poll(now);
      EXPECT_EQ(members[index].polled.back(), now);
    }
    run(group, now, ms(1));
    for (const Asker& member : members) EXPECT_EQ(member.polled.size(), 2U);
  } while (std::next_permutation(order.begin(), order.end()));
}

// Whoever was woken has a place elsewhere from then on; the others are still where they were.
TEST(BusGroup, OneThatIsWokenOutOfASpanLeavesTheOthersInIt) {
  for (std::size_t woken = 0; woken < 3; ++woken) {
    BusGroup<Asker, 4> group;
    std::deque<Asker> members(4);
    for (std::size_t i = 0; i < 4; ++i) {
      members[i].answer = [i](Time now) {
        if (now == Time{0}) return i == 3 ? us(20) : us(41) + ns(static_cast<int>(i));  // three in one span
        return now == us(1) ? us(100) : kNever;
      };
      ASSERT_TRUE(group.add(members[i]));
    }
    Time now{0};
    EXPECT_EQ(group.poll(now), us(20));
    group.wake(woken);
    now = us(1);
    (void)group.poll(now);
    run(group, now, ms(1));
    for (std::size_t i = 0; i < 3; ++i) {
      const Time due = us(41) + ns(static_cast<int>(i));
      const std::vector<Time> expected =
          i == woken ? std::vector{ns(0), us(1), us(100)} : std::vector{ns(0), due};
      EXPECT_EQ(members[i].polled, expected) << i << " with " << woken;
    }
  }
}

// Its neighbour of before is not that of the next span.
TEST(BusGroup, AMemberWithANewPlaceIsWokenFromThere) {
  BusGroup<Asker, 3> group;
  std::deque<Asker> members(3);
  for (std::size_t i = 0; i < 3; ++i) {
    members[i].answer = [i](Time now) {
      if (now == Time{0}) return i == 2 ? us(20) : us(41) + ns(static_cast<int>(i));  // two in one span
      if (now < us(42))
        return i == 2 ? us(60) : us(80 + 20 * static_cast<int>(i));  // one in front of the others
      return kNever;
    };
    ASSERT_TRUE(group.add(members[i]));
  }
  Time now{0};
  run(group, now, us(50));
  group.wake(0);
  now += us(1);
  (void)group.poll(now);
  const std::size_t polled = members[0].polled.size();
  EXPECT_EQ(members[0].polled.back(), now);
  run(group, now, ms(1));
  EXPECT_EQ(members[0].polled.size(), polled) << "not when it would have been";
}

/// A bus whose reply may be there from an instant on.
struct Expecting : Asker {
  Time expected = kNever;
  Time reply_expected() const noexcept { return expected; }
};

TEST(BusGroup, AReplyIsLookedForFromTheEarliestInstantOnAgainAndAgain) {
  BusGroup<Expecting, 1> group({.look_again = ns(400)});
  Expecting member;
  member.expected = us(50);
  member.answer = [&](Time now) {
    if (now < us(51)) return us(67);  // the deadline
    member.expected = kNever;
    return now < us(90) ? us(90) : kNever;
  };
  ASSERT_TRUE(group.add(member));
  Time now{0};
  run(group, now, us(100) - ns(1));
  EXPECT_THAT(member.polled, ElementsAre(ns(0), us(50), ns(50'400), ns(50'800), ns(51'200), us(90)));
}

TEST(BusGroup, WhereThePortTellsNobodyLooks) {
  BusGroup<Expecting, 1> group({.look_again = kNever});
  Expecting member;
  member.expected = us(50);
  member.answer = [&](Time now) { return now < us(60) ? us(67) : kNever; };
  ASSERT_TRUE(group.add(member));
  EXPECT_EQ(group.poll(us(1)), us(67));
  group.wake(0);
  EXPECT_EQ(group.poll(us(52)), us(67));
  EXPECT_EQ(group.latest_poll(), ns(0)) << "who is woken was not late";
}

TEST(BusGroup, StaggeredStartsAreSpreadEvenly) {
  EXPECT_EQ(stagger(0, 4, us(100)), us(0));
  EXPECT_EQ(stagger(1, 4, us(100)), us(25));
  EXPECT_EQ(stagger(3, 4, us(100)), us(75));
  EXPECT_EQ(stagger(511, 512, ns(62'500)), ns(62'377));
  EXPECT_EQ(stagger(0, 0, us(100)), us(0));
}

TEST(LatchSkew, IsTheLatestLessTheEarliestOfARound) {
  LatchSkew skew(us(3), us(100));
  for (int round = 0; round < 3; ++round) {
    const Time due = us(3) + us(100) * round;
    skew.add(due, due + ns(40), 3);
    skew.add(due, due - ns(10), 3);
    skew.add(due, due + ns(round), 3);
  }
  EXPECT_EQ(skew.skew().count(), 3U);
  EXPECT_EQ(skew.skew().minimum(), ns(50));
  EXPECT_EQ(skew.skew().maximum(), ns(50));
  EXPECT_EQ(skew.incomplete(), 0U);
}

TEST(LatchSkew, ARoundThatLacksAMemberCountsAndSoDoRoundsThatNobodyAnswered) {
  LatchSkew skew(us(0), us(100));
  skew.add(us(100), us(100), 2);
  skew.add(us(200), us(200), 2);
  EXPECT_EQ(skew.incomplete(), 1U);
  EXPECT_EQ(skew.skew().count(), 1U) << "of those that answered";
  skew.add(us(200), us(201), 2);
  skew.add(us(500), us(500), 2);
  EXPECT_EQ(skew.incomplete(), 3U) << "300 and 400 us";
  skew.add(us(200), us(200), 2);
  EXPECT_EQ(skew.incomplete(), 3U) << "that round is over";
  EXPECT_EQ(skew.skew().maximum(), us(1));
}

TEST(LatchSkew, StepsBesideTheGridDoNotCount) {
  LatchSkew skew(us(7), us(100));
  skew.add(us(107), us(107), 1);
  skew.add(us(147), us(149), 1);
  skew.add(us(187), us(187), 1);
  skew.add(us(207), us(207), 1);
  EXPECT_EQ(skew.skew().count(), 2U);
  EXPECT_EQ(skew.skew().maximum(), us(0));
  EXPECT_EQ(skew.incomplete(), 0U);
}

}  // namespace
}  // namespace tm485
