// InterruptUartPort on models of the UARTs of microcontrollers, under the contract. The owner polls rarely; what must be
// in time is done by interrupts that come late, and in the middle of the owner's work.
#include "conformance/interrupt_rig.hpp"
#include "mcu/models/cmsdk_model.hpp"
#include "mcu/models/pl011_model.hpp"
#include "mcu/models/stm32_models.hpp"
#include "tm485/mcu/cmsdk_uart.hpp"
#include "tm485/mcu/dma_uart.hpp"
#include "tm485/mcu/pl011.hpp"
#include "tm485/mcu/stm32_usart_v1.hpp"
#include "tm485/mcu/stm32_usart_v2.hpp"

namespace tm485::test {
namespace {

constexpr Time kLead{1'000};
constexpr EngineConfig kJudged{
    .start_delay = Time{200}, .access = Time{40}, .judge_driver = true, .driver_lead = kLead};
constexpr mcu::InterruptPortConfig kPort{.driver_lead = kLead, .capability = {.release_bound = Time{2'800}}};

template <class M>
using PinDirection = mcu::CallDirection<ModelDriverPin<M>>;

template <mcu::Oversampling S, UartPriority P>
std::unique_ptr<Rig> stm32_v1() {
  using Driver = mcu::Stm32UsartV1<ModelAccess<Stm32V1Model>, S>;
  using Port = mcu::InterruptUartPort<Driver, PinDirection<Stm32V1Model>, LineTimer<Stm32V1Model>>;
  constexpr std::uint32_t kClock = S == mcu::Oversampling::by8 ? 30'000'000 : 84'000'000;
  return std::make_unique<InterruptRig<Stm32V1Model, Port>>(
      Stm32Config{.clock_hz = kClock, .interrupts = true, .engine = kJudged},
      InterruptRigConfig{.clock_hz = kClock, .priority = P}, [](Stm32V1Model& model, auto& line) {
        return Port(Driver(ModelAccess(model)), PinDirection<Stm32V1Model>{ModelDriverPin(model)}, kPort,
                    LineTimer(line));
      });
}

/// The chip switches the driver: `sent` waits for its release.
template <mcu::Oversampling S, bool Fifo>
std::unique_ptr<Rig> stm32_v2() {
  using Driver = mcu::Stm32UsartV2<ModelAccess<Stm32V2Model>, S>;
  using Port = mcu::InterruptUartPort<Driver>;
  constexpr std::uint32_t kClock = S == mcu::Oversampling::by8 ? 35'000'000 : 170'000'000;
  const mcu::Stm32V2Options options{.fifo = Fifo, .assertion = 16, .deassertion = 12};
  const Time release = Driver::release_time(*mcu::solve_baud(Driver::kFamily, kClock, 2'500'000), options);
  return std::make_unique<InterruptRig<Stm32V2Model, Port>>(
      Stm32Config{
          .clock_hz = kClock, .interrupts = true, .engine = {.start_delay = Time{100}, .access = Time{30}}},
      InterruptRigConfig{.clock_hz = kClock}, [&](Stm32V2Model& model, auto&) {
        return Port(Driver(ModelAccess(model), options), {},
                    {.hardware_release = release, .capability = kPort.capability});
      });
}

/// Two DMA channels; the reply is there after a character's time of silence.
std::unique_ptr<Rig> stm32_v1_dma() {
  using Driver = mcu::Stm32UsartV1<ModelAccess<Stm32V1Model>>;
  using Dma = mcu::DmaUart<Driver, SendChannel, ReceiveChannel>;
  using Port = mcu::InterruptUartPort<Dma, PinDirection<Stm32V1Model>, LineTimer<Stm32V1Model>>;
  return std::make_unique<InterruptRig<Stm32V1Model, Port>>(
      Stm32Config{.clock_hz = 84'000'000, .interrupts = true, .engine = kJudged},
      InterruptRigConfig{.clock_hz = 84'000'000}, [](Stm32V1Model& model, auto& line) {
        return Port(Dma(Driver(ModelAccess(model)), SendChannel(model.send_channel()),
                        ReceiveChannel(model.receive_channel())),
                    PinDirection<Stm32V1Model>{ModelDriverPin(model)}, kPort, LineTimer(line));
      });
}

std::unique_ptr<Rig> stm32_v2_dma() {
  using Driver = mcu::Stm32UsartV2<ModelAccess<Stm32V2Model>>;
  using Dma = mcu::DmaUart<Driver, SendChannel, ReceiveChannel>;
  using Port = mcu::InterruptUartPort<Dma>;
  const mcu::Stm32V2Options options{.assertion = 16, .deassertion = 12};
  const Time release = Driver::release_time(*mcu::solve_baud(Dma::kFamily, 170'000'000, 2'500'000), options);
  return std::make_unique<InterruptRig<Stm32V2Model, Port>>(
      Stm32Config{.clock_hz = 170'000'000,
                  .interrupts = true,
                  .engine = {.start_delay = Time{100}, .access = Time{30}}},
      InterruptRigConfig{.clock_hz = 170'000'000}, [&](Stm32V2Model& model, auto&) {
        return Port(Dma(Driver(ModelAccess(model), options), SendChannel(model.send_channel()),
                        ReceiveChannel(model.receive_channel())),
                    {}, {.hardware_release = release, .capability = kPort.capability});
      });
}

/// BUSY says when the last stop bit has left, but no interrupt does.
std::unique_ptr<Rig> pl011_timer() {
  using Driver = mcu::Pl011<ModelAccess<Pl011Model>, mcu::Pl011Fifos::off>;
  using Port = mcu::InterruptUartPort<Driver, PinDirection<Pl011Model>, LineTimer<Pl011Model>>;
  return std::make_unique<InterruptRig<Pl011Model, Port>>(
      Pl011Config{.interrupts = true, .engine = kJudged}, InterruptRigConfig{.clock_hz = 48'000'000},
      [](Pl011Model& model, auto& line) {
        return Port(Driver(ModelAccess(model)), PinDirection<Pl011Model>{ModelDriverPin(model)}, kPort,
                    LineTimer(line));
      });
}

/// No timer: the owner's calls release the driver, so they come often.
std::unique_ptr<Rig> cmsdk_no_timer() {
  using Driver = mcu::CmsdkUart<ModelAccess<CmsdkModel>>;
  using Port = mcu::InterruptUartPort<Driver, PinDirection<CmsdkModel>>;
  auto rig = std::make_unique<InterruptRig<CmsdkModel, Port>>(
      CmsdkConfig{.interrupts = true, .engine = kJudged},
      InterruptRigConfig{.clock_hz = 50'000'000, .grain = Time{400}}, [](CmsdkModel& model, auto&) {
        return Port(Driver(ModelAccess(model)), PinDirection<CmsdkModel>{ModelDriverPin(model)}, kPort);
      });
  rig->without_framing_errors();
  return rig;
}

template <UartPriority P>
std::unique_ptr<Rig> cmsdk_timer() {
  using Driver = mcu::CmsdkUart<ModelAccess<CmsdkModel>>;
  using Port = mcu::InterruptUartPort<Driver, PinDirection<CmsdkModel>, LineTimer<CmsdkModel>>;
  auto rig = std::make_unique<InterruptRig<CmsdkModel, Port>>(
      CmsdkConfig{.interrupts = true, .engine = kJudged},
      InterruptRigConfig{.clock_hz = 50'000'000, .priority = P}, [](CmsdkModel& model, auto& line) {
        return Port(Driver(ModelAccess(model)), PinDirection<CmsdkModel>{ModelDriverPin(model)}, kPort,
                    LineTimer(line));
      });
  rig->without_framing_errors();
  return rig;
}

using mcu::Oversampling;
INSTANTIATE_TEST_SUITE_P(Interrupts, PortConformance,
                         conformance_of({{"Stm32V1", stm32_v1<Oversampling::by16, UartPriority::higher>},
                                         {"Stm32V1SamePriority",
                                          stm32_v1<Oversampling::by16, UartPriority::same>},
                                         {"Stm32V1Over8", stm32_v1<Oversampling::by8, UartPriority::higher>},
                                         {"Stm32V2", stm32_v2<Oversampling::by16, false>},
                                         {"Stm32V2Over8", stm32_v2<Oversampling::by8, false>},
                                         {"Stm32V2Fifo", stm32_v2<Oversampling::by16, true>},
                                         {"Stm32V1Dma", stm32_v1_dma},
                                         {"Stm32V2Dma", stm32_v2_dma},
                                         {"Pl011Timer", pl011_timer},
                                         {"CmsdkNoTimer", cmsdk_no_timer},
                                         {"CmsdkTimer", cmsdk_timer<UartPriority::higher>},
                                         {"CmsdkTimerSamePriority", cmsdk_timer<UartPriority::same>}}),
                         conformance_name);

}  // namespace
}  // namespace tm485::test
