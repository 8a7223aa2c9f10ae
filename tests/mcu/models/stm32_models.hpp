// The USARTs of STM32 as their registers show them: the older one after RM0090, chapter 30, the newer one after RM0440,
// chapter 37. Judge the register drivers; share nothing with them.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>

#include "mcu/models/dma_model.hpp"
#include "mcu/models/uart_engine.hpp"

namespace tm485::test {

struct Stm32Config {
  std::uint32_t clock_hz = 84'000'000;
  bool clocked = true;      ///< false: registers keep nothing
  bool present = true;      ///< false: the bus reads all ones
  std::size_t fifo = 8;     ///< of the newer one, if it is switched on; 0: the chip has none
  bool stuck = false;       ///< the transmitter never ends
  bool interrupts = false;  ///< somebody takes them
  EngineConfig engine = {};
};

/// What both have in common: words only, and a rate that follows from BRR and OVER8.
class Stm32Base {
 public:
  explicit Stm32Base(const Stm32Config& config) : config_(config), engine_(config.engine) {
    engine_.set_depth(1);
  }

  [[nodiscard]] UartEngine& engine() { return engine_; }
  /// DMA channels at its requests.
  [[nodiscard]] SendChannelModel& send_channel() { return send_channel_; }
  [[nodiscard]] ReceiveChannelModel& receive_channel() { return receive_channel_; }
  void vanish() { config_.present = false; }
  void set_stuck(bool stuck) { config_.stuck = stuck; }

  std::uint8_t read8(std::size_t) noexcept { return wrong_width(), std::uint8_t{0}; }
  std::uint16_t read16(std::size_t) noexcept { return wrong_width(), std::uint16_t{0}; }
  void write8(std::size_t, std::uint8_t) noexcept { wrong_width(); }
  void write16(std::size_t, std::uint16_t) noexcept { wrong_width(); }

 protected:
  void wrong_width() noexcept { engine_.complain("a register was not accessed as a word"); }

  /// USARTDIV has its fraction in 16ths, or with 8 samples in 8ths.
  void take_rate(std::uint32_t brr, bool over8) {
    if (brr == 0) return;
    if (over8 && (brr & 8) != 0) engine_.complain("BRR bit 3 is set with 8 samples a bit");
    const double samples = over8 ? 8.0 : 16.0;
    const double divider =
        static_cast<double>(brr >> 4) + static_cast<double>(over8 ? brr & 7 : brr & 15) / samples;
    if (divider < 1.0) return engine_.complain("an impossible divisor");
    engine_.set_character_time(Time{
        static_cast<std::int64_t>(1e10 * samples * divider / static_cast<double>(config_.clock_hz) + 0.5)});
  }

  /// The requests: a byte is wanted, a byte is there. Reading the data this way clears no error.
  void move(bool send, bool receive, bool& framing) {
    SendChannelModel& from = send_channel_;
    while (send && from.on && from.moved != from.bytes.size() && !engine_.transmit_full())
      engine_.write(from.bytes[from.moved++]);
    ReceiveChannelModel& to = receive_channel_;
    while (receive && to.on && !engine_.receive_empty()) {
      framing = framing || engine_.receive_top().framing_error;
      to.ring[to.next] = engine_.receive_top().byte;
      to.next = (to.next + 1) % to.ring.size();
      engine_.receive_pop();
    }
  }

  Stm32Config config_;
  UartEngine engine_;
  SendChannelModel send_channel_;
  ReceiveChannelModel receive_channel_;
};

/// F1, F2, F4, L1.
class Stm32V1Model : public Stm32Base {
 public:
  explicit Stm32V1Model(const Stm32Config& config = {}) : Stm32Base(config) {
    engine_.on_event = [this] { move_all(); };
  }

  std::uint32_t read32(std::size_t offset) noexcept {
    engine_.spend_access();
    if (!config_.present) return 0xFFFFFFFFu;
    if (!config_.clocked) return 0;
    overrun_ = overrun_ || engine_.take_overruns() != 0;
    switch (offset) {
      case 0x00: {
        std::uint32_t status = 0;
        if (!engine_.receive_empty()) {
          status |= 0x20;
          if (engine_.receive_top().framing_error) status |= 0x02;
        }
        if (overrun_) status |= 0x08;
        if (framing_) status |= 0x02;
        if (idle()) status |= 0x10;
        status |= transmit_status();
        errors_read_ = true;
        overrun_read_ = overrun_;
        complete_read_ = complete_;
        return status;
      }
      case 0x04: {
        // Reading the status and then the data clears the overrun.
        if (overrun_read_) overrun_ = overrun_read_ = false;
        if (std::exchange(errors_read_, false)) framing_ = idle_ = false;
        if (engine_.receive_empty()) return 0;
        const std::uint8_t byte = engine_.receive_top().byte;
        engine_.receive_pop();
        return byte;
      }
      case 0x08:
        return brr_;
      case 0x0C:
        return cr1_;
      default:
        engine_.complain("a read of a register that has no use here");
        return 0;
    }
  }

