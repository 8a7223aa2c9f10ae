// The bus on interrupt-driven register drivers, thousands of cycles in character time.
#include <gtest/gtest.h>

#include "mcu/interrupt_bus.hpp"
#include "mcu/models/cmsdk_model.hpp"
#include "mcu/models/pl011_model.hpp"
#include "mcu/models/stm32_models.hpp"
#include "tm485/mcu/cmsdk_uart.hpp"
#include "tm485/mcu/pl011.hpp"
#include "tm485/mcu/stm32_usart_v1.hpp"
#include "tm485/mcu/stm32_usart_v2.hpp"

namespace tm485::test {
namespace {

constexpr std::uint32_t kCycles = 10'000;

void stm32_v1(const Setting& setting) {
  using Driver = mcu::Stm32UsartV1<ModelAccess<Stm32V1Model>>;
  InterruptBus<Stm32V1Model, Driver, PinDirection<Stm32V1Model>> bus(
      Stm32Config{.clock_hz = setting.clock_hz, .interrupts = true, .engine = kJudged}, pin, setting);
  bus.expect_clean(kCycles);
}

TEST(BusOnInterrupts, Stm32V1ReadsEverything) { stm32_v1({.clock_hz = 84'000'000}); }
TEST(BusOnInterrupts, Stm32V1ReadsEverythingBelowItsUart) {
  stm32_v1({.clock_hz = 84'000'000, .priorities = Priorities::uart_higher});
}
TEST(BusOnInterrupts, Stm32V1ReadsPositions) {
  stm32_v1({.clock_hz = 100'000'000, .id = DataId::single_turn, .period = Time{40'000}});
}
/// As late as the release of the driver allows.
TEST(BusOnInterrupts, Stm32V1ReadsEverythingWithLateInterrupts) {
  stm32_v1({.clock_hz = 100'000'000, .latency = Time{2'300}});
}

TEST(BusOnInterrupts, Stm32V2ReadsEverything) {
  using Driver = mcu::Stm32UsartV2<ModelAccess<Stm32V2Model>>;
  constexpr mcu::Stm32V2Options kOptions{.assertion = 16, .deassertion = 12};
  const Setting setting{.clock_hz = 170'000'000,
                        .hardware_release = Driver::release_time(
                            *mcu::solve_baud(Driver::kFamily, 170'000'000, 2'500'000), kOptions)};
  InterruptBus<Stm32V2Model, Driver, mcu::AutomaticDirection> bus(
      Stm32Config{.clock_hz = setting.clock_hz,
                  .interrupts = true,
                  .engine = {.start_delay = Time{300}, .access = Time{40}}},
      [](Stm32V2Model&) { return mcu::AutomaticDirection{}; }, setting, kOptions);
  bus.expect_clean(kCycles);
}

TEST(BusOnInterrupts, Pl011ReadsEverything) {
  using Driver = mcu::Pl011<ModelAccess<Pl011Model>, mcu::Pl011Fifos::off>;
  InterruptBus<Pl011Model, Driver, PinDirection<Pl011Model>> bus(
      Pl011Config{.interrupts = true, .engine = kJudged}, pin, {.clock_hz = 48'000'000});
  bus.expect_clean(kCycles);
}

TEST(BusOnInterrupts, CmsdkReadsEverything) {
  using Driver = mcu::CmsdkUart<ModelAccess<CmsdkModel>>;
  InterruptBus<CmsdkModel, Driver, PinDirection<CmsdkModel>> bus(
      CmsdkConfig{.interrupts = true, .engine = kJudged}, pin, {.clock_hz = 50'000'000});
  bus.expect_clean(kCycles);
}

}  // namespace
}  // namespace tm485::test
