// whole_in and left_of against the division that they stand for.
#include "tm485/time.hpp"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>

namespace tm485 {
namespace {

TEST(WholeIn, IsTheQuotient) {
  std::mt19937_64 random(485);
  for (int i = 0; i < 200'000; ++i) {
    const auto span = static_cast<std::int64_t>(random() >> (1 + random() % 63));
    const auto step = static_cast<std::int64_t>(random() >> (1 + random() % 63)) | 1;
    ASSERT_EQ(whole_in(Time{span}, Time{step}), span / step) << span << " / " << step;
    ASSERT_EQ(left_of(Time{span}, Time{step}).count(), span % step) << span << " % " << step;
  }
}

TEST(WholeIn, AtTheEnds) {
  constexpr Time kLongest{INT64_MAX};
  EXPECT_EQ(whole_in(kLongest, Time{1}), INT64_MAX);
  EXPECT_EQ(whole_in(kLongest, kLongest), 1);
  EXPECT_EQ(whole_in(kLongest - Time{1}, kLongest), 0);
  EXPECT_EQ(whole_in(Time{0}, Time{1}), 0);
  EXPECT_EQ(whole_in(Time{62'500}, Time{62'500}), 1);
  EXPECT_EQ(whole_in(Time{62'499}, Time{62'500}), 0);
  EXPECT_EQ(whole_in(Time{-1}, Time{62'500}), 0);
  EXPECT_EQ(whole_in(-kNever, Time{62'500}), 0);
}

}  // namespace
}  // namespace tm485
