// The contract of sending: bytes, burst, start, "sent", and nothing unasked.
#include <array>

#include "conformance/play.hpp"

namespace tm485::test::conformance {

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
      play.expect(heard[i].start - heard[i - 1].end <= rig.longest_gap(), "a gap within a request");
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

}  // namespace tm485::test::conformance
