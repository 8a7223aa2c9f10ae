// The register drivers of microcontrollers, beyond what the port's contract shows: set-up, refusals, divisors.
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "mcu/model_access.hpp"
#include "mcu/models/cmsdk_model.hpp"
#include "mcu/models/stm32_models.hpp"
#include "tm485/mcu/cmsdk_uart.hpp"
#include "tm485/mcu/stm32_usart_v1.hpp"
#include "tm485/mcu/stm32_usart_v2.hpp"

namespace tm485::test {
namespace {

using mcu::Oversampling;
using mcu::solve_baud;
using mcu::stm32_brr;
using V1 = mcu::Stm32UsartV1<ModelAccess<Stm32V1Model>>;
using V2 = mcu::Stm32UsartV2<ModelAccess<Stm32V2Model>>;
using Cmsdk = mcu::CmsdkUart<ModelAccess<CmsdkModel>>;

constexpr std::uint32_t kRate = 2'500'000;
static_assert(solve_baud(V1::kFamily, 84'000'000, kRate));   // STM32F405, APB2
static_assert(solve_baud(V2::kFamily, 170'000'000, kRate));  // STM32G4
static_assert(!solve_baud(V1::kFamily, 36'000'000, kRate));  // STM32F1, APB1: 2.57 Mbit/s

TEST(Stm32Brr, IsThatOfTheManual) {
  EXPECT_EQ(stm32_brr(34, Oversampling::by16), 0x22U);
  // 8 samples: USARTDIV = 1 + 4/8 is mantissa 1, fraction 4.
  EXPECT_EQ(stm32_brr(12, Oversampling::by8), 0x14U);
  EXPECT_EQ(stm32_brr(15, Oversampling::by8), 0x17U);
}

TEST(Stm32UsartV1, IsRefusedWithoutAClock) {
  Stm32V1Model model({.clocked = false});
  EXPECT_EQ(V1(ModelAccess(model)).configure(*solve_baud(V1::kFamily, 84'000'000, kRate)),
            std::unexpected(Errc::port_gone));
}

/// An overrun that happens between two reads leaves no character behind: it must not block what follows.
TEST(Stm32UsartV1, AnOverrunIsClearedAndToldOnce) {
  Stm32V1Model model({.clock_hz = 84'000'000});
  V1 driver(ModelAccess<Stm32V1Model>{model});
  ASSERT_TRUE(driver.configure(*solve_baud(V1::kFamily, 84'000'000, kRate)));
  for (int i = 0; i < 3; ++i)
    model.engine().arrive({static_cast<std::uint8_t>(i), Time{4'000 * i}, Time{4'000 * (i + 1)}, true});
  model.engine().advance_to(Time{20'000});
  EXPECT_EQ(driver.try_read().byte, 0);
  EXPECT_FALSE(driver.try_read().present);
  EXPECT_TRUE(driver.take_overrun());
  EXPECT_FALSE(driver.try_read().present);
  EXPECT_FALSE(driver.take_overrun());
  EXPECT_EQ(model.engine().complaints(), std::vector<std::string>{});
}

TEST(Stm32UsartV2, SetsTheDriverEnableUp) {
  Stm32V2Model model({.clock_hz = 170'000'000});
  V2 driver(ModelAccess<Stm32V2Model>{model}, {.driver_enable_low = true, .assertion = 31, .deassertion = 5});
  ASSERT_TRUE(driver.configure(*solve_baud(V2::kFamily, 170'000'000, kRate)));
  EXPECT_TRUE(model.driver_enable());
  EXPECT_TRUE(model.driver_enable_low());
  EXPECT_EQ(model.assertion(), 31U);
  EXPECT_EQ(model.deassertion(), 5U);
  EXPECT_EQ(V2::release_time(*solve_baud(V2::kFamily, 170'000'000, kRate), {.deassertion = 5}), Time{125});
  EXPECT_EQ(model.engine().complaints(), std::vector<std::string>{});
}

TEST(Stm32UsartV2, WhatCannotBeIsRefused) {
  constexpr auto kDivisor = *solve_baud(V2::kFamily, 170'000'000, kRate);
  Stm32V2Model off({.clocked = false});
  EXPECT_EQ(V2(ModelAccess(off)).configure(kDivisor), std::unexpected(Errc::port_gone));
  Stm32V2Model model({.clock_hz = 170'000'000, .fifo = 0});
  EXPECT_EQ(V2(ModelAccess(model), {.fifo = true}).configure(kDivisor), std::unexpected(Errc::bad_argument));
  EXPECT_EQ(V2(ModelAccess(model), {.assertion = 32}).configure(kDivisor),
            std::unexpected(Errc::bad_argument));
  EXPECT_EQ(V2(ModelAccess(model), {.deassertion = 32}).configure(kDivisor),
            std::unexpected(Errc::bad_argument));
  EXPECT_TRUE(V2(ModelAccess(model), {}).configure(kDivisor));
}

TEST(CmsdkUart, IsRefusedWhereThereIsNone) {
  CmsdkModel model({.keeps = false});
  EXPECT_EQ(Cmsdk(ModelAccess(model)).configure(*solve_baud(Cmsdk::kFamily, 50'000'000, kRate)),
            std::unexpected(Errc::port_gone));
}

}  // namespace
}  // namespace tm485::test