  void write32(std::size_t offset, std::uint32_t value) noexcept {
    engine_.spend_access();
    if (!config_.present || !config_.clocked) return;
    move_all();
    (void)transmit_status();
    switch (offset) {
      case 0x00:
        // Of the flags that matter here only TC is cleared by writing 0; RXNE would be too.
        if ((value & 0x20) == 0) engine_.complain("RXNE was cleared by a write");
        if ((value & 0x40) == 0) complete_ = complete_read_ = false;
        return;
      case 0x04:
        // Reading the status and then writing the data clears the transmission-complete.
        if (complete_read_) complete_ = complete_read_ = false;
        return engine_.write(static_cast<std::uint8_t>(value));
      case 0x08:
        brr_ = value & 0xFFFF;
        return take_rate(brr_, (cr1_ & 0x8000) != 0);
      case 0x0C:
        cr1_ = value & 0xFFFF;
        if ((cr1_ & (config_.interrupts ? 0x1500 : 0x15F0)) != 0)
          engine_.complain("interrupts, parity or nine bits are on");
        if ((cr1_ & 0x08) == 0) engine_.clear_transmitter();
        take_rate(brr_, (cr1_ & 0x8000) != 0);
        engine_.set_silence(engine_.character_time());
        return engine_.enable((cr1_ & 0x200C) == 0x200C);
      case 0x10:
        if (value != 0) engine_.complain("stop bits are set");
        return;
      case 0x14:
        cr3_ = value;
        if ((value & ~0xC1u) != 0) engine_.complain("flow control or others are set");
        return;
      default:
        engine_.complain("a write to a register that has no use here");
    }
  }

  /// The interrupt line: each flag with its switch; that of RXNE is also that of the overrun.
  [[nodiscard]] bool interrupt() {
    if (!config_.present || !config_.clocked) return false;
    overrun_ = overrun_ || engine_.take_overruns() != 0;
    const std::uint32_t status = transmit_status() | (engine_.receive_empty() && !overrun_ ? 0u : 0x20u);
    const bool error = (cr3_ & 0x41) == 0x41 && (framing_ || overrun_);
    return error || ((status | (idle() ? 0x10u : 0u)) & cr1_ & 0xF0) != 0;
  }

 private:
  /// TC is set by the end of a transmission, and stays until it is cleared. Before the first it is set as well.
  std::uint32_t transmit_status() {
    if (std::exchange(completions_, engine_.completions()) != engine_.completions()) complete_ = true;
    return (engine_.transmit_empty() ? 0x80u : 0u) | (complete_ && !config_.stuck ? 0x40u : 0u);
  }

  /// One character's time without one.
  bool idle() {
    if (std::exchange(silences_, engine_.silences()) != engine_.silences()) idle_ = true;
    return idle_;
  }

  void move_all() { move((cr3_ & 0x80) != 0, (cr3_ & 0x40) != 0, framing_); }

  std::uint32_t brr_ = 0, cr1_ = 0, cr3_ = 0;
  bool framing_ = false;  // of a character that the DMA has taken
  bool idle_ = false;
  bool errors_read_ = false;
  std::uint32_t silences_ = 0;
  std::uint32_t completions_ = 0;
  bool complete_ = true;
  bool complete_read_ = false;
  bool overrun_ = false;
  bool overrun_read_ = false;
};

/// F0, F3, F7, G0, G4, H7, L4. DE is the chip's own: the engine's pin follows the transmitter.
class Stm32V2Model : public Stm32Base {
 public:
  explicit Stm32V2Model(const Stm32Config& config = {}) : Stm32Base(config) {
    engine_.on_event = [this] { move_all(); };
  }

  [[nodiscard]] bool driver_enable() const { return (cr3_ & 0x4000) != 0; }
  [[nodiscard]] bool driver_enable_low() const { return (cr3_ & 0x8000) != 0; }
  /// In sample times.
  [[nodiscard]] unsigned assertion() const { return cr1_ >> 21 & 31; }
  [[nodiscard]] unsigned deassertion() const { return cr1_ >> 16 & 31; }

  std::uint32_t read32(std::size_t offset) noexcept {
    engine_.spend_access();
    if (!config_.present) return 0xFFFFFFFFu;
    if (!config_.clocked) return 0;
    overrun_ = overrun_ || engine_.take_overruns() != 0;
    switch (offset) {
      case 0x00:
        return cr1_;
      case 0x0C:
        return brr_;
      case 0x1C: {
        std::uint32_t status = 0x600000;
        if (!engine_.receive_empty()) {
          status |= 0x20;
          if (engine_.receive_top().framing_error) framing_ = true;
        }
        if (framing_) status |= 0x02;
        if (overrun_) status |= 0x08;
        if (timed_out()) status |= 0x800;
        return status | transmit_status();
      }
      case 0x24: {
        if (engine_.receive_empty()) {
          engine_.complain("the data register was read although nothing was there");
          return 0;
        }
        const std::uint8_t byte = engine_.receive_top().byte;
        engine_.receive_pop();
        return byte;
      }
      default:
        engine_.complain("a read of a register that has no use here");
        return 0;
    }
  }

