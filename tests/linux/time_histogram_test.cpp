// TimeHistogram: its edges, its percentiles against a sorted list, its ends.
#include "tm485/linux/time_histogram.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

namespace tm485::linux_hal {
namespace {

TEST(TimeHistogram, BucketsFollowEachOtherWithoutGapAndOverlap) {
  for (std::size_t at = 0; at + 1 < TimeHistogram::kBuckets; ++at) {
    EXPECT_EQ(TimeHistogram::last_of(at) + Time{1}, TimeHistogram::first_of(at + 1));
    EXPECT_LE(TimeHistogram::first_of(at), TimeHistogram::last_of(at));
  }
  EXPECT_EQ(TimeHistogram::first_of(0), Time{0});
  EXPECT_EQ(TimeHistogram::last_of(TimeHistogram::kBuckets - 1), TimeHistogram::kRange - Time{1});
}

TEST(TimeHistogram, EveryTimeFallsIntoTheBucketThatNamesIt) {
  std::vector<std::int64_t> times;
  for (std::int64_t power = 1; power < TimeHistogram::kRange.count(); power *= 2)
    for (const std::int64_t near : {power - 1, power, power + 1, power + power / 3}) times.push_back(near);
  for (const std::int64_t ns : times) {
    TimeHistogram histogram;
    histogram.add(Time{ns});
    for (std::size_t at = 0; at < TimeHistogram::kBuckets; ++at) {
      const bool inside = TimeHistogram::first_of(at) <= Time{ns} && Time{ns} <= TimeHistogram::last_of(at);
      ASSERT_EQ(histogram.bucket(at), inside ? 1U : 0U) << ns << " ns, bucket " << at;
    }
  }
}

TEST(TimeHistogram, PercentilesAreNeverTooSmallAndAtMostASixteenthTooLarge) {
  constexpr unsigned kSeed = 4;
  std::mt19937_64 random(kSeed);
  std::lognormal_distribution<double> spread(7.0, 2.0);
  std::vector<std::int64_t> values;
  TimeHistogram histogram;
  for (int i = 0; i < 5000; ++i) {
    values.push_back(static_cast<std::int64_t>(spread(random)));
    histogram.add(Time{values.back()});
  }
  std::ranges::sort(values);
  for (const double fraction : {0.0, 0.001, 0.5, 0.9, 0.99, 0.999, 1.0}) {
    const auto rank = std::max<std::size_t>(
        1, static_cast<std::size_t>(std::ceil(fraction * static_cast<double>(values.size()))));
    const std::int64_t exact = values[rank - 1];
    EXPECT_GE(histogram.percentile(fraction).count(), exact) << "seed " << kSeed << ", " << fraction;
    EXPECT_LE(histogram.percentile(fraction).count(), exact + exact / 16)
        << "seed " << kSeed << ", " << fraction;
  }
  EXPECT_EQ(histogram.minimum(), Time{values.front()});
  EXPECT_EQ(histogram.maximum(), Time{values.back()});
  EXPECT_EQ(histogram.percentile(1.0), Time{values.back()});
}

TEST(TimeHistogram, AnEmptyOneIsAllZero) {
  TimeHistogram histogram;
  EXPECT_EQ(histogram.count(), 0U);
  EXPECT_EQ(histogram.minimum(), Time{0});
  EXPECT_EQ(histogram.maximum(), Time{0});
  EXPECT_EQ(histogram.percentile(0.5), Time{0});
  histogram.add(Time{5});
  histogram.clear();
  EXPECT_EQ(histogram.count(), 0U);
  EXPECT_EQ(histogram.percentile(1.0), Time{0});
}

TEST(TimeHistogram, WhatLiesOutsideKeepsItsExtremes) {
  TimeHistogram histogram;
  histogram.add(Time{-300});
  histogram.add(TimeHistogram::kRange * 4);
  EXPECT_EQ(histogram.bucket(0), 1U);
  EXPECT_EQ(histogram.bucket(TimeHistogram::kBuckets - 1), 1U);
  EXPECT_EQ(histogram.minimum(), Time{-300});
  EXPECT_EQ(histogram.percentile(0.5), Time{0});
  EXPECT_EQ(histogram.percentile(1.0), TimeHistogram::kRange * 4);
}

}  // namespace
}  // namespace tm485::linux_hal
