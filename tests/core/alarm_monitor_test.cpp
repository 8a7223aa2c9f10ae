// AlarmMonitor: debounce, latch, and the verified reset that alone clears it. The oracle counts each bit by itself.
#include "tm485/bus/alarm_monitor.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>

namespace tm485 {
namespace {

constexpr StatusSet kAll(0xFF, 0xFF);
constexpr StatusSet kSf(0xFF, 0);
constexpr StatusSet kHeat = StatusSet::of(StatusBit::over_heat);
constexpr StatusSet kCounting = StatusSet::of(StatusBit::counting_error);

/// Bit by bit, with a counter each.
class Oracle {
 public:
  explicit Oracle(int debounce) : debounce_(debounce) {}
  void on_startup() { off_ = {}; }
  unsigned on_reply(unsigned status, unsigned known) {
    std::array<bool, 16> news{};
    for (unsigned bit = 0; bit < 16; ++bit) {
      if ((known >> bit & 1U) == 0) continue;
      const bool set = (status >> bit & 1U) != 0;
      if (!set) off_[bit] = true;
      count_[bit] = set != live_[bit] ? count_[bit] + 1 : 0;
      if (count_[bit] == debounce_) {
        live_[bit] = set;
        count_[bit] = 0;
        news[bit] = set && off_[bit];
      }
      latched_[bit] = latched_[bit] || live_[bit];
    }
    return word(news);
  }
  [[nodiscard]] unsigned live() const { return word(live_); }
  [[nodiscard]] unsigned latched() const { return word(latched_); }

 private:
  static unsigned word(const std::array<bool, 16>& bits) {
    unsigned word = 0;
    for (unsigned bit = 0; bit < 16; ++bit) word |= static_cast<unsigned>(bits[bit]) << bit;
    return word;
  }
  int debounce_;
  std::array<int, 16> count_{};
  std::array<bool, 16> live_{};
  std::array<bool, 16> latched_{};
  std::array<bool, 16> off_{};
};

class AlarmMonitorDebounce : public testing::TestWithParam<int> {};

TEST_P(AlarmMonitorDebounce, IsThatOfSixteenCounters) {
  AlarmMonitor monitor(kAlarmsWithBattery, static_cast<std::uint8_t>(GetParam()));
  Oracle oracle(GetParam());
  std::mt19937 random(485);
  unsigned status = 0;
  for (int i = 0; i < 20'000; ++i) {
    status ^= static_cast<unsigned>(random() & random() & 0xFFFFU);  // each bit changes in one reply of four
    const StatusSet known = random() % 3 == 0 ? kSf : kAll;
    if (random() % 16 == 0) {
      monitor.on_startup();
      oracle.on_startup();
    }
    const StatusSet news = monitor.on_reply(StatusSet(static_cast<std::uint16_t>(status)), known);
    ASSERT_EQ(news.bits(), oracle.on_reply(status, known.bits())) << i;
    ASSERT_EQ(monitor.live().bits(), oracle.live()) << i;
    ASSERT_EQ(monitor.latched().bits(), oracle.latched()) << i;
  }
  EXPECT_EQ(oracle.latched(), 0xFFFFU) << "every bit was set at some time";
}

INSTANTIATE_TEST_SUITE_P(Debounces, AlarmMonitorDebounce, testing::Values(1, 2, 3, 4));

TEST(AlarmMonitor, WhatStartupHasSeenAlreadyIsNoNews) {
  AlarmMonitor monitor(kAlarmsWithBattery, 1);
  EXPECT_EQ(monitor.on_reply(kHeat, kAll), StatusSet{}) << "set from the first reply on";
  monitor.on_reply(StatusSet{}, kAll);
  EXPECT_EQ(monitor.on_reply(kHeat, kAll), kHeat);
  monitor.on_reply(StatusSet{}, kAll);
  monitor.on_startup();
  EXPECT_EQ(monitor.on_reply(kHeat, kAll), StatusSet{});
}

TEST(AlarmMonitor, ASingleReplyRaisesNothingAndTwoDo) {
  AlarmMonitor monitor(kAlarmsWithBattery);
  monitor.on_reply(kCounting, kAll);
  EXPECT_TRUE(monitor.live().empty());
  monitor.on_reply(StatusSet{}, kAll);
  monitor.on_reply(kCounting, kAll);
  EXPECT_TRUE(monitor.latched().empty()) << "not in a row";
  monitor.on_reply(kCounting, kAll);
  EXPECT_EQ(monitor.live(), kCounting);
  EXPECT_EQ(monitor.live_level(), AlarmLevel::fault);
}

TEST(AlarmMonitor, WhatIsGoneStaysLatchedUntilAVerifiedReset) {
  AlarmMonitor monitor(kAlarmsWithBattery, 1);
  monitor.on_reply(kHeat, kAll);
  monitor.on_reply(StatusSet{}, kAll);
  EXPECT_TRUE(monitor.live().empty());
  EXPECT_EQ(monitor.latched(), kHeat);
  EXPECT_EQ(monitor.live_level(), AlarmLevel::none);
  EXPECT_EQ(monitor.latched_level(), AlarmLevel::warning);

  ResetOutcome outcome;
  outcome.verdict = ResetVerdict::failed;
  monitor.on_reset(outcome);
  EXPECT_EQ(monitor.latched(), kHeat) << "nobody has read it back";
  outcome.verdict = ResetVerdict::refused;
  monitor.on_reset(outcome);
  EXPECT_EQ(monitor.latched(), kHeat);
  outcome.verdict = ResetVerdict::verified;
  outcome.kind = ResetKind::zero;
  monitor.on_reset(outcome);
  EXPECT_EQ(monitor.latched(), kHeat) << "ID8 clears no error bits";
  outcome.kind = ResetKind::errors;
  monitor.on_reset(outcome);
  EXPECT_TRUE(monitor.latched().empty());
}

TEST(AlarmMonitor, ABitWhoseCauseLastsIsStillThereAfterAReset) {
  AlarmMonitor monitor(kAlarmsWithBattery, 1);
  monitor.on_reply(kHeat | kCounting, kAll);
  ResetOutcome outcome;
  outcome.verdict = ResetVerdict::cause_persists;
  outcome.kind = ResetKind::multi_turn;
  outcome.status_after = kHeat;
  monitor.on_reset(outcome);
  EXPECT_EQ(monitor.live(), kHeat);
  EXPECT_EQ(monitor.latched(), kHeat);
}

TEST(AlarmMonitor, RepliesWithoutALMCLeaveItAsItIs) {
  AlarmMonitor monitor(kAlarmsWithBattery, 2);
  monitor.on_reply(kHeat, kAll);
  monitor.on_reply(StatusSet{}, kSf);
  monitor.on_reply(StatusSet{}, kSf);
  monitor.on_reply(kHeat, kAll);
  EXPECT_EQ(monitor.live(), kHeat) << "two replies that had the bit, one behind the other";
}

}  // namespace
}  // namespace tm485
