// LinkHealth: thresholds, hysteresis, windows, causes.
#include "tm485/bus/link_health.hpp"

#include <gtest/gtest.h>

namespace tm485 {
namespace {

constexpr LinkLimits kLimits{.window = 100, .degraded_at = 10, .good_below = 2, .lost_after = 3};

class LinkHealthTest : public testing::Test {
 protected:
  LinkHealthTest() { link.on_found(true); }
  void good(int cycles) {
    for (int i = 0; i < cycles; ++i) link.on_good();
  }
  LinkHealth link{kLimits};
};

TEST(LinkHealth, IsLostUntilItIsFound) {
  LinkHealth link;
  EXPECT_EQ(link.state(), LinkState::lost);
  link.on_found(true);
  EXPECT_EQ(link.state(), LinkState::good);
  link.on_lost();
  link.on_found(false);
  EXPECT_EQ(link.state(), LinkState::degraded) << "it was lost a moment ago";
}

TEST_F(LinkHealthTest, ALossIsSeenWithTheThirdFailedCycleInARow) {
  link.on_failed(Errc::timeout);
  link.on_failed(Errc::timeout);
  EXPECT_EQ(link.state(), LinkState::good);
  link.on_failed(Errc::timeout);
  EXPECT_EQ(link.state(), LinkState::lost);
  link.on_good();
  EXPECT_EQ(link.state(), LinkState::degraded);
  link.on_failed(Errc::timeout);
  link.on_failed(Errc::timeout);
  link.on_good();
  EXPECT_EQ(link.state(), LinkState::degraded) << "in a row means in a row";
}

TEST_F(LinkHealthTest, DegradesWithTheTenthFailureOfAWindowAndNotBefore) {
  for (int i = 0; i < 9; ++i) {
    link.on_failed(Errc::crc_error);
    good(1);
  }
  EXPECT_EQ(link.state(), LinkState::good);
  link.on_failed(Errc::crc_error);
  EXPECT_EQ(link.state(), LinkState::degraded);
}

TEST_F(LinkHealthTest, FailuresOfTwoWindowsAreNotAddedUp) {
  for (int window = 0; window < 3; ++window) {
    for (int i = 0; i < 9; ++i) {
      link.on_failed(Errc::crc_error);
      good(1);
    }
    good(82);
  }
  EXPECT_EQ(link.state(), LinkState::good);
}

TEST_F(LinkHealthTest, FailuresBeforeALossAreNotCountedBehindIt) {
  for (int i = 0; i < 9; ++i) {
    link.on_failed(Errc::crc_error);
    good(1);
  }
  link.on_lost();
  link.on_found(true);
  link.on_failed(Errc::crc_error);
  EXPECT_EQ(link.state(), LinkState::good);
}

TEST_F(LinkHealthTest, IsGoodAgainOnlyAfterAWholeWindowBelowTheLowerThreshold) {
  for (int i = 0; i < 10; ++i) {
    link.on_failed(Errc::crc_error);
    good(1);
  }
  ASSERT_EQ(link.state(), LinkState::degraded);
  good(80);  // the window ends with ten failures
  EXPECT_EQ(link.state(), LinkState::degraded);
  link.on_failed(Errc::crc_error);
  good(1);
  link.on_failed(Errc::crc_error);
  good(97);  // two: not below two
  EXPECT_EQ(link.state(), LinkState::degraded);
  link.on_failed(Errc::crc_error);
  good(98);
  EXPECT_EQ(link.state(), LinkState::degraded);
  good(1);
  EXPECT_EQ(link.state(), LinkState::good);
}

TEST_F(LinkHealthTest, RatesAreThoseOfTheLastWholeWindowByCause) {
  EXPECT_FALSE(link.measured());
  link.on_failed(Errc::timeout);
  good(1);
  link.on_failed(Errc::crc_error);
  good(1);
  link.on_failed(Errc::framing_error);
  good(1);
  link.on_failed(Errc::position_implausible);
  good(1);
  link.on_failed(Errc::overrun);
  EXPECT_EQ(link.rate_ppm(), 0U) << "the window is not over";
  good(91);
  ASSERT_TRUE(link.measured());
  EXPECT_EQ(link.failures(LinkCause::silence), 1U);
  EXPECT_EQ(link.failures(LinkCause::damage), 2U);
  EXPECT_EQ(link.failures(LinkCause::implausible), 1U);
  EXPECT_EQ(link.failures(LinkCause::host), 1U);
  EXPECT_EQ(link.rate_ppm(LinkCause::damage), 20'000U);
  EXPECT_EQ(link.rate_ppm(), 50'000U);
  good(100);
  EXPECT_EQ(link.rate_ppm(), 0U);
}

TEST(LinkHealth, ALineThatNeverAnswersDoesNotOverflow) {
  LinkHealth link({.window = 65'535, .degraded_at = 65'535, .good_below = 1, .lost_after = 255});
  link.on_found(true);
  for (int i = 0; i < 254; ++i) link.on_failed(Errc::timeout);
  EXPECT_EQ(link.state(), LinkState::good);
  for (int i = 254; i < 65'535; ++i) link.on_failed(Errc::timeout);
  EXPECT_EQ(link.state(), LinkState::lost);
  EXPECT_EQ(link.rate_ppm(LinkCause::silence), 1'000'000U);
}

TEST(LinkHealth, LimitsThatAreNoneAreRefused) {
  EXPECT_TRUE(LinkLimits{}.valid());
  EXPECT_FALSE((LinkLimits{.window = 0}.valid()));
  EXPECT_FALSE((LinkLimits{.degraded_at = 0}.valid()));
  EXPECT_FALSE((LinkLimits{.good_below = 0}.valid()));
  EXPECT_FALSE((LinkLimits{.degraded_at = 5, .good_below = 6}.valid()));
  EXPECT_FALSE((LinkLimits{.lost_after = 0}.valid()));
}

TEST(LinkHealth, EveryStateAndCauseHasAName) {
  EXPECT_EQ(name(LinkState::good), "good");
  EXPECT_EQ(name(LinkState::degraded), "degraded");
  EXPECT_EQ(name(LinkState::lost), "lost");
  EXPECT_EQ(name(LinkCause::silence), "silence");
  EXPECT_EQ(name(LinkCause::host), "host");
}

}  // namespace
}  // namespace tm485