  void write32(std::size_t offset, std::uint32_t value) noexcept {
    engine_.spend_access();
    if (!config_.present || !config_.clocked) return;
    move_all();
    (void)transmit_status();
    switch (offset) {
      case 0x00:
        return write_control(value);
      case 0x04:
        if ((value & ~0x800000u) != 0) engine_.complain("stop bits or others are set");
        cr2_ = value;
        return set_timeout();
      case 0x14:
        rtor_ = value;
        return set_timeout();
      case 0x08:
        if ((cr1_ & 1) != 0) engine_.complain("DEM was written while the USART is on");
        cr3_ = value;
        return;
      case 0x0C:
        if ((cr1_ & 1) != 0) engine_.complain("BRR was written while the USART is on");
        brr_ = value & 0xFFFF;
        return;
      case 0x18:
        if ((value & 8) != 0) engine_.clear_receiver();
        if ((value & 16) != 0) engine_.clear_transmitter();
        return;
      case 0x20:
        if ((value & 2) != 0) framing_ = false;
        if ((value & 2) != 0 && !engine_.receive_empty()) engine_.receive_top().framing_error = false;
        if ((value & 8) != 0) overrun_ = false;
        if ((value & 0x40) != 0) complete_ = false;
        if ((value & 0x800) != 0) timed_out_ = false;
        return;
      case 0x28:
        return engine_.write(static_cast<std::uint8_t>(value));
      default:
        engine_.complain("a write to a register that has no use here");
    }
  }

  /// The interrupt line: each flag with its switch; that of RXNE is also that of the overrun.
  [[nodiscard]] bool interrupt() {
    if (!config_.present || !config_.clocked) return false;
    overrun_ = overrun_ || engine_.take_overruns() != 0;
    const std::uint32_t status = transmit_status() | (engine_.receive_empty() && !overrun_ ? 0u : 0x20u);
    const bool error = (cr3_ & 0x41) == 0x41 && (framing_ || overrun_);
    return error || (status & cr1_ & 0xE0) != 0 || (timed_out() && (cr1_ & 0x04000000u) != 0);
  }

 private:
  /// TC is set by the end of a transmission, and stays until software clears it.
  std::uint32_t transmit_status() {
    if (std::exchange(completions_, engine_.completions()) != engine_.completions()) complete_ = true;
    return (engine_.transmit_full() ? 0u : 0x80u) | (complete_ && !config_.stuck ? 0x40u : 0u);
  }

  bool timed_out() {
    if (std::exchange(silences_, engine_.silences()) != engine_.silences()) timed_out_ = true;
    return timed_out_;
  }

  /// In bits, ten of which are a character.
  void set_timeout() {
    const bool on = (cr2_ & 0x800000) != 0;
    engine_.set_silence(on ? engine_.character_time() * static_cast<std::int64_t>(rtor_ & 0xFFFFFF) / 10
                           : Time{0});
  }

  void move_all() { move((cr3_ & 0x80) != 0, (cr3_ & 0x40) != 0, framing_); }

  void write_control(std::uint32_t value) {
    if (config_.fifo == 0) value &= ~0x20000000u;
    if ((cr1_ & 1) != 0 && (value & 1) != 0 && ((cr1_ ^ value) & 0x23FF8000u) != 0)
      engine_.complain("DE times, FIFO or samples were changed while the USART is on");
    cr1_ = value;
    if ((value & (config_.interrupts ? 0x10001510u : 0x140015F0u)) != 0)
      engine_.complain("interrupts, parity or another length are on");
    take_rate(brr_, (value & 0x8000) != 0);
    engine_.set_depth((value & 0x20000000u) != 0 ? config_.fifo : 1);
    const std::int64_t samples = (value & 0x8000) != 0 ? 80 : 160;
    engine_.set_automatic_driver(driver_enable(), engine_.character_time() * assertion() / samples,
                                 engine_.character_time() * deassertion() / samples);
    set_timeout();
    engine_.enable((value & 0x0D) == 0x0D);
  }

  std::uint32_t cr1_ = 0, cr2_ = 0, cr3_ = 0, brr_ = 0, rtor_ = 0;
  bool timed_out_ = false;
  std::uint32_t silences_ = 0;
  std::uint32_t completions_ = 0;
  bool framing_ = false;
  bool overrun_ = false;
  bool complete_ = true;
};

}  // namespace tm485::test
