// What is behind the registers of a UART, in character time: FIFOs, shift registers, the line and the pin that
// switches the RS-485 driver. A judge of the register drivers: it shares no code and no constant with them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "tm485/time.hpp"

namespace tm485::test {

/// A character on the line.
struct LineCharacter {
  std::uint8_t byte = 0;
  Time start{0};
  Time end{0};
  bool stop_bit = true;
};

/// A character in the receive FIFO.
struct WaitingCharacter {
  std::uint8_t byte = 0;
  bool framing_error = false;
  bool is_break = false;
};

struct EngineConfig {
  Time start_delay{0};         ///< from the write into an idle transmitter to the start bit
  Time access{0};              ///< what each register access costs
  bool judge_driver = false;   ///< the driver pin is wired and must be right
  Time driver_lead{0};         ///< the driver is to be on this long before a start bit
  Time latest_release{2'800};  ///< and off this long after the last stop bit
  bool echo = false;           ///< the receiver hears the own transmitter
};

/// Virtual time: what happens by itself happens in advance_to().
class UartEngine {
 public:
  explicit UartEngine(const EngineConfig& config) : config_(config) {}

  // Time.
  [[nodiscard]] Time now() const { return now_; }
  void advance_to(Time now) {
    while (work_off_one(now)) {
      if (on_event) on_event();
    }
    if (now > now_) now_ = now;
  }
  /// Each register access calls it: an interrupt may come before it takes effect.
  void spend_access() {
    advance_to(now_ + config_.access);
    if (on_access) on_access();
  }
  std::function<void()> on_access;
  /// The next instant at which something happens by itself; kNever if nothing will.
  [[nodiscard]] Time next_event() const {
    return std::min({next_start(), shift_ ? shift_->end : kNever,
                     arriving_.empty() ? kNever : arriving_.front().end, silence()});
  }
  /// Called after everything that happens by itself: what the hardware does at once.
  std::function<void()> on_event;
  /// The receiver tells when the line has been silent for `span` behind a character; 0: it does not.
  void set_silence(Time span) { silence_span_ = span; }
  /// How often it was.
  [[nodiscard]] std::uint32_t silences() const { return silences_; }
  /// How often the last stop bit of what was written has left.
  [[nodiscard]] std::uint32_t completions() const { return completions_; }
  /// How often a character has moved from the FIFO into the shift register.
  [[nodiscard]] std::uint32_t shifts() const { return shifts_; }
  /// How many characters have come into the receive FIFO.
  [[nodiscard]] std::uint32_t received() const { return received_; }

  // Line.
  /// Called when the last bit of a character of the own transmitter has left.
  std::function<void(const LineCharacter&)> on_sent;
  /// A character that will arrive; their instants rise.
  void arrive(const LineCharacter& character) { arriving_.push_back(character); }
  [[nodiscard]] bool transmitting() const { return shift_.has_value() || !transmit_.empty(); }
  [[nodiscard]] bool judges_driver() const { return config_.judge_driver; }
  [[nodiscard]] bool driver() const {
    return automatic_ ? transmitting() || (sent_any_ && now_ < last_end_ + tail_) : driver_;
  }
  /// The block switches the driver itself: `lead` before the start bit, `tail` behind the last stop bit.
  void set_automatic_driver(bool on, Time lead, Time tail) {
    automatic_ = on;
    lead_ = on ? lead : Time{0};
    tail_ = on ? tail : Time{0};
  }
  void set_driver(bool on) {
    if (!config_.judge_driver || on == driver_) return;
    if (!on && transmitting()) complain("the driver was released before the last stop bit had left");
    if (!on && sent_any_ && now_ - last_end_ > config_.latest_release)
      complain("the driver was released " + ns(now_ - last_end_) + " after the last stop bit");
    driver_ = on;
    driver_since_ = now_;
  }

