// The APB UART of the CMSDK as its registers show it, after ARM DDI 0479, 4.3. Judges the register driver; shares
// nothing with it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "mcu/models/uart_engine.hpp"

namespace tm485::test {

struct CmsdkConfig {
  std::uint32_t clock_hz = 50'000'000;
  bool present = true;
  bool keeps = true;
  bool interrupts = false;  ///< somebody takes them
  EngineConfig engine = {};
};

class CmsdkModel {
 public:
  explicit CmsdkModel(const CmsdkConfig& config = {}) : config_(config), engine_(config.engine) {
    engine_.set_depth(1);
  }

  [[nodiscard]] UartEngine& engine() { return engine_; }
  void vanish() { config_.present = false; }

  /// Both interrupt lines.
  [[nodiscard]] bool interrupt() {
    if (!config_.present || !config_.keeps) return false;
    note();
    return due_ != 0;
  }

  std::uint8_t read8(std::size_t) noexcept { return wrong_width(), std::uint8_t{0}; }
  std::uint16_t read16(std::size_t) noexcept { return wrong_width(), std::uint16_t{0}; }
  void write8(std::size_t, std::uint8_t) noexcept { wrong_width(); }
  void write16(std::size_t, std::uint16_t) noexcept { wrong_width(); }

  std::uint32_t read32(std::size_t offset) noexcept {
    engine_.spend_access();
    if (!config_.present) return 0xFFFFFFFFu;
    if (!config_.keeps) return 0;
    note();
    switch (offset) {
      case 0x0: {
        if (engine_.receive_empty()) return 0;
        const std::uint8_t byte = engine_.receive_top().byte;
        engine_.receive_pop();
        return byte;
      }
      case 0x4:
        return (engine_.transmit_full() ? 1u : 0u) | (engine_.receive_empty() ? 0u : 2u) |
               (overrun_ ? 8u : 0u);
      case 0x8:
        return control_;
      case 0xC:
        return due_;
      case 0x10:
        return divisor_;
      default:
        engine_.complain("a read of a register that has no use here");
        return 0;
    }
  }

  void write32(std::size_t offset, std::uint32_t value) noexcept {
    engine_.spend_access();
    if (!config_.present || !config_.keeps) return;
    note();
    switch (offset) {
      case 0x0:
        return engine_.write(static_cast<std::uint8_t>(value));
      case 0x4:
        if ((value & 8) != 0) overrun_ = false;
        return;
      case 0x8:
        control_ = value & 0x7F;
        if ((control_ & (config_.interrupts ? 0x70 : 0x7C)) != 0)
          engine_.complain("an interrupt or a test mode is on");
        if ((control_ & 1) == 0) engine_.clear_transmitter();
        return engine_.enable((control_ & 3) == 3);
      case 0xC:
        due_ &= ~value;
        return;
      case 0x10:
        divisor_ = value & 0xFFFFF;
        if (divisor_ < 16) return engine_.complain("a divisor below 16");
        engine_.set_character_time(Time{static_cast<std::int64_t>(
            1e10 * static_cast<double>(divisor_) / static_cast<double>(config_.clock_hz) + 0.5)});
        return;
      default:
        engine_.complain("a write to a register that has no use here");
    }
  }

 private:
  /// The transmit interrupt is made when the buffer runs empty, the receive one when a character comes; each only with
  /// its switch on, and it stays until it is cleared.
  void note() {
    overrun_ = overrun_ || engine_.take_overruns() != 0;
    if (std::exchange(shifts_, engine_.shifts()) != engine_.shifts() && (control_ & 4) != 0) due_ |= 1;
    if (std::exchange(received_, engine_.received()) != engine_.received() && (control_ & 8) != 0) due_ |= 2;
  }

  void wrong_width() noexcept { engine_.complain("a register was not accessed as a word"); }

  CmsdkConfig config_;
  UartEngine engine_;
  std::uint32_t control_ = 0, divisor_ = 0, due_ = 0, shifts_ = 0, received_ = 0;
  bool overrun_ = false;
};

}  // namespace tm485::test
