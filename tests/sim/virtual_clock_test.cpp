#include "tm485/sim/virtual_clock.hpp"

#include <gtest/gtest.h>

namespace tm485::sim {
namespace {

TEST(VirtualClock, StartsAtZeroAndMovesWhenTold) {
  VirtualClock clock;
  EXPECT_EQ(clock.now(), Time{0});
  clock.advance_to(Time{62'500});
  EXPECT_EQ(clock.now(), Time{62'500});
}

TEST(VirtualClock, NeverGoesBack) {
  VirtualClock clock;
  clock.advance_to(Time{100});
  clock.advance_to(Time{40});
  EXPECT_EQ(clock.now(), Time{100});
}

}  // namespace
}  // namespace tm485::sim
