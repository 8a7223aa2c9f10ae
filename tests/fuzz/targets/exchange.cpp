// Exchange with any bytes at any times, against a model that keeps all that it has heard in one list.
#include <algorithm>
#include <vector>

#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "support/frames.hpp"
#include "tm485/bus/exchange.hpp"

namespace tm485::fuzz {
namespace {

constexpr std::int64_t kCharacter = 4'000;

/// One exchange as the specification words it. Times in ns.
struct SlowExchange {
  std::vector<std::uint8_t> request;
  std::size_t back = 0;
  bool echo = false;
  bool wire = false;
  std::int64_t request_end = 0, deadline = 0, t2_min = 0, t2_max = 0;
  std::vector<std::uint8_t> heard = {};  ///< echo and reply
  Errc noticed = Errc::ok;
  bool over = false;
  Errc verdict = Errc::ok;

  [[nodiscard]] std::size_t echoed() const { return echo ? request.size() : 0; }
  [[nodiscard]] std::vector<std::uint8_t> reply() const {
    if (heard.size() <= echoed()) return {};
    return {heard.begin() + static_cast<std::ptrdiff_t>(echoed()), heard.end()};
  }
  void notice(Errc what) {
    if (noticed == Errc::ok) noticed = what;
  }
  void end(Errc what) {
    over = true;
    verdict = what;
  }
  void receive(std::span<const std::uint8_t> bytes, Errc fault, std::int64_t seen) {
    if (over) return;
    if (fault == Errc::port_gone) return end(Errc::port_gone);
    if (fault != Errc::ok) notice(fault);
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      const std::size_t at = heard.size();
      heard.push_back(bytes[i]);
      if (at < echoed() && bytes[i] != request[at]) notice(Errc::echo_mismatch);
      if (at == echoed() && wire && (seen - request_end < t2_min || seen - request_end > t2_max))
        notice(Errc::t2_out_of_window);
    }
    if (reply().size() > back) return end(Errc::overlong_reply);
    if (reply().size() == back) return end(noticed);
  }
  void pass(std::int64_t now) {
    if (over || now <= deadline) return;
    const auto got = reply();
    if (echo && !got.empty() && got[0] != request[0] && back - got.size() == request.size())
      return end(Errc::echo_mismatch);  // the head of the reply was taken for the echo
    if (noticed != Errc::ok) return end(noticed);
    end(got.empty() ? Errc::timeout : Errc::incomplete_reply);
  }
};

}  // namespace

/// Request, profile and port; then steps of a kind, a time and perhaps bytes.
int fuzz_exchange(std::span<const std::uint8_t> bytes) {
  Input input(bytes);
  const test::Kind& kind = test::kKinds[input.below(9)];
  Profile profile;
  profile.t2_min = Time{input.u16()};
  profile.t2_max = profile.t2_min + Time{input.u16()};
  profile.echo = input.flag();
  PortCapability port;
  port.wire_timestamps = input.flag();
  port.latency_allowance = Time{input.u16()} * 16;
  const auto compiled = CompiledProfile::compile(profile);
  if (!compiled) return 0;
  const auto request = kind.id == 13  ? Request::eeprom_read(input.u8() & 0x7FU)
                       : kind.id == 6 ? Request::eeprom_write(input.u8() & 0x7FU, input.u8())
                                      : Request::make(static_cast<DataId>(kind.id));
  const std::int64_t start = 1'000'000;
  SlowExchange slow{.request = {request->bytes().begin(), request->bytes().end()},
                    .back = kind.back,
                    .echo = profile.echo,
                    .wire = port.wire_timestamps};
  slow.request_end = start + kCharacter * static_cast<std::int64_t>(kind.out);
  slow.t2_min = profile.t2_min.count();
  slow.t2_max = profile.t2_max.count();
  slow.deadline = slow.request_end + slow.t2_max + kCharacter * static_cast<std::int64_t>(kind.back + 1) +
                  port.latency_allowance.count();

  Exchange exchange;
  exchange.begin(*request, Time{start}, *compiled, port);
  std::int64_t now = start;
  const auto same = [&] {
    require((exchange.state() == Exchange::State::done) == slow.over, "over at the same step");
    if (!slow.over) {
      require(exchange.deadline() == Time{slow.deadline}, "deadline");
      const std::size_t room = exchange.room().size();
      const std::size_t left = slow.heard.size() < slow.echoed() ? slow.echoed() - slow.heard.size()
                                                                 : slow.back + 1 - slow.reply().size();
      require(room == left, "room for what is missing and one byte");
      return;
    }
    require(exchange.error() == slow.verdict, "verdict");
    require(std::ranges::equal(exchange.reply(), slow.reply()), "bytes of the reply");
    require(exchange.has_reply_delay() == !slow.reply().empty(), "a delay if there was a byte");
  };
  for (int step = 0; step < 64 && !input.empty(); ++step) {
    now += input.u8() * 500;
    switch (input.below(4)) {
      case 0:
      case 1: {
        constexpr Errc kFaults[] = {Errc::ok,       Errc::ok, Errc::ok, Errc::overrun, Errc::framing_error,
                                    Errc::port_gone};
        const Errc fault = kFaults[input.below(6)];
        if (slow.over) break;
        const auto room = exchange.room();
        const auto got = input.bytes(std::min<std::size_t>(input.below(16), room.size()));
        std::ranges::copy(got, room.begin());
        exchange.on_received({.count = got.size(), .first_start = Time{now}, .fault = fault},
                             Time{now + 100});
        slow.receive(got, fault, now);
        break;
      }
      case 2:
        exchange.on_time(Time{now});
        slow.pass(now);
        break;
      default:
        if (input.below(16) != 0 || slow.over) break;
        exchange.on_fault(Errc::send_failed);
        slow.end(Errc::send_failed);
        break;
    }
    same();
  }
  exchange.on_time(Time{std::max(now, slow.deadline) + 1});
  slow.pass(std::max(now, slow.deadline) + 1);
  same();
  require(exchange.state() == Exchange::State::done, "every exchange ends");
  exchange.abandon();
  require(exchange.state() == Exchange::State::idle, "abandoned");
  return 0;
}

}  // namespace tm485::fuzz
