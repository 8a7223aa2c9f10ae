#include "node.hpp"

#include <algorithm>

#include "board.h"
#include "clock.h"
#include "core_interrupts.h"
#include "cortex_m.h"
#include "tm485/mcu/baud.hpp"

namespace servo_node {
namespace {

using tm485::Errc;
using tm485::Time;

/// TM485 with 17 bit, without a battery: compiled by the compiler, kept in flash.
constexpr tm485::CompiledProfile kProfile = *tm485::CompiledProfile::compile(tm485::Profile{});
static_assert(kEepromBytes ==
              std::size_t{kProfile.profile().eeprom_pages} * kProfile.profile().eeprom_page_bytes);

/// Solved and judged by the compiler: a clock that does not make the rate does not build.
constexpr auto kDivisor =
    *tm485::mcu::solve_baud(BoardUart::kFamily, BOARD_ENCODER_UART_HZ, BOARD_ENCODER_BIT_RATE);

/// While a request is leaving, the bus looks this often, should an interrupt of the transmitter stay away: the emulated
/// USART has none. In silicon it comes first.
constexpr Time kLookEvery{50'000};

Time clock() noexcept { return Time{clock_now()}; }

/// In a drive: the pin that enables the torque, off at once and here. These boards have no motor.
void torque_off(void*, Time) noexcept {}

}  // namespace

bool DriverPin::operator()(bool on) const noexcept {
  board_drive(on);
  return true;
}

Node::Node() noexcept : manager_(kProfile) {}

std::expected<void, tm485::CycleRefusal> Node::start(const Parameters& parameters) noexcept {
  if (running_) return std::unexpected(tm485::CycleRefusal{Errc::busy});
  tm485::mcu::InterruptPortConfig line;
  line.stuck_after = parameters.allowance + Time{1'000'000};
  line.capability = {.latency_allowance = parameters.allowance, .timing = tm485::TimingClass::hard};
  port_.emplace(BoardUart(tm485::mcu::VolatileRegisters(std::uintptr_t{BOARD_ENCODER_UART})),
                tm485::mcu::CallDirection<DriverPin>{}, line);
  if (const auto ready = port_->start(kDivisor); !ready)
    return std::unexpected(tm485::CycleRefusal{ready.error()});

  gains_ = gains_for(parameters.period);
  tm485::AxisSetup setup;
  setup.bus.cycle = tm485::Cycle{.id = tm485::DataId::everything, .period = parameters.period};
  setup.bus.max_hold = 16 * parameters.period + 2 * parameters.allowance;
  setup.bus.eeprom_may_hold = true;  // a page select takes 18 ms of the line
  setup.on_invalid.call = torque_off;
  setup.gains = &gains_;
  if (!valid(gains_)) return std::unexpected(tm485::CycleRefusal{Errc::bad_argument});
  axis_.emplace(*port_, kProfile, setup);
  if (const auto started = axis_->start(clock()); !started) return started;

  running_ = true;
  control_every_ = parameters.period;
  next_control_ = clock();
  core_interrupts_start();
  for (const unsigned number : {BOARD_ENCODER_INTERRUPTS}) interrupt_on(number, PRIORITY_BUS);
  bus_timer_in(0);
  return {};
}

Time Node::poll(Time now) noexcept {
  if (eeprom_.load(std::memory_order_acquire) == Eeprom::wanted) {
    const bool begun = manager_.start_read(0, eeprom_bytes_).has_value();
    eeprom_.store(begun ? Eeprom::reading : Eeprom::done, std::memory_order_relaxed);
  }
  const Time due = axis_->poll(now);
  const Time asked = drive(manager_, axis_->bus(), now);
  if (eeprom_.load(std::memory_order_relaxed) == Eeprom::reading && !manager_.active())
    eeprom_.store(Eeprom::done, std::memory_order_release);
  const bool leaving = port_->transmission(now).state == tm485::Transmission::State::sending;
  return std::min({due, asked, leaving ? now + kLookEvery : tm485::kNever});
}

// For both interrupts of the bus: they have one priority, and a call without cause is harmless.
void Node::on_bus() noexcept {
  const Time now = clock();
  port_->on_interrupt(now);
  if (now >= next_control_) {
    control_now();  // preempts this
    while (next_control_ <= now) next_control_ += control_every_;
  }
  const Time due = std::min(poll(now), next_control_);
  bus_timer_in((due - clock()).count());
}

void Node::on_control() noexcept {
  tm485::AxisClient& client = axis_->client();
  const Time now = clock();
  const tm485::LoopState state = client.read(now);
  next_.shaft = client.estimate_at(now);  // at this instant, not at that of the sample
  next_.sample = *state.sample;
  next_.validity = state.validity;
  next_.latched = client.view().latched;
  next_.state = client.view().state;
  next_.startup_cause = client.view().startup_cause;
  ++next_.ticks;
  if (state.validity == tm485::SampleValidity::fresh) ++next_.fresh;
  // A drive goes on here: the position loop with next_.shaft, torque only while state.usable().

  if (resume_wanted_.load(std::memory_order_relaxed) &&
      client.post(tm485::Command::of(tm485::Command::Kind::resume)))
    resume_wanted_.store(false, std::memory_order_relaxed);
  while (client.poll_completion()) {
  }
  shown_.put(next_);
}

bool Node::read_eeprom() noexcept {
  if (eeprom_.load(std::memory_order_relaxed) != Eeprom::idle) return false;
  eeprom_.store(Eeprom::wanted, std::memory_order_release);
  return true;
}

std::optional<tm485::EepromError> Node::take_eeprom_outcome() noexcept {
  if (eeprom_.load(std::memory_order_acquire) != Eeprom::done) return std::nullopt;
  const auto outcome = manager_.outcome();
  eeprom_.store(Eeprom::idle, std::memory_order_relaxed);
  return outcome ? outcome : tm485::EepromError{Errc::bad_argument};
}

}  // namespace servo_node
