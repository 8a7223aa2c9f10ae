// A PL011 as its registers show it, after ARM DDI 0183. Judges the register driver; shares nothing with it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "mcu/models/uart_engine.hpp"

namespace tm485::test {

struct Pl011Config {
  std::uint32_t clock_hz = 48'000'000;
  std::size_t depth = 32;       ///< 16 before revision r1p5
  bool present = true;          ///< false: the bus reads all ones
  bool clocked = true;          ///< false: registers keep nothing
  bool rts_is_driver = false;   ///< the RTS output switches the RS-485 driver
  bool rts_off_drives = false;  ///< with the other polarity
  bool interrupts = false;      ///< somebody takes them
  bool stuck = false;           ///< the transmitter never ends (a clock that stopped)
  EngineConfig engine = {};
};

class Pl011Model {
 public:
  explicit Pl011Model(const Pl011Config& config = {}) : config_(config), engine_(config.engine) {
    show_rts();
  }

  [[nodiscard]] UartEngine& engine() { return engine_; }
  void vanish() { config_.present = false; }
  void set_stuck(bool stuck) { config_.stuck = stuck; }
  [[nodiscard]] std::uint32_t integer_divisor() const { return ibrd_; }
  [[nodiscard]] std::uint32_t fractional_divisor() const { return fbrd_; }
  [[nodiscard]] std::uint32_t control() const { return cr_; }

  /// The combined interrupt line.
  [[nodiscard]] bool interrupt() {
    if (!config_.present || !config_.clocked) return false;
    note();
    return (ris_ & imsc_) != 0;
  }

  // Register access. The manual knows words only.
  std::uint8_t read8(std::size_t) noexcept { return wrong_width(), std::uint8_t{0}; }
  std::uint16_t read16(std::size_t) noexcept { return wrong_width(), std::uint16_t{0}; }
  void write8(std::size_t, std::uint8_t) noexcept { wrong_width(); }
  void write16(std::size_t, std::uint16_t) noexcept { wrong_width(); }

  std::uint32_t read32(std::size_t offset) noexcept {
    engine_.spend_access();
    if (!config_.present) return 0xFFFFFFFFu;
    if (!config_.clocked) return 0;
    note();
    switch (offset) {
      case 0x000:
        return read_data();
      case 0x004:
        return rsr_;
      case 0x018: {
        std::uint32_t flags = 0;
        if (engine_.transmitting() || config_.stuck) flags |= 0x08;
        if (engine_.receive_empty()) flags |= 0x10;
        if (engine_.transmit_full()) flags |= 0x20;
        if (engine_.receive_full()) flags |= 0x40;
        if (engine_.transmit_empty()) flags |= 0x80;
        return flags;
      }
      case 0x024:
        return ibrd_;
      case 0x028:
        return fbrd_;
      case 0x02C:
        return lcr_h_;
      case 0x030:
        return cr_;
      case 0x038:
        return imsc_;
      case 0x03C:
        return ris_;
      case 0x040:
        return ris_ & imsc_;
      default:
        engine_.complain("a read at an offset that is reserved or write-only");
        return 0;
    }
  }

  void write32(std::size_t offset, std::uint32_t value) noexcept {
    engine_.spend_access();
    if (!config_.present || !config_.clocked) return;
    note();
    switch (offset) {
      case 0x000:
        ris_ &= ~0x20u;
        return engine_.write(static_cast<std::uint8_t>(value));
      case 0x004:
        rsr_ = 0;
        overrun_to_tell_ = false;
        return;
      case 0x024:
        ibrd_ = value & 0xFFFF;
        return;
      case 0x028:
        fbrd_ = value & 0x3F;
        return;
      case 0x02C:
        return write_line_control(value & 0xFF);
      case 0x030:
        cr_ = value & 0xFF87;
        show_rts();
        return engine_.enable((cr_ & 0x301) == 0x301);
      case 0x038:
        imsc_ = value;
        if (value != 0 && !config_.interrupts) engine_.complain("an interrupt was enabled: nobody takes it");
        if (value != 0 && (lcr_h_ & 0x10) != 0)
          engine_.complain("interrupts with the FIFOs on, whose levels are not modelled");
        return;
      case 0x044:
        ris_ &= ~value;
        return;
      case 0x048:
        return;
      default:
        engine_.complain("a write at an offset that is reserved or read-only");
    }
  }

 private:
  void wrong_width() noexcept { engine_.complain("a register was not accessed as a word"); }

  void show_rts() {
    const bool rts = (cr_ & 0x800) != 0;
    if (config_.rts_is_driver) engine_.set_driver(config_.rts_off_drives ? !rts : rts);
  }

  /// The divisor takes effect with the write of the line control register (3.3.7).
  void write_line_control(std::uint32_t value) {
    const bool fifo = (value & 0x10) != 0;
    lcr_h_ = value;
    if (!fifo) {
      engine_.clear_receiver();
      engine_.clear_transmitter();
    }
    engine_.set_depth(fifo ? config_.depth : 1);
    if ((value & 0x60) != 0x60) return;
    if ((value & 0x0E) != 0) engine_.complain("the format is not 8N1");
    if (ibrd_ == 0 || (ibrd_ == 65535 && fbrd_ != 0)) return engine_.complain("an impossible divisor");
    const double bits_per_second = static_cast<double>(config_.clock_hz) /
                                   (16.0 * (static_cast<double>(ibrd_) + static_cast<double>(fbrd_) / 64.0));
    engine_.set_character_time(Time{static_cast<std::int64_t>(1e10 / bits_per_second + 0.5)});
  }

  std::uint32_t read_data() {
    if (engine_.receive_empty()) {
      engine_.complain("the data register was read although nothing was there");
      return 0;
    }
    const WaitingCharacter top = engine_.receive_top();
    engine_.receive_pop();
    std::uint32_t value = top.byte;
    if (top.framing_error) value |= 0x100;
    if (top.is_break) value |= 0x400;
    // The mark of an overrun comes with the first character that found room again (2.4.2).
    if (overrun_to_tell_ && !engine_.receive_full()) {
      value |= 0x800;
      overrun_to_tell_ = false;
    }
    return value;
  }

  /// Without FIFOs (2.8): the receive interrupt is there while a character waits; the transmit interrupt is made by the
  /// holding register's running empty, and cleared by a write to either it or the register.
  void note() {
    ris_ = engine_.receive_empty() ? ris_ & ~0x10u : ris_ | 0x10u;
    if (std::exchange(shifts_, engine_.shifts()) != engine_.shifts() && engine_.transmit_empty())
      ris_ |= 0x20;
    if (engine_.take_overruns() == 0) return;
    rsr_ |= 0x8;
    ris_ |= 0x400;
    overrun_to_tell_ = true;
  }

  Pl011Config config_;
  UartEngine engine_;
  std::uint32_t ibrd_ = 0, fbrd_ = 0, lcr_h_ = 0, cr_ = 0x300, imsc_ = 0, ris_ = 0, rsr_ = 0, shifts_ = 0;
  bool overrun_to_tell_ = false;
};

}  // namespace tm485::test
