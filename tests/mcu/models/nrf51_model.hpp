// The UART of the nRF51 as its registers show it, after the nRF51 Reference Manual 3.0, chapter 29. Judges the register
// driver; shares nothing with it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "mcu/models/uart_engine.hpp"

namespace tm485::test {

struct Nrf51Config {
  /// 16 MHz in silicon. The rate is so many 2^-32 of it as BAUDRATE says.
  std::uint32_t clock_hz = 16'000'000;
  bool present = true;
  bool keeps = true;
  EngineConfig engine = {};
};

class Nrf51Model {
 public:
  explicit Nrf51Model(const Nrf51Config& config = {}) : config_(config), engine_(config.engine) {
    engine_.set_depth(6);
  }

  [[nodiscard]] UartEngine& engine() { return engine_; }
  void vanish() { config_.present = false; }

  std::uint8_t read8(std::size_t) noexcept { return wrong_width(), std::uint8_t{0}; }
  std::uint16_t read16(std::size_t) noexcept { return wrong_width(), std::uint16_t{0}; }
  void write8(std::size_t, std::uint8_t) noexcept { wrong_width(); }
  void write16(std::size_t, std::uint16_t) noexcept { wrong_width(); }

  std::uint32_t read32(std::size_t offset) noexcept {
    engine_.spend_access();
    if (!config_.present) return 0xFFFFFFFFu;
    if (!config_.keeps) return 0;
    update();
    switch (offset) {
      case 0x108:
        return received_;
      case 0x11C:
        return sent_;
      case 0x480:
        return errors_;
      case 0x500:
        return enable_;
      case 0x518:
        return take();
      case 0x524:
        return rate_;
      default:
        engine_.complain("a read of a register that has no use here");
        return 0;
    }
  }

  void write32(std::size_t offset, std::uint32_t value) noexcept {
    engine_.spend_access();
    if (!config_.present || !config_.keeps) return;
    update();
    switch (offset) {
      case 0x000:
        receiving_ = receiving_ || value != 0;
        break;
      case 0x004:
        receiving_ = receiving_ && value == 0;
        break;
      case 0x008:
        sending_ = sending_ || value != 0;
        break;
      case 0x00C:
        sending_ = sending_ && value == 0;
        break;
      case 0x108:
        received_ = value;
        break;
      case 0x11C:
        sent_ = value;
        break;
      case 0x308:
        break;
      case 0x480:
        errors_ &= ~value;
        break;
      case 0x500:
        enable_ = value;
        break;
      case 0x51C:
        send(static_cast<std::uint8_t>(value));
        break;
      case 0x524:
        if (receiving_ || sending_) engine_.complain("the rate was changed while the UART worked");
        rate_ = value;
        if (rate_ != 0)
          engine_.set_character_time(Time{static_cast<std::int64_t>(
              1e10 * 4294967296.0 / (static_cast<double>(rate_) * static_cast<double>(config_.clock_hz)) +
              0.5)});
        break;
      case 0x56C:
        if (value != 0) engine_.complain("parity or flow control is on");
        break;
      default:
        engine_.complain("a write to a register that has no use here");
    }
    engine_.enable(enable_ == 4 && receiving_ && sending_);
  }

 private:
  void wrong_width() noexcept { engine_.complain("a register was not accessed as a word"); }

  /// What the block has done by itself: its events.
  void update() noexcept {
    if (leaving_ && !engine_.transmitting()) {
      leaving_ = false;
      sent_ = 1;
    }
    if (engine_.take_overruns() != 0) errors_ |= 1;
    if (!shown_ && !engine_.receive_empty()) {
      shown_ = true;
      received_ = 1;
      if (engine_.receive_top().is_break) errors_ |= 8;
      if (engine_.receive_top().framing_error) errors_ |= 4;
    }
  }

  std::uint32_t take() noexcept {
    if (!shown_) {
      engine_.complain("a byte was read that is not there");
      return 0;
    }
    if (received_ != 0)
      engine_.complain("the event of a byte was still set when it was read: it will be lost");
    const std::uint8_t byte = engine_.receive_top().byte;
    engine_.receive_pop();
    shown_ = false;
    update();
    return byte;
  }

  void send(std::uint8_t byte) noexcept {
    if (leaving_) return engine_.complain("a byte was written before the one before had left");
    if (sent_ != 0) engine_.complain("a byte was written while the event of the one before was set");
    leaving_ = true;
    engine_.write(byte);
  }

  Nrf51Config config_;
  UartEngine engine_;
  std::uint32_t enable_ = 0, rate_ = 0, errors_ = 0, received_ = 0, sent_ = 0;
  bool receiving_ = false, sending_ = false;
  bool leaving_ = false;  // a byte is on its way
  bool shown_ = false;    // the oldest byte stands in RXD
};

}  // namespace tm485::test
