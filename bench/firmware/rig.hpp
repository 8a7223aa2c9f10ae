// Rig: a bus on a MemoryPort with an encoder at its end, in virtual time. It can be brought to the instant before
// something that is to be counted.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "memory_port.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/protocol/control_field.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/protocol/request.hpp"

namespace tm485::cost {

inline constexpr CompiledProfile kProfile = *CompiledProfile::compile(Profile{});

using Id3Frame = std::array<std::uint8_t, kMaxReply>;

/// A good ID3 frame of an encoder of kProfile, at `shaft` counts of turn 0x1234.
[[nodiscard]] inline Id3Frame id3_frame(std::uint32_t shaft) noexcept {
  const auto part = [shaft](unsigned shift) { return static_cast<std::uint8_t>(shaft >> shift); };
  Id3Frame frame{0x1A, 0x20, part(0), part(8), part(16), 0x11, 0x34, 0x12};
  std::uint8_t sum = 0;
  for (const std::uint8_t byte : frame) sum ^= byte;
  frame.back() = sum;
  return frame;
}

class Rig {
 public:
  Rig(bool wire_timestamps, Time period) noexcept
      : timed_(wire_timestamps), port_(wire_timestamps), bus_(port_, kProfile, every(period)) {}

  /// To the slot behind the eighth good cycle. False if that does not come.
  [[nodiscard]] bool start() noexcept {
    if (!bus_.start(now_)) return false;
    for (unsigned i = 0; i < 1'000 && bus_.statistics().good < 8; ++i) run_to_request();
    to_slot();
    return bus_.statistics().good >= 8;
  }
  /// To the instant of the next cyclic request, everything before it being done.
  void to_slot() noexcept {
    now_ = std::max(now_, replied_);
    Time due = bus_.poll(now_);
    while (due <= now_ || bus_.reply_expected() != kNever) {
      if (bus_.reply_expected() != kNever) answer();
      now_ = std::max(now_, due);
      due = bus_.poll(now_);
    }
    now_ = due;
    replied_ = now_ + kReplied;
    port_.clear();
    port_.load(id3_frame(next_shaft()), kDelay);
  }
  /// What is counted: the request goes out ...
  void request() noexcept { bus_.poll(now_); }
  /// ... and 56 us later its reply is there and is judged. Without wire timestamps that takes a second call.
  void reply() noexcept {
    bus_.poll(replied_);
    if (!timed_) bus_.poll(replied_);
  }

  /// Until the next request was sent, whichever it is, and answered.
  void run_to_request() noexcept {
    port_.clear();
    while (bus_.reply_expected() == kNever) advance();
    answer();
    const std::uint32_t records = bus_.record_count();
    while (bus_.record_count() == records) advance();
  }

  [[nodiscard]] Bus<MemoryPort>& bus() noexcept { return bus_; }
  [[nodiscard]] Time now() const noexcept { return now_; }

 private:
  static BusConfig every(Time period) noexcept {
    BusConfig config;
    config.cycle = Cycle{.period = period};
    return config;
  }

  static constexpr Time kDelay{7'000};     // a character and 3 us
  static constexpr Time kReplied{56'000};  // one and eleven characters, 3 us, and something

  void advance() noexcept {
    const Time due = bus_.poll(now_);
    now_ = bus_.reply_expected() == kNever ? std::max(now_, due) : std::min(due, now_ + kReplied);
  }
  std::uint32_t next_shaft() noexcept {
    shaft_ = (shaft_ + 3) & 0xFFFFU;
    return shaft_;
  }
  /// Each byte of the EEPROM holds its address; the page register says page 0.
  void answer() noexcept {
    const auto& request = port_.request();
    if (request[0] == control_field(DataId::everything)) return port_.load(id3_frame(next_shaft()), kDelay);
    std::array<std::uint8_t, 4> reply{0x92, 0x20, 0x11};
    Time delay = kDelay;
    if (request[0] == control_field(DataId::eeprom_read)) {
      reply = {request[0], request[1], request[1] == kPageRegister ? std::uint8_t{0} : request[1]};
      delay += 2 * kProfile.character_time();
    }
    reply[3] = static_cast<std::uint8_t>(reply[0] ^ reply[1] ^ reply[2]);
    port_.load(reply, delay);
  }

  bool timed_;
  Time now_{0};
  Time replied_{0};  ///< when the reply to the next request is there
  std::uint32_t shaft_ = 1'000;
  MemoryPort port_;
  Bus<MemoryPort> bus_;
};

}  // namespace tm485::cost
