// An interrupt-driven UART on a register-level model with character time, as a rig of the port's contract.
#pragma once

#include <cstdint>
#include <optional>

#include "conformance/register_rig.hpp"
#include "mcu/interrupt_line.hpp"
#include "tm485/mcu/interrupt_uart_port.hpp"

namespace tm485::test {

/// What interrupts the owner of the port: the UART's priority against its own.
enum class UartPriority : std::uint8_t { same, higher };

struct InterruptRigConfig {
  std::uint32_t clock_hz;
  Time latency{300};
  Time grain{2'000};
  UartPriority priority = UartPriority::higher;
};

/// A base, since the port that the next one makes refers to it.
template <class M>
struct LineOfRig {
  std::optional<InterruptLine<M>> line_;
};

/// `Make`: makes the port of a model and its interrupt line.
template <class M, class P>
class InterruptRig : private LineOfRig<M>, public RegisterRig<M, P> {
  using LineOfRig<M>::line_;

 public:
  template <class Make>
  InterruptRig(const auto& config, const InterruptRigConfig& rig, const Make& make)
      : RegisterRig<M, P>(
            config,
            [&](M& model) -> P {
              line_.emplace(model, rig.latency);
              return make(model, *line_);
            },
            rig.grain, P::kRoom) {
    line_->on_interrupt = [this](Time now) { this->port().on_interrupt(now); };
    if constexpr (requires(P& port, Time now) { port.on_timer(now); })
      line_->on_timer = [this](Time now) { this->port().on_timer(now); };
    const auto divisor = mcu::solve_baud(P::kFamily, rig.clock_hz, 2'500'000);
    EXPECT_TRUE(divisor && this->port().start(*divisor));
    if (rig.priority == UartPriority::higher) line_->interrupt_owner();
  }

  void pass(Time span) override { line_->run_to(this->now() + span); }
  /// Its interrupt comes once more.
  bool vanish() override {
    (void)RegisterRig<M, P>::vanish();
    this->port().on_interrupt(this->now());
    return true;
  }
};

}  // namespace tm485::test
