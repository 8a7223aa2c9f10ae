// A port for tests: an encoder that says what a function tells it to, on a line in virtual time.
#pragma once

#include <algorithm>
#include <deque>
#include <expected>
#include <functional>
#include <iterator>
#include <span>
#include <vector>

#include "support/frames.hpp"
#include "tm485/bus/port.hpp"

namespace tm485::test {

class ScriptedPort {
 public:
  static constexpr Time kCharacter{4'000};

  /// What follows a request. Empty bytes: silence.
  struct Answer {
    Bytes bytes;
    Time t2{3'000};
    Errc fault = Errc::ok;  ///< reported together with the first byte
    Time late{0};  ///< handed out this much later than `delivery` says, and what follows not before it
  };
  /// A request on the line: its true first start bit, and when the bus asked for it.
  struct Sent {
    Time start;
    Bytes bytes;
    Time asked;
  };

  ScriptedPort() { capability_.wire_timestamps = true; }

  // What the test sets.
  PortCapability capability_;
  std::function<Answer(const Bytes&, Time)> answer = [](const Bytes&, Time) { return Answer{}; };
  /// How much later than asked a request starts. The bus is told with wire timestamps only.
  std::function<Time()> lateness = [] { return Time{0}; };
  Time behind{0};        ///< the caller's clock: what it passes as `now` was read so long ago
  Time delivery{0};      ///< last stop bit of a byte until it is handed out
  bool echo = false;     ///< the own request comes back
  bool refuses = false;  ///< try_send fails
  bool gone = false;     ///< the device has vanished
  Transmission::State stuck_as =
      Transmission::State::sent;  ///< what transmission() says of a request that left

  // What the test looks at.
  std::vector<Sent> sent;
  std::size_t received_bytes = 0;

  /// Turns it into a port as a kernel gives it: no wire timestamps, bytes handed out up to `allowance` late.
  void be_slow(Time allowance) {
    capability_.wire_timestamps = false;
    capability_.latency_allowance = allowance;
  }

  /// Puts bytes on the line by a third party. Bytes are handed out in the order of the line: one that is late
  /// keeps back those behind it.
  void inject(Time start, const Bytes& bytes, Errc fault = Errc::ok, Time late = Time{0}) {
    for (const std::uint8_t byte : bytes) {
      auto place = line_.end();
      while (place != line_.begin() && std::prev(place)->start > start) --place;
      place = line_.insert(place, {byte, start, start + kCharacter + delivery + late, fault});
      if (place != line_.begin()) place->ready = std::max(place->ready, std::prev(place)->ready);
      for (auto next = std::next(place); next != line_.end() && next->ready < place->ready; ++next)
        next->ready = place->ready;
      start += kCharacter;
      fault = Errc::ok;
    }
  }

  /// When the next byte can be taken that cannot be taken at `now` yet, or kNever.
  [[nodiscard]] Time next_event(Time now) const {
    const auto next =
        std::upper_bound(line_.begin(), line_.end(), now, [](Time t, const Char& c) { return t < c.ready; });
    return next == line_.end() ? kNever : next->ready;
  }

  // The port.
  [[nodiscard]] const PortCapability& capability() const noexcept { return capability_; }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    if (gone) return std::unexpected(Errc::port_gone);
    if (refuses) return std::unexpected(Errc::send_failed);
    const Time start = now + behind + lateness();
    const Bytes bytes(request.begin(), request.end());
    sent.push_back({start, bytes, now});
    left_at_ = start + kCharacter * static_cast<std::int64_t>(bytes.size());
    if (echo) inject(start, bytes);
    const Answer reply = answer(bytes, start);
    inject(left_at_ + reply.t2, reply.bytes, reply.fault, reply.late);
    return capability_.wire_timestamps ? start : now;
  }
  [[nodiscard]] Transmission transmission(Time now) const noexcept {
    if (now < left_at_) return {.state = Transmission::State::sending};
    return {.state = stuck_as, .fault = stuck_as == Transmission::State::failed ? Errc::port_gone : Errc::ok};
  }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    if (gone) return {.fault = Errc::port_gone};
    Reception reception;
    while (reception.count < buffer.size() && !line_.empty() && line_.front().ready <= now + behind) {
      const Char& next = line_.front();
      if (reception.count == 0 && capability_.wire_timestamps) reception.first_start = next.start;
      if (next.fault != Errc::ok) reception.fault = next.fault;
      buffer[reception.count++] = next.byte;
      line_.pop_front();
    }
    received_bytes += reception.count;
    return reception;
  }

 private:
  struct Char {
    std::uint8_t byte;
    Time start;
    Time ready;
    Errc fault;
  };
  std::deque<Char> line_;
  Time left_at_ = -kNever;  ///< last stop bit of the last request
};

static_assert(Port<ScriptedPort>);

/// A shaft and an encoder as frames: what a healthy one answers to each cyclic ID.
struct PlainEncoder {
  std::uint32_t abs = 1'000;
  std::uint32_t abm = 1;
  std::uint8_t enid = 0x11;
  std::uint8_t sf = 0;
  std::uint8_t almc = 0;

  [[nodiscard]] Bytes reply(const Bytes& request) const {
    switch (request.at(0)) {
      case 0x02:
        return id0_reply(abs, sf);
      case 0x8A:
        return id1_reply(abm, sf);
      case 0x92:
        return id2_reply(enid, sf);
      case 0x1A:
        return id3_reply(abs, abm, enid, sf, almc);
      case 0x32:
        return eeprom_reply(0x32, request.at(1), request.at(2));
      case 0xEA:
        return eeprom_reply(0xEA, request.at(1), 0x5A);
      default:
        return short_reply(request.at(0), abs, sf);
    }
  }
};

/// Polls a bus in virtual time until `end` or until `done` says so. Between two polls time moves on, to what the bus
/// asked for or to the next byte. A bus that asks to be called at once, again and again, does not make progress:
/// that ends the run, and `stuck` says so.
struct Driver {
  Time now{0};
  std::size_t polls = 0;
  bool stuck = false;

  template <class Bus, class Done>
  bool run(Bus& bus, ScriptedPort& port, Time end, Done done) {
    int in_place = 0;
    while (!done()) {
      const Time asked = bus.poll(now);
      const Time due = std::min(asked, port.next_event(now));
      ++polls;
      if (done()) return true;
      if (due > end) {
        now = end;
        return false;
      }
      in_place = due > now ? 0 : in_place + 1;
      if (in_place > 100) {
        stuck = true;
        return false;
      }
      now = std::max(now, due);
    }
    return true;
  }
  template <class Bus>
  void run(Bus& bus, ScriptedPort& port, Time end) {
    run(bus, port, end, [] { return false; });
  }
};

}  // namespace tm485::test
