// The whole bus over register drivers, against the simulated encoder, in character time, as fast as T1 allows.
#include <gtest/gtest.h>

#include <array>
#include <cstdio>
#include <vector>

#include "mcu/model_access.hpp"
#include "mcu/models/pl011_model.hpp"
#include "mcu/models/uart16550_model.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/mcu/pl011.hpp"
#include "tm485/mcu/polled_uart_port.hpp"
#include "tm485/mcu/uart16550.hpp"
#include "tm485/sim/encoder_model.hpp"

namespace tm485::test {
namespace {

/// The simulated encoder at the other end of a UART model's line, and a loop that polls a bus on it.
template <class M, class U>
class RegisterBus {
 public:
  using Direction = mcu::CallDirection<ModelDriverPin<M>>;
  using UnderTest = mcu::PolledUartPort<U, Direction>;

  RegisterBus(const auto& config, std::uint32_t clock_hz, Time grain)
      : model_(config),
        encoder_({}, sim::MotionProfile::constant(3'000.0)),
        port_(U(ModelAccess(model_)), Direction{ModelDriverPin(model_)},
              {.driver_lead = Time{1'000},
               .capability = {.jitter_margin = grain * 2,
                              .latency_allowance = Time{20'000},
                              .release_bound = grain}}),
        grain_(grain) {
    EXPECT_TRUE(port_.start(*mcu::solve_baud(U::kFamily, clock_hz, 2'500'000)));
    model_.engine().on_sent = [this](const LineCharacter& sent) { hear(sent); };
  }

  UnderTest& port() { return port_; }
  M& model() { return model_; }
  sim::EncoderModel& encoder() { return encoder_; }

  template <class Bus>
  void run(Bus& bus, std::uint32_t cycles) {
    UartEngine& engine = model_.engine();
    const Time end = engine.now() + std::chrono::seconds(20);
    while (bus.statistics().cycles < cycles && engine.now() < end) {
      const Time due = bus.poll(engine.now());
      // In flight the loop spins; otherwise it sleeps until something is due.
      const bool flying = port_.transmission(engine.now()).state == Transmission::State::sending ||
                          engine.now() < busy_until_;
      engine.advance_to(flying ? engine.now() + grain_ : std::max(engine.now() + grain_, due));
    }
  }

 private:
  void hear(const LineCharacter& sent) {
    sim::Burst reply;
    busy_until_ = sent.end + Time{60'000};
    if (!encoder_.on_character(sent.byte, sent.start, sent.end, sent.stop_bit, sim::Judged::yes, reply))
      return;
    for (std::uint8_t k = 0; k < reply.count; ++k) {
      const Time start = reply.start + Time{4'000} * k;
      model_.engine().arrive({reply.bytes[k], start, start + Time{4'000}, true});
    }
  }

  M model_;
  sim::EncoderModel encoder_;
  UnderTest port_;
  Time grain_;
  Time busy_until_{0};
};

constexpr EngineConfig kJudged{
    .start_delay = Time{300}, .access = Time{80}, .judge_driver = true, .driver_lead = Time{1'000}};

template <class M, class U>
void expect_clean(const auto& config, std::uint32_t clock_hz, DataId id, Time period) {
  RegisterBus<M, U> rig(config, clock_hz, Time{250});
  const auto profile = CompiledProfile::compile(*find_profile("tm485_17"));
  BusConfig bus_config;
  bus_config.cycle = Cycle{.id = id, .period = period};
  Bus bus(rig.port(), *profile, bus_config);
  ASSERT_TRUE(bus.start(Time{0}));
  constexpr std::uint32_t kCycles = 10'000;
  rig.run(bus, kCycles);
  EXPECT_GE(bus.statistics().cycles, kCycles);
  EXPECT_EQ(bus.statistics().failed, 0U);
  EXPECT_EQ(bus.statistics().stray_bytes, 0U);
  EXPECT_EQ(rig.encoder().t1().violations(), 0U);
  EXPECT_EQ(bus.latest().position(), rig.encoder().last_latch().counts);
  EXPECT_EQ(rig.model().engine().complaints(), std::vector<std::string>{});
  std::printf("ID%u every %.1f us: %.1f us in the mean, start-up included\n", number(id),
              static_cast<double>(period.count()) * 1e-3,
              static_cast<double>(rig.model().engine().now().count()) * 1e-3 / bus.statistics().cycles);
  // Where a request's start is not seen on the wire, the bus keeps T1 from the latest instant that is possible: that
  // costs the spread of T2, the lead and the grain of the loop, and no cycle.
  EXPECT_LE(rig.model().engine().now(), period * kCycles * 110 / 100 + std::chrono::milliseconds(50));
}

TEST(BusOnRegisters, Pl011ReadsPositions) {
  expect_clean<Pl011Model, mcu::Pl011<ModelAccess<Pl011Model>>>(
      Pl011Config{.depth = 16, .engine = kJudged}, 48'000'000, DataId::single_turn, Time{40'000});
}
TEST(BusOnRegisters, Pl011ReadsEverything) {
  expect_clean<Pl011Model, mcu::Pl011<ModelAccess<Pl011Model>>>(Pl011Config{.engine = kJudged}, 48'000'000,
                                                                DataId::everything, Time{62'500});
}
TEST(BusOnRegisters, Uart16550ReadsPositions) {
  expect_clean<Uart16550Model, mcu::Uart16550<ModelAccess<Uart16550Model>>>(
      Uart16550Config{.engine = kJudged}, 40'000'000, DataId::single_turn, Time{40'000});
}

}  // namespace
}  // namespace tm485::test
