// Statistics: counters that stay at their end, histogram edges, minimum, mean and maximum.
#include "tm485/bus/statistics.hpp"

#include <gtest/gtest.h>

#include <numeric>

#include "support/print.hpp"

namespace tm485 {
namespace {

using test::ns;

TEST(Statistics, CountersSaturate) {
  std::uint32_t counter = 0xFFFFFFFD;
  saturating_increment(counter);
  EXPECT_EQ(counter, 0xFFFFFFFEU);
  saturating_increment(counter, 5);
  EXPECT_EQ(counter, 0xFFFFFFFFU);
  saturating_increment(counter);
  saturating_increment(counter, 0xFFFFFFFF);
  EXPECT_EQ(counter, 0xFFFFFFFFU);
  counter = 7;
  saturating_increment(counter, 0);
  EXPECT_EQ(counter, 7U);
  saturating_increment(counter, 0xFFFFFFF8);
  EXPECT_EQ(counter, 0xFFFFFFFFU);
}

TEST(Statistics, HistogramEdges) {
  Histogram histogram;
  histogram.origin = ns(1'000);
  histogram.shift = 4;  // bins of 16 ns
  const auto bin_of = [&](Time value) {
    Histogram one = histogram;
    one.add(value);
    for (std::size_t i = 0; i < Histogram::kBins; ++i)
      if (one.bins[i] != 0) return i;
    return Histogram::kBins;
  };
  EXPECT_EQ(bin_of(ns(1'000)), 0U);
  EXPECT_EQ(bin_of(ns(1'015)), 0U);
  EXPECT_EQ(bin_of(ns(1'016)), 1U);
  EXPECT_EQ(bin_of(ns(999)), 0U) << "below counts in the first";
  EXPECT_EQ(bin_of(-kNever), 0U);
  EXPECT_EQ(bin_of(ns(1'000 + 15 * 16 - 1)), 14U);
  EXPECT_EQ(bin_of(ns(1'000 + 15 * 16)), 15U);
  EXPECT_EQ(bin_of(ns(1'000 + 16 * 16)), 15U) << "beyond counts in the last";
  EXPECT_EQ(bin_of(kNever), 15U);
  for (std::size_t i = 0; i < Histogram::kBins; ++i) {
    EXPECT_EQ(bin_of(histogram.edge(i)), i);
    if (i > 0) {
      EXPECT_EQ(bin_of(histogram.edge(i) - ns(1)), i - 1);
    }
  }
}

TEST(Statistics, TimesHaveMinimumMeanAndMaximum) {
  TimeStatistic times(ns(0), 8);
  EXPECT_EQ(times.count(), 0U);
  EXPECT_EQ(times.minimum(), ns(0));
  EXPECT_EQ(times.maximum(), ns(0));
  EXPECT_EQ(times.mean(), ns(0));
  for (const int value : {3'000, 1'000, 5'000, -200}) times.add(ns(value));
  EXPECT_EQ(times.count(), 4U);
  EXPECT_EQ(times.minimum(), ns(-200));
  EXPECT_EQ(times.maximum(), ns(5'000));
  EXPECT_EQ(times.mean(), ns(2'200));
  const auto& bins = times.histogram().bins;
  EXPECT_EQ(std::accumulate(bins.begin(), bins.end(), 0U), 4U);
  EXPECT_EQ(bins[0], 1U);
  EXPECT_EQ(bins[3], 1U);
  EXPECT_EQ(bins[11], 1U);
  EXPECT_EQ(bins[15], 1U);
}

TEST(Statistics, ErrorsAreCountedByCause) {
  Statistics statistics;
  for (std::size_t i = 0; i < kErrcCount; ++i)
    for (std::size_t n = 0; n <= i; ++n) statistics.count_error(static_cast<Errc>(i));
  for (std::size_t i = 0; i < kErrcCount; ++i) EXPECT_EQ(statistics.errors[i], i + 1);
}

}  // namespace
}  // namespace tm485
