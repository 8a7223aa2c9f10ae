// PolledUartPort on models of the UARTs of microcontrollers, under the contract.
#include "conformance/register_rig.hpp"
#include "mcu/models/cmsdk_model.hpp"
#include "mcu/models/nrf51_model.hpp"
#include "mcu/models/stm32_models.hpp"
#include "tm485/mcu/cmsdk_uart.hpp"
#include "tm485/mcu/nrf51_uart.hpp"
#include "tm485/mcu/stm32_usart_v1.hpp"
#include "tm485/mcu/stm32_usart_v2.hpp"

namespace tm485::test {
namespace {

using mcu::Oversampling;

constexpr PortCapability kCapability{.release_bound = Time{1'000}};
constexpr EngineConfig kJudged{
    .start_delay = Time{200}, .access = Time{40}, .judge_driver = true, .driver_lead = Time{1'000}};

std::unique_ptr<Rig> stm32_v1_gpio() {
  using Driver = mcu::Stm32UsartV1<ModelAccess<Stm32V1Model>>;
  using Direction = mcu::CallDirection<ModelDriverPin<Stm32V1Model>>;
  using Port = mcu::PolledUartPort<Driver, Direction>;
  return std::make_unique<RegisterRig<Stm32V1Model, Port>>(
      Stm32Config{.clock_hz = 84'000'000, .engine = kJudged},
      [](Stm32V1Model& model) {
        return polled_port<Driver>(model, 84'000'000, Direction{ModelDriverPin(model)},
                                   {.driver_lead = Time{1'000}, .capability = kCapability});
      },
      Time{300}, 1);
}

std::unique_ptr<Rig> stm32_v1_over8() {
  using Driver = mcu::Stm32UsartV1<ModelAccess<Stm32V1Model>, Oversampling::by8>;
  using Port = mcu::PolledUartPort<Driver>;
  return std::make_unique<RegisterRig<Stm32V1Model, Port>>(
      Stm32Config{.clock_hz = 30'000'000},
      [](Stm32V1Model& model) {
        return polled_port<Driver>(model, 30'000'000, mcu::AutomaticDirection{}, {.capability = kCapability});
      },
      Time{1'000}, 1);
}

/// The chip switches the driver: `sent` must wait for its release.
template <Oversampling S>
std::unique_ptr<Rig> stm32_v2(bool fifo) {
  using Driver = mcu::Stm32UsartV2<ModelAccess<Stm32V2Model>, S>;
  using Port = mcu::PolledUartPort<Driver>;
  constexpr std::uint32_t kClock = S == Oversampling::by8 ? 35'000'000 : 170'000'000;
  const mcu::Stm32V2Options options{.fifo = fifo, .assertion = 16, .deassertion = 12};
  const Time release = Driver::release_time(*mcu::solve_baud(Driver::kFamily, kClock, 2'500'000), options);
  return std::make_unique<RegisterRig<Stm32V2Model, Port>>(
      Stm32Config{.clock_hz = kClock, .engine = {.start_delay = Time{100}, .access = Time{30}}},
      [&](Stm32V2Model& model) {
        return polled_port<Driver>(model, kClock, mcu::AutomaticDirection{},
                                   {.hardware_release = release, .capability = kCapability}, options);
      },
      Time{200}, fifo ? 8 : 1);
}
std::unique_ptr<Rig> stm32_v2_fifo() { return stm32_v2<Oversampling::by16>(true); }
std::unique_ptr<Rig> stm32_v2_over8() { return stm32_v2<Oversampling::by8>(false); }

std::unique_ptr<Rig> cmsdk_gpio() {
  using Driver = mcu::CmsdkUart<ModelAccess<CmsdkModel>>;
  using Direction = mcu::CallDirection<ModelDriverPin<CmsdkModel>>;
  using Port = mcu::PolledUartPort<Driver, Direction>;
  auto rig = std::make_unique<RegisterRig<CmsdkModel, Port>>(
      CmsdkConfig{.engine = kJudged},
      [](CmsdkModel& model) {
        return polled_port<Driver>(model, 50'000'000, Direction{ModelDriverPin(model)},
                                   {.driver_lead = Time{1'000}, .capability = kCapability});
      },
      Time{200}, 1);
  rig->without_framing_errors();
  return rig;
}

/// As if its clock were 40 MHz: the contract's judge talks at 2.5 Mbit/s, and the block makes 1 Mbit/s of its 16 MHz.
std::unique_ptr<Rig> nrf51_gpio() {
  using Driver = mcu::Nrf51Uart<ModelAccess<Nrf51Model>>;
  using Direction = mcu::CallDirection<ModelDriverPin<Nrf51Model>>;
  using Port = mcu::PolledUartPort<Driver, Direction>;
  auto rig = std::make_unique<RegisterRig<Nrf51Model, Port>>(
      Nrf51Config{.clock_hz = 40'000'000, .engine = kJudged},
      [](Nrf51Model& model) {
        Port port(Driver(ModelAccess<Nrf51Model>(model)), Direction{ModelDriverPin(model)},
                  {.driver_lead = Time{1'000}, .capability = kCapability});
        auto divisor = *Driver::divisor_for(1'000'000);
        divisor.character_time = Time{4'000};
        EXPECT_TRUE(port.start(divisor));
        return port;
      },
      Time{200}, 6);
  rig->with_gaps(Time{1'000});
  return rig;
}

INSTANTIATE_TEST_SUITE_P(Microcontrollers, PortConformance,
                         conformance_of({{"Stm32V1Gpio", stm32_v1_gpio},
                                         {"Stm32V1Over8", stm32_v1_over8},
                                         {"Stm32V2Fifo", stm32_v2_fifo},
                                         {"Stm32V2Over8", stm32_v2_over8},
                                         {"CmsdkGpio", cmsdk_gpio},
                                         {"Nrf51Gpio", nrf51_gpio}}),
                         conformance_name);

}  // namespace
}  // namespace tm485::test
