#include "tm485/mcu/baud.hpp"

#include <gtest/gtest.h>

#include <cstdlib>

namespace tm485::mcu {
namespace {

constexpr std::uint32_t kRate = 2'500'000;

// Usable where a build is to be refused.
static_assert(solve_baud(BaudFamily::pl011, 48'000'000, kRate));
static_assert(!solve_baud(BaudFamily::pl011, 24'000'000, kRate));
static_assert(solve_baud(BaudFamily::stm32_over8, 42'000'000, kRate)->rate == 2'470'588);

struct Known {
  BaudFamily family;
  std::uint32_t clock_hz;
  std::uint32_t divisor;
  std::uint32_t rate;
  std::int32_t error_ppm;
};

TEST(SolveBaud, KnownClocksAtTwoAndAHalfMegabit) {
  // Worked out by hand from the manuals' formulas.
  for (const Known& known : {
           Known{BaudFamily::pl011, 48'000'000, 77, 2'493'506, -2'597},  // 1 + 13/64
           Known{BaudFamily::pl011, 50'000'000, 80, 2'500'000, 0},       // 1 + 16/64
           Known{BaudFamily::pl011, 40'000'000, 64, 2'500'000, 0},       // the least clock
           Known{BaudFamily::ns16550, 40'000'000, 1, 2'500'000, 0},
           Known{BaudFamily::ns16550, 160'000'000, 4, 2'500'000, 0},
           Known{BaudFamily::ns16550, 192'000'000, 5, 2'400'000, 0},  // refused, see below
           Known{BaudFamily::stm32_over16, 84'000'000, 34, 2'470'588, -11'764},
           Known{BaudFamily::stm32_over16, 170'000'000, 68, 2'500'000, 0},
           Known{BaudFamily::stm32_over16, 64'000'000, 26, 2'461'538, -15'384},
           Known{BaudFamily::stm32_over8, 20'000'000, 8, 2'500'000, 0},
           Known{BaudFamily::cmsdk, 25'000'000, 10, 2'500'000, 0},  // refused, see below
           Known{BaudFamily::cmsdk, 50'000'000, 20, 2'500'000, 0},
       }) {
    const auto solved = solve_baud(known.family, known.clock_hz, kRate);
    const bool refused = (known.family == BaudFamily::ns16550 && known.clock_hz == 192'000'000) ||
                         (known.family == BaudFamily::cmsdk && known.clock_hz == 25'000'000);
    ASSERT_EQ(solved.has_value(), !refused) << known.clock_hz;
    if (refused) continue;
    EXPECT_EQ(solved->divisor, known.divisor) << known.clock_hz;
    EXPECT_EQ(solved->rate, known.rate) << known.clock_hz;
    EXPECT_EQ(solved->error_ppm, known.error_ppm) << known.clock_hz;
  }
}

TEST(SolveBaud, ARefusalNamesTheNearestRate) {
  const auto too_slow = solve_baud(BaudFamily::pl011, 24'000'000, kRate);
  ASSERT_FALSE(too_slow);
  EXPECT_EQ(too_slow.error().code, Errc::bad_argument);
  EXPECT_EQ(too_slow.error().nearest, 1'500'000U);
  EXPECT_EQ(solve_baud(BaudFamily::ns16550, 1'843'200, kRate).error().nearest, 115'200U);
  EXPECT_EQ(solve_baud(BaudFamily::ns16550, 192'000'000, kRate).error().nearest, 2'400'000U);
  EXPECT_EQ(solve_baud(BaudFamily::cmsdk, 25'000'000, kRate).error().nearest, 1'562'500U);
  EXPECT_EQ(solve_baud(BaudFamily::pl011, 0, kRate).error().nearest, 0U);
  EXPECT_EQ(solve_baud(BaudFamily::pl011, 48'000'000, 0).error().nearest, 0U);
  // Too slow for the longest divisor.
  EXPECT_FALSE(solve_baud(BaudFamily::ns16550, 160'000'000, 100));
}

TEST(SolveBaud, TwoPercentIsTheEdge) {
  // A divisor of 1: the rate is clock / 16.
  EXPECT_TRUE(solve_baud(BaudFamily::ns16550, 16 * 2'550'000, kRate));
  EXPECT_FALSE(solve_baud(BaudFamily::ns16550, 16 * 2'550'000 + 1, kRate));
  EXPECT_TRUE(solve_baud(BaudFamily::ns16550, 16 * 2'450'000, kRate));
  EXPECT_FALSE(solve_baud(BaudFamily::ns16550, 16 * 2'450'000 - 1, kRate));
}

/// Against a search through all divisors, in floating point.
TEST(SolveBaud, NoOtherDivisorIsNearer) {
  struct Rule {
    BaudFamily family;
    double unit;  // rate = clock / (unit * divisor)
    std::uint32_t smallest, largest;
  };
  constexpr Rule kRules[] = {{BaudFamily::pl011, 0.25, 64, 2'000},
                             {BaudFamily::ns16550, 16.0, 1, 500},
                             {BaudFamily::stm32_over16, 1.0, 16, 2'000},
                             {BaudFamily::stm32_over8, 1.0, 8, 2'000},
                             {BaudFamily::cmsdk, 1.0, 16, 2'000}};
  for (const Rule& rule : kRules) {
    for (std::uint32_t clock = 1'000'000; clock < 400'000'000; clock += 1'372'113) {
      for (const std::uint32_t rate : {kRate, 1'000'000U, 5'000'000U}) {
        double best = 1e300;
        for (std::uint32_t divisor = rule.smallest; divisor <= rule.largest; ++divisor)
          best = std::min(best, std::abs(clock / (rule.unit * divisor) - rate));
        const auto solved = solve_baud(rule.family, clock, rate);
        ASSERT_EQ(solved.has_value(), best <= 0.02 * rate) << clock << " " << rate;
        if (!solved) continue;
        ASSERT_NEAR(std::abs(clock / (rule.unit * solved->divisor) - rate), best, 1.0)
            << clock << " " << rate;
        ASSERT_NEAR(solved->error_ppm, 1e6 * (clock / (rule.unit * solved->divisor) - rate) / rate, 1.0);
      }
    }
  }
}

TEST(SolveBaud, TheCharacterTimeIsThatOfTheRateMade) {
  EXPECT_EQ(solve_baud(BaudFamily::pl011, 50'000'000, kRate)->character_time, Time{4'000});
  EXPECT_EQ(solve_baud(BaudFamily::pl011, 48'000'000, kRate)->character_time,
            Time{4'011});  // 4010.4, rounded up
}

}  // namespace
}  // namespace tm485::mcu
