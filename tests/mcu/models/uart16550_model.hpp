// A 16550A as its registers show it, after National's PC16550D. Judges the register driver; shares nothing with it.
#pragma once

#include <cstddef>
#include <cstdint>

#include "mcu/models/uart_engine.hpp"

namespace tm485::test {

struct Uart16550Config {
  std::uint32_t clock_hz = 40'000'000;
  unsigned shift = 0;
  unsigned width = 1;           ///< bytes; an access of another width is a mistake
  bool fifos = true;            ///< false: a 16450
  bool present = true;          ///< false: the bus reads all ones
  bool keeps = true;            ///< false: registers keep nothing
  bool rts_is_driver = false;   ///< the RTS output switches the RS-485 driver
  bool rts_off_drives = false;  ///< with the other polarity
  bool stuck = false;           ///< the transmitter never ends
  EngineConfig engine = {};
};

class Uart16550Model {
 public:
  explicit Uart16550Model(const Uart16550Config& config = {}) : config_(config), engine_(config.engine) {
    engine_.set_depth(1);
    engine_.enable(true);
    show_rts();
  }

  [[nodiscard]] UartEngine& engine() { return engine_; }
  void vanish() { config_.present = false; }
  void set_stuck(bool stuck) { config_.stuck = stuck; }
  [[nodiscard]] unsigned divisor() const { return divisor_; }

  std::uint8_t read8(std::size_t offset) noexcept { return static_cast<std::uint8_t>(read(offset, 1)); }
  std::uint16_t read16(std::size_t offset) noexcept { return static_cast<std::uint16_t>(read(offset, 2)); }
  std::uint32_t read32(std::size_t offset) noexcept { return read(offset, 4); }
  void write8(std::size_t offset, std::uint8_t value) noexcept { write(offset, value, 1); }
  void write16(std::size_t offset, std::uint16_t value) noexcept { write(offset, value, 2); }
  void write32(std::size_t offset, std::uint32_t value) noexcept { write(offset, value, 4); }

 private:
  [[nodiscard]] bool dlab() const { return (lcr_ & 0x80) != 0; }

  /// The number of the register; 8 if there is none.
  unsigned number(std::size_t offset, unsigned width) {
    engine_.spend_access();
    if (width != config_.width) engine_.complain("an access of the wrong width");
    const std::size_t distance = std::size_t{1} << config_.shift;
    if (offset % distance != 0 || offset / distance > 7) {
      engine_.complain("an access beside the registers");
      return 8;
    }
    return static_cast<unsigned>(offset / distance);
  }

  std::uint32_t read(std::size_t offset, unsigned width) {
    const unsigned which = number(offset, width);
    if (!config_.present) return 0xFFFFFFFFu;
    if (!config_.keeps) return 0;
    switch (which) {
      case 0:
        return dlab() ? divisor_ & 0xFF : read_data();
      case 1:
        return dlab() ? divisor_ >> 8 : ier_;
      case 2:
        return (fifo_enabled_ ? 0xC0u : 0u) | 0x01u;
      case 3:
        return lcr_;
      case 4:
        return mcr_;
      case 5:
        return read_line_status();
      default:
        return 0;
    }
  }

  void write(std::size_t offset, std::uint32_t value, unsigned width) {
    const unsigned which = number(offset, width);
    if (!config_.present || !config_.keeps) return;
    value &= 0xFF;
    switch (which) {
      case 0:
        if (!dlab()) return engine_.write(static_cast<std::uint8_t>(value));
        divisor_ = (divisor_ & 0xFF00) | value;
        return take_divisor();
      case 1:
        if (dlab()) {
          divisor_ = (divisor_ & 0xFF) | value << 8;
          return take_divisor();
        }
        ier_ = value;
        if (value != 0) engine_.complain("an interrupt was enabled: nobody takes it");
        return;
      case 2:
        fifo_enabled_ = config_.fifos && (value & 1) != 0;
        if (fifo_enabled_ && (value & 2) != 0) engine_.clear_receiver();
        if (fifo_enabled_ && (value & 4) != 0) engine_.clear_transmitter();
        engine_.set_depth(fifo_enabled_ ? 16 : 1);
        return;
      case 3:
        lcr_ = value;
        if ((value & 0x7F) != 0x03) engine_.complain("the format is not 8N1");
        return;
      case 4:
        mcr_ = value;
        return show_rts();
      default:
        engine_.complain("a write to a register that has no use here");
    }
  }

  void show_rts() {
    const bool rts = (mcr_ & 2) != 0;
    if (config_.rts_is_driver) engine_.set_driver(config_.rts_off_drives ? !rts : rts);
  }

  void take_divisor() {
    if (divisor_ == 0) return;
    const double bits_per_second =
        static_cast<double>(config_.clock_hz) / (16.0 * static_cast<double>(divisor_));
    engine_.set_character_time(Time{static_cast<std::int64_t>(1e10 / bits_per_second + 0.5)});
  }

  std::uint32_t read_data() {
    if (engine_.receive_empty()) {
      engine_.complain("the data register was read although nothing was there");
      return 0;
    }
    const std::uint8_t byte = engine_.receive_top().byte;
    engine_.receive_pop();
    return byte;
  }

  /// Error bits are those of the character at the top; reading them clears them, and the overrun.
  std::uint32_t read_line_status() {
    std::uint32_t status = 0;
    if (engine_.take_overruns() != 0) status |= 0x02;
    if (!engine_.receive_empty()) {
      WaitingCharacter& top = engine_.receive_top();
      status |= 0x01;
      if (top.framing_error) status |= 0x08;
      if (top.is_break) status |= 0x10;
      if (top.framing_error && fifo_enabled_) status |= 0x80;
      top.framing_error = false;
      top.is_break = false;
    }
    if (engine_.transmit_empty()) status |= 0x20;
    if (!engine_.transmitting() && !config_.stuck) status |= 0x40;
    return status;
  }

  Uart16550Config config_;
  UartEngine engine_;
  bool fifo_enabled_ = false;
  unsigned divisor_ = 0;
  std::uint32_t ier_ = 0, lcr_ = 0, mcr_ = 0;
};

}  // namespace tm485::test
