#include "conformance/port_conformance.hpp"

#include <algorithm>
#include <array>
#include <optional>
#include <stdexcept>
#include <string_view>

namespace tm485::test {
namespace {

using Bytes = std::vector<std::uint8_t>;
using State = Transmission::State;

constexpr Time kReplyDelay{3'000};
constexpr std::array<std::uint8_t, 4> kRequest{0x32, 0x05, 0xA5, 0x92};
const Bytes kReply{0x1A, 0x00, 0x39, 0x30, 0x01, 0x11, 0x07, 0x00, 0xFF, 0x80, 0x5E};

std::string text(std::span<const std::uint8_t> bytes) {
  static constexpr char kDigits[] = "0123456789ABCDEF";
  std::string line;
  for (const std::uint8_t byte : bytes) {
    if (!line.empty()) line += ' ';
    line += kDigits[byte >> 4U];
    line += kDigits[byte & 15U];
  }
  return line.empty() ? "nothing" : line;
}

Bytes bytes_of(const std::vector<HeardByte>& heard) {
  Bytes bytes;
  for (const HeardByte& one : heard) bytes.push_back(one.byte);
  return bytes;
}

Bytes first_of(std::span<const std::uint8_t> bytes, std::size_t count) {
  return {bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(count)};
}

void append(Bytes& to, std::span<const std::uint8_t> from) { to.insert(to.end(), from.begin(), from.end()); }

/// A check at work: the rig, and what was found.
class Play {
 public:
  explicit Play(Rig& rig) : rig_(rig) {}

  [[nodiscard]] Rig& rig() { return rig_; }
  void violated(std::string what) { violations_.push_back(std::move(what)); }
  void expect(bool holds, std::string what) {
    if (!holds) violated(std::move(what));
  }
  void expect_same(std::string_view what, std::span<const std::uint8_t> wanted,
                   std::span<const std::uint8_t> got) {
    if (!std::ranges::equal(wanted, got))
      violated(std::string(what) + ": wanted " + text(wanted) + ", got " + text(got));
  }
  [[nodiscard]] Violations done() { return std::move(violations_); }

  /// Calls `step` a grain apart until it is true; false if patience ends before.
  template <class Step>
  bool until(const Step& step) {
    const Time end = rig_.now() + rig_.patience();
    for (;;) {
      if (step()) return true;
      if (rig_.now() > end) return false;
      rig_.pass(rig_.grain());
    }
  }

  /// Sends, and polls until the port says that it has been sent.
  bool send(std::span<const std::uint8_t> request) {
    const auto start = rig_.try_send(request);
    if (!start) {
      violated("a request of " + std::to_string(request.size()) +
               " bytes was refused: " + std::string(tm485::name(start.error())));
      return false;
    }
    const bool sent = until([&] { return rig_.transmission().state != State::sending; });
    if (sent && rig_.transmission().state == State::sent) return true;
    violated(sent ? "a request that was taken has failed" : "a request is never reported as sent");
    return false;
  }

  /// Adds what the far end has heard until it has `count` bytes.
  std::vector<HeardByte> hear(std::size_t count) {
    std::vector<HeardByte> all;
    (void)until([&] {
      const std::vector<HeardByte> more = rig_.heard();
      all.insert(all.end(), more.begin(), more.end());
      return all.size() >= count;
    });
    return all;
  }

  struct Received {
    Bytes bytes;
    std::vector<Errc> faults;
  };

  /// Receives until there are `count` bytes or a fault `until_fault`, and then for a while whatever else comes.
  Received receive(std::size_t count, std::size_t room, Errc until_fault = Errc::ok) {
    Received all;
    Bytes buffer(room);
    bool fault_seen = false;
    const auto take = [&] {
      const Reception reception = rig_.try_receive(buffer);
      if (reception.count > room) {
        violated("more bytes were handed out than the buffer has");
        return true;
      }
      append(all.bytes, std::span(buffer).first(reception.count));
      if (reception.fault != Errc::ok) all.faults.push_back(reception.fault);
      fault_seen = fault_seen || (until_fault != Errc::ok && reception.fault == until_fault);
      return false;
    };
    (void)until([&] { return take() || all.bytes.size() >= count || fault_seen; });
    for (int again = 0; again < kAfterwards; ++again) {
      if (take()) break;
      rig_.pass(rig_.grain());
    }
    return all;
  }

 private:
  static constexpr int kAfterwards = 50;

  Rig& rig_;
  Violations violations_;
};

Violations capability_is_a_constant(Rig& rig) {
  Play play(rig);
  const auto same = [](const PortCapability& a, const PortCapability& b) {
    return a.shortest_exchange == b.shortest_exchange && a.jitter_margin == b.jitter_margin &&
           a.latency_allowance == b.latency_allowance && a.wire_timestamps == b.wire_timestamps &&
           a.release_bound == b.release_bound && a.timing == b.timing;
  };
  const PortCapability before = rig.capability();
  for (const Time time :
       {before.shortest_exchange, before.jitter_margin, before.latency_allowance, before.release_bound})
    play.expect(time >= Time{0}, "the capability has a negative time");
  (void)play.send(std::span(kRequest).first(1));
  play.expect(same(before, rig.capability()), "the capability changes");
  return play.done();
}

Violations a_fresh_port_is_idle(Rig& rig) {
  Play play(rig);
  play.expect(rig.transmission().state == State::idle, "a fresh port is not idle");
  std::array<std::uint8_t, 16> buffer{};
  for (int i = 0; i < 200; ++i) {
    const Reception reception = rig.try_receive(buffer);
    play.expect(reception.count == 0 && reception.fault == Errc::ok, "a quiet line is not silent");
    if (reception.count != 0 || reception.fault != Errc::ok) break;
    rig.pass(rig.grain());
  }
  play.expect(rig.heard().empty(), "a fresh port has sent something");
  return play.done();
}

Violations sends_the_request_and_nothing_else(Rig& rig) {
  Play play(rig);
  for (std::size_t count = 1; count <= kRequest.size(); ++count) {
    if (!play.send(std::span(kRequest).first(count))) break;
    play.expect_same("request", first_of(kRequest, count), bytes_of(play.hear(count)));
  }
  // Not on its own account, whatever it is asked.
  std::array<std::uint8_t, 16> buffer{};
  for (int i = 0; i < 400; ++i) {
    (void)rig.transmission();
    (void)rig.try_receive(buffer);
    rig.pass(rig.grain());
  }
  play.expect_same("unasked", {}, bytes_of(rig.heard()));
  return play.done();
}

Violations sent_means_off_the_line(Rig& rig) {
  Play play(rig);
  for (std::size_t count = 1; count <= kRequest.size(); ++count) {
    const auto start = rig.try_send(std::span(kRequest).first(count));
    if (!start) {
      play.violated("a request was refused");
      break;
    }
    play.expect(rig.transmission().state == State::sending || !rig.wire_time(),
                "a request is sent before it began");
    const bool sent = play.until([&] { return rig.transmission().state == State::sent; });
    const Time seen = rig.now();
    play.expect(sent, "a request is never reported as sent");
    if (!rig.wire_time()) {
      play.expect_same("request", first_of(kRequest, count), bytes_of(play.hear(count)));
      continue;
    }
    play.expect(rig.line_idle(), "sent, but the driver is on or a stop bit has not left");
    const std::vector<HeardByte> heard = rig.heard();
    play.expect_same("at the instant of sent", first_of(kRequest, count), bytes_of(heard));
    if (heard.empty()) continue;
    play.expect(heard.back().end <= seen, "sent before the last stop bit has left");
    const Time late = seen - heard.back().end;
    play.expect(late <= rig.capability().release_bound + rig.grain() * 4,
                "sent is reported " + std::to_string(late.count()) + " ns after the last stop bit");
  }
  for (int i = 0; i < 20; ++i) {
    rig.pass(rig.grain());
    play.expect(rig.transmission().state == State::sent, "sent does not stay sent");
  }
  return play.done();
}

Violations a_request_is_one_gapless_burst(Rig& rig) {
  Play play(rig);
  for (int again = 0; again < 20; ++again) {
    if (!play.send(kRequest)) break;
    const std::vector<HeardByte> heard = play.hear(kRequest.size());
    play.expect_same("request", kRequest, bytes_of(heard));
    for (std::size_t i = 1; rig.wire_time() && i < heard.size(); ++i)
      play.expect(heard[i].start == heard[i - 1].end, "a gap within a request");
    rig.pass(Time{1'700});  // another phase against the character clock
  }
  return play.done();
}

Violations the_start_is_that_of_the_start_bit(Rig& rig) {
  Play play(rig);
  for (int again = 0; again < 10; ++again) {
    const Time before = rig.now();
    const auto start = rig.try_send(std::span(kRequest).first(2));
    if (!start) return play.violated("a request was refused"), play.done();
    play.expect(*start >= before, "the start is before the call");
    play.expect(play.until([&] { return rig.transmission().state == State::sent; }), "never sent");
    const std::vector<HeardByte> heard = play.hear(2);
    if (!rig.wire_time() || heard.empty()) continue;
    play.expect(*start <= heard.front().start, "the start is after the start bit");
    if (rig.capability().wire_timestamps)
      play.expect(*start == heard.front().start, "the start is not that of the start bit, though exact");
  }
  return play.done();
}

Violations an_empty_request_is_refused(Rig& rig) {
  Play play(rig);
  const auto start = rig.try_send({});
  play.expect(!start && start.error() == Errc::send_failed,
              "an empty request is not refused with send_failed");
  for (int i = 0; i < 100; ++i) {
    (void)rig.transmission();
    rig.pass(rig.grain());
  }
  play.expect_same("after an empty request", {}, bytes_of(rig.heard()));
  if (play.send(std::span(kRequest).first(1)))
    play.expect_same("after an empty request", first_of(kRequest, 1), bytes_of(play.hear(1)));
  return play.done();
}

Violations requests_follow_one_another(Rig& rig) {
  Play play(rig);
  for (std::uint8_t i = 0; i < 100; ++i) {
    const std::array<std::uint8_t, 2> request{i, static_cast<std::uint8_t>(~i)};
    if (!play.send(request)) break;
    const Bytes heard = bytes_of(play.hear(2));
    play.expect_same("request " + std::to_string(i), request, heard);
    if (!std::ranges::equal(request, heard)) break;
  }
  return play.done();
}

Violations a_request_under_way_is_not_disturbed(Rig& rig) {
  Play play(rig);
  const auto first = rig.try_send(kRequest);
  play.expect(first.has_value(), "a request was refused");
  rig.pass(rig.grain());
  const std::array<std::uint8_t, 1> other{0x92};
  const auto second = rig.try_send(other);
  play.expect(second || second.error() == Errc::send_failed,
              "a request too early is not refused with send_failed");
  play.expect(play.until([&] { return rig.transmission().state == State::sent; }), "never sent");
  Bytes wanted(kRequest.begin(), kRequest.end());
  if (second) append(wanted, other);
  play.expect_same("both requests", wanted, bytes_of(play.hear(wanted.size())));
  return play.done();
}

Violations bytes_come_once_and_in_order(Rig& rig) {
  Play play(rig);
  for (const std::size_t room :
       {std::size_t{16}, std::size_t{1}, std::size_t{2}, std::size_t{5}, std::size_t{12}}) {
    rig.answer(kReply, kReplyDelay);
    const Play::Received received = play.receive(kReply.size(), room);
    play.expect_same("reply, room for " + std::to_string(room), kReply, received.bytes);
    play.expect(received.faults.empty(), "a fault without a cause");
  }
  return play.done();
}

Violations a_late_reader_loses_nothing(Rig& rig) {
  Play play(rig);
  rig.answer(kReply, kReplyDelay);
  rig.pass(Time{1'000'000});
  const Play::Received received = play.receive(kReply.size(), 16);
  play.expect_same("reply", kReply, received.bytes);
  play.expect(received.faults.empty(), "a fault without a cause");
  return play.done();
}

Violations an_empty_buffer_takes_nothing(Rig& rig) {
  Play play(rig);
  rig.answer(kReply, kReplyDelay);
  for (int i = 0; i < 100; ++i) {
    const Reception reception = rig.try_receive({});
    play.expect(reception.count == 0 && reception.fault == Errc::ok, "an empty buffer got something");
    rig.pass(rig.grain());
  }
  play.expect_same("reply", kReply, play.receive(kReply.size(), 16).bytes);
  return play.done();
}

Violations every_byte_value_passes(Rig& rig) {
  Play play(rig);
  Bytes all(256);
  for (std::size_t i = 0; i < all.size(); ++i) all[i] = static_cast<std::uint8_t>(i);
  for (std::size_t i = 0; i < all.size(); i += 4) {
    const std::span<const std::uint8_t> part = std::span(all).subspan(i, 4);
    if (!play.send(part)) break;
    play.expect_same("request", part, bytes_of(play.hear(4)));
    rig.answer(part, kReplyDelay);
    play.expect_same("reply", part, play.receive(4, 16).bytes);
  }
  return play.done();
}

/// Short cycles: the request, the reply 3 us behind it, and at once the next.
Violations no_byte_is_lost_in_short_cycles(Rig& rig) {
  Play play(rig);
  constexpr Time kCycle{40'000};
  constexpr Time kCharacter{4'000};
  const std::size_t cycles = rig.wire_time() ? 2'000 : 100;
  for (std::size_t cycle = 0; cycle < cycles; ++cycle) {
    const Time begin = rig.now();
    const std::array<std::uint8_t, 1> request{static_cast<std::uint8_t>(cycle)};
    const auto start = rig.try_send(request);
    if (!start)
      return play.violated("cycle " + std::to_string(cycle) + ": the request was refused"), play.done();
    Bytes reply(6);
    for (std::size_t i = 0; i < reply.size(); ++i) reply[i] = static_cast<std::uint8_t>(cycle * 7 + i);
    Bytes heard;
    if (rig.wire_time()) {
      rig.answer(reply, *start - begin + kCharacter + kReplyDelay + Time{400});
    } else {
      heard = bytes_of(play.hear(1));
      rig.answer(reply, Time{0});
    }
    // As the bus does: it asks for bytes only.
    Bytes received;
    std::array<std::uint8_t, 12> buffer{};
    const bool whole = play.until([&] {
      const Reception reception = rig.try_receive(std::span(buffer).first(7));
      append(received, std::span(buffer).first(reception.count));
      if (reception.fault != Errc::ok) play.violated("a fault without a cause");
      return received.size() >= reply.size();
    });
    append(heard, bytes_of(rig.heard()));
    play.expect_same("cycle " + std::to_string(cycle) + " request", request, heard);
    play.expect_same("cycle " + std::to_string(cycle) + " reply", reply, received);
    if (!whole || received != reply) break;
    if (rig.wire_time()) {
      play.expect(rig.now() - begin <= kCycle, "a cycle took longer than 40 us");
      if (rig.now() < begin + kCycle) rig.pass(begin + kCycle - rig.now());
    }
  }
  return play.done();
}

Violations a_character_without_a_stop_bit_is_told(Rig& rig) {
  Play play(rig);
  if (!rig.answer_broken(0x55)) return {};
  const Play::Received received = play.receive(1, 16, Errc::framing_error);
  play.expect(received.faults == std::vector{Errc::framing_error},
              "a missing stop bit is not told, or not once");
  rig.answer(kReply, kReplyDelay);
  const Play::Received next = play.receive(kReply.size(), 16);
  play.expect_same("the reply behind it", kReply, next.bytes);
  play.expect(next.faults.empty(), "the fault sticks");
  return play.done();
}

Violations lost_bytes_are_told(Rig& rig) {
  Play play(rig);
  const std::size_t depth = rig.receiver_depth();
  if (depth == 0) return {};
  Bytes flood(depth + 5);
  for (std::size_t i = 0; i < flood.size(); ++i) flood[i] = static_cast<std::uint8_t>(i + 1);
  rig.answer(flood, kReplyDelay);
  rig.pass(Time{1'000'000});
  const Play::Received received = play.receive(depth, 16);
  play.expect_same("what there was room for", first_of(flood, depth), received.bytes);
  play.expect(received.faults == std::vector{Errc::overrun}, "lost bytes are not told, or not once");
  rig.answer(kReply, kReplyDelay);
  const Play::Received next = play.receive(kReply.size(), 16);
  play.expect_same("the reply behind it", kReply, next.bytes);
  play.expect(next.faults.empty(), "the overrun sticks");
  return play.done();
}

Violations a_port_that_is_gone_says_so(Rig& rig) {
  Play play(rig);
  (void)play.send(std::span(kRequest).first(1));
  if (!rig.vanish()) return {};
  std::array<std::uint8_t, 16> buffer{};
  play.expect(play.until([&] { return rig.try_receive(buffer).fault == Errc::port_gone; }),
              "a port that is gone does not say so");
  for (int i = 0; i < 20; ++i) {
    play.expect(rig.try_receive(buffer).fault == Errc::port_gone, "gone does not stay gone");
    const auto start = rig.try_send(std::span(kRequest).first(1));
    play.expect(!start && start.error() == Errc::port_gone, "a port that is gone takes requests");
    const Transmission transmission = rig.transmission();
    play.expect(transmission.state == State::failed && transmission.fault == Errc::port_gone,
                "a port that is gone does not fail its request");
    rig.pass(rig.grain());
  }
  return play.done();
}

constexpr std::array kChecks{
    Check{"capability_is_a_constant", capability_is_a_constant},
    Check{"a_fresh_port_is_idle", a_fresh_port_is_idle},
    Check{"sends_the_request_and_nothing_else", sends_the_request_and_nothing_else},
    Check{"sent_means_off_the_line", sent_means_off_the_line},
    Check{"a_request_is_one_gapless_burst", a_request_is_one_gapless_burst},
    Check{"the_start_is_that_of_the_start_bit", the_start_is_that_of_the_start_bit},
    Check{"an_empty_request_is_refused", an_empty_request_is_refused},
    Check{"requests_follow_one_another", requests_follow_one_another},
    Check{"a_request_under_way_is_not_disturbed", a_request_under_way_is_not_disturbed},
    Check{"bytes_come_once_and_in_order", bytes_come_once_and_in_order},
    Check{"a_late_reader_loses_nothing", a_late_reader_loses_nothing},
    Check{"an_empty_buffer_takes_nothing", an_empty_buffer_takes_nothing},
    Check{"every_byte_value_passes", every_byte_value_passes},
    Check{"no_byte_is_lost_in_short_cycles", no_byte_is_lost_in_short_cycles},
    Check{"a_character_without_a_stop_bit_is_told", a_character_without_a_stop_bit_is_told},
    Check{"lost_bytes_are_told", lost_bytes_are_told},
    Check{"a_port_that_is_gone_says_so", a_port_that_is_gone_says_so},
};

}  // namespace

std::span<const Check> port_checks() { return kChecks; }

const Check& port_check(std::string_view name) {
  for (const Check& check : kChecks)
    if (check.name == name) return check;
  throw std::invalid_argument("no check of this name");
}

Violations run_check(const Check& check, Rig& rig) {
  Violations violations = check.run(rig);
  for (const std::string& complaint : rig.complaints()) violations.push_back(complaint);
  return violations;
}

TEST_P(PortConformance, Holds) {
  const auto& [port, check] = GetParam();
  const std::unique_ptr<Rig> rig = port.make();
  ASSERT_NE(rig, nullptr);
  for (const std::string& violation : run_check(check, *rig)) ADD_FAILURE() << violation;
}

}  // namespace tm485::test
