// The whole bus over an interrupt-driven register driver, with the simulated encoder at the other end of its model's line:
// slots begin in a timer's interrupt, exchanges end in the receive interrupt.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <functional>
#include <string>
#include <vector>

#include "mcu/interrupt_line.hpp"
#include "mcu/model_access.hpp"
#include "mcu/models/uart_engine.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/mcu/baud.hpp"
#include "tm485/mcu/interrupt_uart_port.hpp"
#include "tm485/sim/encoder_model.hpp"

namespace tm485::test {

inline constexpr Time kLead{1'000};
inline constexpr double kRpm = 3'000.0;
inline constexpr EngineConfig kJudged{
    .start_delay = Time{300}, .access = Time{40}, .judge_driver = true, .driver_lead = kLead};

/// Whose interrupt is above whose: the UART's, and that of the timer, which has the bus.
enum class Priorities : std::uint8_t { same, uart_higher };

struct Setting {
  std::uint32_t clock_hz = 0;
  DataId id = DataId::everything;
  Time period{62'500};
  Time latency{400};
  Priorities priorities = Priorities::same;
  Time hardware_release{0};
};

inline BusConfig cyclic(const Setting& setting) {
  BusConfig config;
  config.cycle = Cycle{.id = setting.id, .period = setting.period};
  return config;
}

template <class M, class U, class D>
class InterruptBus {
 public:
  using UnderTest = mcu::InterruptUartPort<U, D, LineTimer<M>>;

  template <class... Extra>
  InterruptBus(const auto& config, D (*direction)(M&), const Setting& setting, Extra... extra)
      : setting_(setting),
        model_(config),
        line_(model_, setting.latency),
        encoder_({}, sim::MotionProfile::constant(kRpm)),
        port_(U(ModelAccess(model_), extra...), direction(model_),
              {.driver_lead = model_.engine().judges_driver() ? kLead : Time{0},
               .hardware_release = setting.hardware_release,
               .capability = {.jitter_margin = Time{1'000},
                              .latency_allowance = Time{5'000},
                              .release_bound = Time{2'800}}},
              LineTimer(line_)),
        profile_(*CompiledProfile::compile(*find_profile("tm485_17"))),
        bus_(port_, profile_, cyclic(setting)) {
    EXPECT_TRUE(port_.start(*mcu::solve_baud(U::kFamily, setting.clock_hz, 2'500'000)));
    model_.engine().on_sent = [this](const LineCharacter& sent) { hear(sent); };
    line_.on_interrupt = [this](Time now) {
      port_.on_interrupt(now);
      // Of the same priority it is the bus's owner itself; of a higher one it asks for the owner's interrupt.
      if (setting_.priorities == Priorities::same) {
        poll();
      } else {
        pending_ = true;
      }
    };
    line_.on_timer = [this](Time now) { port_.on_timer(now); };
    if (setting.priorities == Priorities::uart_higher) line_.interrupt_owner();
    EXPECT_TRUE(bus_.start(Time{0}));
  }

  [[nodiscard]] Bus<UnderTest>& bus() { return bus_; }
  [[nodiscard]] M& model() { return model_; }
  [[nodiscard]] InterruptLine<M>& line() { return line_; }
  [[nodiscard]] sim::EncoderModel& encoder() { return encoder_; }
  /// Goes around each call of the bus, with the call.
  std::function<void(const std::function<void()>&)> around_poll;

  void run(std::uint32_t cycles) {
    UartEngine& engine = model_.engine();
    const Time end = engine.now() + std::chrono::seconds(20);
    while (bus_.statistics().cycles < cycles && engine.now() < end) {
      if (pending_ || engine.now() >= due_) {
        pending_ = false;
        poll();
      } else {
        line_.run_to(std::min(due_, line_.next()));
      }
    }
  }

  void expect_no_fault() {
    EXPECT_EQ(bus_.statistics().failed, 0U);
    EXPECT_EQ(bus_.statistics().stray_bytes, 0U);
    EXPECT_EQ(encoder_.t1().violations(), 0U);
    EXPECT_EQ(bus_.latest().position(), encoder_.last_latch().counts);
    EXPECT_EQ(model_.engine().complaints(), std::vector<std::string>{});
  }

  void expect_clean(std::uint32_t cycles) {
    run(cycles);
    expect_no_fault();
    EXPECT_GE(bus_.statistics().cycles, cycles);
    const Time now = model_.engine().now();
    std::printf("ID%u every %.1f us: %.1f us in the mean, start-up included\n", number(setting_.id),
                static_cast<double>(setting_.period.count()) * 1e-3,
                static_cast<double>(now.count()) * 1e-3 / cycles);
    EXPECT_LE(now, setting_.period * cycles * 110 / 100 + std::chrono::milliseconds(50));
  }

 private:
  void poll() {
    UartEngine& engine = model_.engine();
    // The end of an exchange is known from a second call, whose `now` is later.
    do {
      const Time now = engine.now();
      if (around_poll) {
        around_poll([this, now] { due_ = bus_.poll(now); });
      } else {
        due_ = bus_.poll(now);
      }
      engine.spend_access();
    } while (due_ <= engine.now());
  }

  void hear(const LineCharacter& sent) {
    sim::Burst reply;
    if (!encoder_.on_character(sent.byte, sent.start, sent.end, sent.stop_bit, sim::Judged::yes, reply))
      return;
    for (std::uint8_t k = 0; k < reply.count; ++k) {
      const Time start = reply.start + Time{4'000} * k;
      model_.engine().arrive({reply.bytes[k], start, start + Time{4'000}, true});
    }
  }

  Setting setting_;
  M model_;
  InterruptLine<M> line_;
  sim::EncoderModel encoder_;
  UnderTest port_;
  CompiledProfile profile_;
  Bus<UnderTest> bus_;
  Time due_{0};
  bool pending_ = false;
};

template <class M>
using PinDirection = mcu::CallDirection<ModelDriverPin<M>>;
template <class M>
PinDirection<M> pin(M& model) {
  return {ModelDriverPin(model)};
}

}  // namespace tm485::test