  // Registers. `depth` is what the FIFOs have at present.
  void set_character_time(Time character) { character_ = character; }
  [[nodiscard]] Time character_time() const { return character_; }
  void set_depth(std::size_t depth) { depth_ = depth; }
  void enable(bool on) { enabled_ = on; }
  [[nodiscard]] bool transmit_full() const { return transmit_.size() >= depth_; }
  [[nodiscard]] bool transmit_empty() const { return transmit_.empty(); }
  [[nodiscard]] bool shifting() const { return shift_.has_value(); }
  void write(std::uint8_t byte) {
    if (!enabled_ || character_ == Time{0})
      return complain("a byte was written to a UART that is not set up");
    if (transmit_full()) return complain("a byte was written to a full FIFO and is lost");
    if (!shift_ && transmit_.empty()) next_start_ = now_ + config_.start_delay + lead_;
    transmit_.push_back(byte);
    (void)work_off_one(now_);
  }
  [[nodiscard]] bool receive_empty() const { return receive_.empty(); }
  [[nodiscard]] bool receive_full() const { return receive_.size() >= depth_; }
  [[nodiscard]] const WaitingCharacter& receive_top() const { return receive_.front(); }
  [[nodiscard]] WaitingCharacter& receive_top() { return receive_.front(); }
  void receive_pop() { receive_.pop_front(); }
  void clear_receiver() { receive_.clear(); }
  void clear_transmitter() { transmit_.clear(); }
  /// Characters that found no room since this was last called.
  [[nodiscard]] std::size_t take_overruns() { return std::exchange(overruns_, 0); }

  void complain(const std::string& what) { complaints_.push_back("at " + ns(now_) + ": " + what); }
  [[nodiscard]] const std::vector<std::string>& complaints() const { return complaints_; }

 private:
  static std::string ns(Time time) { return std::to_string(time.count()) + " ns"; }

  /// The earliest thing that happens by itself until `until`; false if there is none.
  bool work_off_one(Time until) {
    const Time start = next_start();
    const Time end = shift_ ? shift_->end : kNever;
    const Time first = next_event();
    if (first == kNever || first > until) return false;
    if (first > now_) now_ = first;
    if (first == end) {
      finish_character();
    } else if (first == start) {
      shift_ = LineCharacter{transmit_.front(), start, start + character_, true};
      transmit_.pop_front();
      ++shifts_;
    } else if (first == silence()) {
      silent_from_ = kNever;
      ++silences_;
    } else {
      receive(arriving_.front(), false);
      arriving_.pop_front();
    }
    return true;
  }

  /// The end of the silence, unless a character begins before.
  [[nodiscard]] Time silence() const {
    if (silent_from_ == kNever || silence_span_ == Time{0}) return kNever;
    const Time end = silent_from_ + silence_span_;
    return !arriving_.empty() && arriving_.front().start < end ? kNever : end;
  }

  [[nodiscard]] Time next_start() const { return !shift_ && !transmit_.empty() ? next_start_ : kNever; }

  void finish_character() {
    const LineCharacter done = *shift_;
    shift_.reset();
    if (transmit_.empty()) ++completions_;
    next_start_ = done.end;
    last_end_ = done.end;
    sent_any_ = true;
    if (config_.judge_driver && (!driver_ || driver_since_ > done.start - config_.driver_lead))
      complain("a character left from " + ns(done.start) + " without the driver, or without its lead");
    if (config_.echo) receive(done, true);
    if (on_sent) on_sent(done);
  }

  void receive(const LineCharacter& character, bool own) {
    if (!enabled_) return;
    silent_from_ = now_;
    WaitingCharacter waiting{character.byte, !character.stop_bit, !character.stop_bit && character.byte == 0};
    if (!own && config_.judge_driver &&
        (driver_ ? driver_since_ < character.end : driver_since_ > character.start)) {
      complain("the driver was on while the encoder sent");
      waiting = {static_cast<std::uint8_t>(~character.byte), true, false};
    }
    if (receive_full()) {
      ++overruns_;
      return;
    }
    receive_.push_back(waiting);
    ++received_;
  }

  EngineConfig config_;
  Time now_{0};
  Time character_{0};
  std::size_t depth_ = 1;
  bool enabled_ = false;
  bool driver_ = false;
  Time driver_since_{-kNever};
  bool automatic_ = false;
  Time lead_{0};
  Time tail_{0};
  std::deque<std::uint8_t> transmit_;
  std::optional<LineCharacter> shift_;
  Time next_start_{0};
  Time last_end_{0};
  bool sent_any_ = false;
  std::deque<LineCharacter> arriving_;
  std::deque<WaitingCharacter> receive_;
  Time silence_span_{0};
  Time silent_from_ = kNever;
  std::uint32_t silences_ = 0;
  std::size_t overruns_ = 0;
  std::uint32_t completions_ = 0;
  std::uint32_t shifts_ = 0;
  std::uint32_t received_ = 0;
  std::vector<std::string> complaints_;
};

}  // namespace tm485::test
