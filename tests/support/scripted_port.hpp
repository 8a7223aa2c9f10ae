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
  };
  struct Sent {
    Time start;
    Bytes bytes;
  };

  ScriptedPort() { capability_.wire_timestamps = true; }

  // What the test sets.
  PortCapability capability_;
  std::function<Answer(const Bytes&, Time)> answer = [](const Bytes&, Time) { return Answer{}; };
  std::function<Time()> lateness = [] { return Time{0}; };  ///< how much later than asked a request starts
  Time delivery{0};      ///< last stop bit of a byte until it is handed out
  bool echo = false;     ///< the own request comes back
  bool refuses = false;  ///< try_send fails
  bool gone = false;     ///< the device has vanished
  Transmission::State stuck_as = Transmission::State::sent;  ///< what transmission() says

  // What the test looks at.
  std::vector<Sent> sent;
  std::size_t received_bytes = 0;

  /// Puts bytes on the line by a third party.
  void inject(Time start, const Bytes& bytes, Errc fault = Errc::ok) {
    for (const std::uint8_t byte : bytes) {
      const Char next{byte, start, start + kCharacter + delivery, fault};
      auto place = line_.end();
      while (place != line_.begin() && std::prev(place)->ready > next.ready) --place;
      line_.insert(place, next);
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
    const Time start = now + lateness();
    const Bytes bytes(request.begin(), request.end());
    sent.push_back({start, bytes});
    if (echo) inject(start, bytes);
    const Answer reply = answer(bytes, start);
    inject(start + kCharacter * static_cast<std::int64_t>(bytes.size()) + reply.t2, reply.bytes, reply.fault);
    return start;
  }
  [[nodiscard]] Transmission transmission(Time) const noexcept {
    return {.state = stuck_as, .fault = stuck_as == Transmission::State::failed ? Errc::port_gone : Errc::ok};
  }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    if (gone) return {.fault = Errc::port_gone};
    Reception reception;
    while (reception.count < buffer.size() && !line_.empty() && line_.front().ready <= now) {
      const Char& next = line_.front();
      if (reception.count == 0) reception.first_start = next.start;
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
