// PolledUartPort on models of a PL011 and of 16550s, with every kind of direction, under the contract.
#include "conformance/register_rig.hpp"
#include "conformance/rigs.hpp"
#include "mcu/models/pl011_model.hpp"
#include "mcu/models/uart16550_model.hpp"
#include "tm485/linux/mmio_uart.hpp"
#include "tm485/mcu/pl011.hpp"
#include "tm485/mcu/uart16550.hpp"

namespace tm485::test {
namespace {

using Pl011Driver = mcu::Pl011<ModelAccess<Pl011Model>>;
using Uart16550Driver = mcu::Uart16550<ModelAccess<Uart16550Model>>;
using linux_hal::MmioDirection;

constexpr PortCapability kCapability{.release_bound = Time{1'000}};
/// A transmitter that takes its time, registers that cost, and a driver pin that must be right.
constexpr EngineConfig kJudged{
    .start_delay = Time{400}, .access = Time{60}, .judge_driver = true, .driver_lead = Time{1'000}};

std::unique_ptr<Rig> pl011_automatic() {
  using Port = mcu::PolledUartPort<Pl011Driver>;
  return std::make_unique<RegisterRig<Pl011Model, Port>>(
      Pl011Config{},
      [](Pl011Model& model) {
        return polled_port<Pl011Driver>(model, 48'000'000, mcu::AutomaticDirection{},
                                        {.capability = kCapability});
      },
      Time{1'000}, 32);
}

/// The direction of MmioUart, by RTS in both polarities.
std::unique_ptr<Rig> pl011_rts(bool off_drives) {
  using Port = mcu::PolledUartPort<Pl011Driver, MmioDirection>;
  return std::make_unique<RegisterRig<Pl011Model, Port>>(
      Pl011Config{.rts_is_driver = true, .rts_off_drives = off_drives, .engine = kJudged},
      [off_drives](Pl011Model& model) {
        return polled_port<Pl011Driver>(
            model, 48'000'000,
            MmioDirection{off_drives ? MmioDirection::Kind::rts_off : MmioDirection::Kind::rts},
            {.driver_lead = Time{1'000}, .capability = kCapability});
      },
      Time{300}, 32);
}
std::unique_ptr<Rig> pl011_rts_on() { return pl011_rts(false); }
std::unique_ptr<Rig> pl011_rts_off() { return pl011_rts(true); }

std::unique_ptr<Rig> uart16550_automatic() {
  using Port = mcu::PolledUartPort<Uart16550Driver>;
  return std::make_unique<RegisterRig<Uart16550Model, Port>>(
      Uart16550Config{},
      [](Uart16550Model& model) {
        return polled_port<Uart16550Driver>(model, 40'000'000, mcu::AutomaticDirection{},
                                            {.capability = kCapability});
      },
      Time{1'000}, 16);
}

std::unique_ptr<Rig> uart16550_words_gpio() {
  using Port = mcu::PolledUartPort<Uart16550Driver, MmioDirection>;
  return std::make_unique<RegisterRig<Uart16550Model, Port>>(
      Uart16550Config{.shift = 2, .width = 4, .engine = kJudged},
      [](Uart16550Model& model) {
        return polled_port<Uart16550Driver>(model, 40'000'000,
                                            MmioDirection{MmioDirection::Kind::call, ModelDriverPin(model)},
                                            {.driver_lead = Time{1'000}, .capability = kCapability},
                                            mcu::Layout16550{.shift = 2, .width = 4});
      },
      Time{200}, 16);
}

std::unique_ptr<Rig> uart16550_halves_rts() {
  using Port = mcu::PolledUartPort<Uart16550Driver, mcu::RtsDirection>;
  return std::make_unique<RegisterRig<Uart16550Model, Port>>(
      Uart16550Config{.shift = 1, .width = 2, .rts_is_driver = true, .engine = kJudged},
      [](Uart16550Model& model) {
        return polled_port<Uart16550Driver>(model, 40'000'000, mcu::RtsDirection{},
                                            {.driver_lead = Time{1'000}, .capability = kCapability},
                                            mcu::Layout16550{.shift = 1, .width = 2});
      },
      Time{300}, 16);
}

/// MmioUart, on a model where it has mapped memory.
template <class M>
std::unique_ptr<Rig> mmio_rig(const auto& config, linux_hal::MmioBlock block, std::uint32_t clock_hz,
                              const mcu::Layout16550& layout, std::size_t depth) {
  using Port = linux_hal::MmioPort<ModelAccess<M>>;
  return std::make_unique<RegisterRig<M, Port>>(
      config,
      [=](M& model) {
        Port port(block, ModelAccess<M>(model), layout,
                  MmioDirection{MmioDirection::Kind::call, ModelDriverPin(model)},
                  {.driver_lead = Time{1'000}, .capability = kCapability});
        const auto family =
            block == linux_hal::MmioBlock::pl011 ? Pl011Driver::kFamily : Uart16550Driver::kFamily;
        EXPECT_TRUE(port.start(*mcu::solve_baud(family, clock_hz, 2'500'000)));
        return port;
      },
      Time{200}, depth);
}
std::unique_ptr<Rig> mmio_pl011() {
  return mmio_rig<Pl011Model>(Pl011Config{.engine = kJudged}, linux_hal::MmioBlock::pl011, 48'000'000, {},
                              32);
}
std::unique_ptr<Rig> mmio_uart16550() {
  return mmio_rig<Uart16550Model>(Uart16550Config{.shift = 2, .width = 4, .engine = kJudged},
                                  linux_hal::MmioBlock::ns16550, 40'000'000, {.shift = 2, .width = 4}, 16);
}

INSTANTIATE_TEST_SUITE_P(Registers, PortConformance,
                         conformance_of({{"Pl011", pl011_automatic},
                                         {"Pl011Gpio", make_pl011_rig},
                                         {"Pl011Rts", pl011_rts_on},
                                         {"Pl011RtsOff", pl011_rts_off},
                                         {"Uart16550", uart16550_automatic},
                                         {"Uart16550WordsGpio", uart16550_words_gpio},
                                         {"Uart16550HalvesRts", uart16550_halves_rts},
                                         {"MmioPl011", mmio_pl011},
                                         {"MmioUart16550", mmio_uart16550}}),
                         conformance_name);

}  // namespace

std::unique_ptr<Rig> make_pl011_rig() {
  using Direction = mcu::CallDirection<ModelDriverPin<Pl011Model>>;
  using Port = mcu::PolledUartPort<Pl011Driver, Direction>;
  return std::make_unique<RegisterRig<Pl011Model, Port>>(
      Pl011Config{.depth = 16, .engine = kJudged},
      [](Pl011Model& model) {
        return polled_port<Pl011Driver>(model, 48'000'000, Direction{ModelDriverPin(model)},
                                        {.driver_lead = Time{1'000}, .capability = kCapability});
      },
      Time{200}, 16);
}

}  // namespace tm485::test
