// The node: one encoder on one line, in three contexts.
//
//   bus      bus timer and UART, one priority: Axis::poll, EEPROM tasks
//   control  the control loop's interrupt, which preempts the bus: AxisClient
//   main     the console: shown(), statistics(), requests
//
// None waits for another; between them are the axis's own link, a LatestValue, and a few flags of one byte.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>

#include "board_uart.hpp"
#include "parameters.hpp"
#include "tm485/bus/axis.hpp"
#include "tm485/bus/eeprom.hpp"
#include "tm485/mcu/direction.hpp"
#include "tm485/mcu/interrupt_uart_port.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/sync/latest_value.hpp"

namespace servo_node {

/// The driver-enable pin.
struct DriverPin {
  bool operator()(bool on) const noexcept;
};

/// What the control loop has seen last.
struct Shown {
  tm485::Estimate shaft;
  tm485::Sample sample;
  tm485::SampleValidity validity = tm485::SampleValidity::invalid;
  bool latched = false;
  tm485::BusState state = tm485::BusState::stopped;
  tm485::Errc startup_cause = tm485::Errc::ok;
  std::uint32_t ticks = 0;  ///< of the control loop
  std::uint32_t fresh = 0;  ///< of these, with a fresh sample
};

inline constexpr std::size_t kEepromBytes = std::size_t{7} * 127;

class Node {
 public:
  Node() noexcept;

  // Main.
  /// Sets the line up and begins; the interrupts go on by themselves from here. Errors: those of the UART's driver and of
  /// Axis::start; busy if it runs. Nothing runs after an error.
  [[nodiscard]] std::expected<void, tm485::CycleRefusal> start(const Parameters& parameters) noexcept;
  [[nodiscard]] bool running() const noexcept { return running_; }
  /// As of the control loop's last tick. Good until the next call.
  [[nodiscard]] const Shown& shown() noexcept { return shown_.get(); }
  /// False: ask again.
  [[nodiscard]] bool statistics(tm485::Statistics& to) const noexcept {
    return axis_->client().statistics(to);
  }
  /// Leaves the latched invalid state: the operator says so.
  void resume() noexcept { resume_wanted_.store(true, std::memory_order_relaxed); }
  /// Reads the whole EEPROM. False: it is being read.
  [[nodiscard]] bool read_eeprom() noexcept;
  /// How that has ended, once.
  [[nodiscard]] std::optional<tm485::EepromError> take_eeprom_outcome() noexcept;
  [[nodiscard]] std::span<const std::uint8_t> eeprom() const noexcept { return eeprom_bytes_; }

  // Interrupts.
  void on_bus() noexcept;
  void on_control() noexcept;

 private:
  enum class Eeprom : std::uint8_t { idle, wanted, reading, done };
  using Port = tm485::mcu::InterruptUartPort<BoardUart, tm485::mcu::CallDirection<DriverPin>>;

  [[nodiscard]] tm485::Time poll(tm485::Time now) noexcept;

  std::optional<Port> port_;
  std::optional<tm485::Axis<Port>> axis_;
  tm485::EepromManager manager_;
  tm485::EstimatorGains gains_;
  std::array<std::uint8_t, kEepromBytes> eeprom_bytes_{};
  tm485::LatestValue<Shown> shown_;
  Shown next_;
  std::atomic<bool> resume_wanted_ = false;
  std::atomic<Eeprom> eeprom_ = Eeprom::idle;
  tm485::Time control_every_{0};
  tm485::Time next_control_{0};
  bool running_ = false;
};

}  // namespace servo_node
