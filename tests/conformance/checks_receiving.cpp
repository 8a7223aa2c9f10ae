// The contract of receiving: once, in order, nothing lost, faults and absence told.
#include <array>

#include "conformance/play.hpp"

namespace tm485::test::conformance {

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

/// As many bytes of a reply as the receiver holds while nobody reads.
Bytes what_waits(const Rig& rig) {
  const std::size_t depth = rig.receiver_depth();
  return first_of(kReply, depth == 0 ? kReply.size() : std::min(depth, kReply.size()));
}

Violations a_late_reader_loses_nothing(Rig& rig) {
  Play play(rig);
  const Bytes reply = what_waits(rig);
  rig.answer(reply, kReplyDelay);
  rig.pass(Time{1'000'000});
  const Play::Received received = play.receive(reply.size(), 16);
  play.expect_same("reply", reply, received.bytes);
  play.expect(received.faults.empty(), "a fault without a cause");
  return play.done();
}

Violations an_empty_buffer_takes_nothing(Rig& rig) {
  Play play(rig);
  const Bytes reply = what_waits(rig);
  rig.answer(reply, kReplyDelay);
  for (int i = 0; i < 100; ++i) {
    const Reception reception = rig.try_receive({});
    play.expect(reception.count == 0 && reception.fault == Errc::ok, "an empty buffer got something");
    rig.pass(rig.grain());
  }
  play.expect_same("reply", reply, play.receive(reply.size(), 16).bytes);
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

}  // namespace tm485::test::conformance
