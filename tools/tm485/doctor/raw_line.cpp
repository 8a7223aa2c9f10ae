#include "doctor/raw_line.hpp"

#include <algorithm>

#include "open_port.hpp"
#include "stop_signal.hpp"
#include "tm485/protocol/layout.hpp"

namespace tm485::cli::doctor {
namespace {

/// A T2 beyond any device's, still found.
constexpr Time kLongestGap = std::chrono::milliseconds(1);
/// A reply that takes longer comes from another process or is lost: leave it the processor.
constexpr Time kSpin = std::chrono::microseconds(200);
constexpr Time kNap = std::chrono::microseconds(50);
constexpr Time kLongestPause = std::chrono::milliseconds(50);

bool is_simulated(const std::string& text) { return text == "sim" || text.starts_with("sim:"); }

}  // namespace

std::expected<void, Problem> RawLine::open(const PortOptions& options, std::uint32_t bit_rate) {
  port_.reset();  // first: a serial line is opened exclusively
  simulated_ = is_simulated(options.port);
  auto opened = open_port(options, bit_rate, simulated_);
  if (!opened) return std::unexpected(std::move(opened.error()));
  port_.emplace(std::move(*opened));
  capability_ = port_->capability();
  bit_rate_ = bit_rate;
  character_ = Time{10'000'000'000 / bit_rate};
  next_request_ = now();
  return {};
}

Time RawLine::listening_time() const noexcept {
  // An encoder at a fifth of the rate needs five times as long.
  constexpr std::int64_t kSlower = 5;
  return character_ * static_cast<std::int64_t>(kMaxRequest + kMaxReply) * kSlower + kLongestGap +
         capability_.latency_allowance;
}

void RawLine::pause(Time span) {
  const Time until = now() + span;
  if (simulated_) {
    virtual_clock_.advance_to(until);
    return;
  }
  while (!stop_requested() && now() < until) (void)clock_.sleep_until(std::min(until, now() + kLongestPause));
}

Heard RawLine::ask(const Request& request, const CompiledProfile& profile, std::size_t enough) {
  Heard heard;
  if (gone()) {
    heard.fault = Errc::port_gone;
    return heard;
  }
  if (now() < next_request_) pause(next_request_ - now());
  while (take(heard)) {  // whatever came since: nobody had asked for it
    heard.stray += static_cast<std::uint32_t>(heard.count);
    heard.count = 0;
    if (heard.stray > Heard::kCapacity) break;  // a babbler never ends
  }
  heard.fault = Errc::ok;
  const Time at = now();
  const auto sent = port_->try_send(request.bytes(), at);
  if (!sent) {
    heard.fault = sent.error();
    next_request_ = now() + listening_time();
    return heard;
  }
  heard.request_start = *sent;
  heard.request_end = *sent + character_ * static_cast<std::int64_t>(request.bytes().size());
  listen(heard, *sent + listening_time(), enough);
  if (heard.count != enough && heard.fault == Errc::ok) heard.fault = port_->line_fault();
  // Without wire timestamps a request may have left later than the port estimates: count from the reply.
  const Time from = capability_.wire_timestamps ? heard.request_start : now();
  // A late reply may end after T1: the encoder's driver has to be off the line as well.
  next_request_ = std::max(now() + 2 * character_, from + profile.t1(request.id()));
  return heard;
}

void RawLine::listen_more(Heard& heard, Time span, std::size_t enough) {
  if (gone()) return;
  listen(heard, now() + span, enough);
  next_request_ = std::max(next_request_, now() + 2 * character_);
}

bool RawLine::take(Heard& heard) {
  const std::size_t before = heard.count;
  if (before == Heard::kCapacity) return false;
  const Reception reception = port_->try_receive(std::span(heard.bytes).subspan(before), now());
  if (reception.fault != Errc::ok && heard.fault == Errc::ok) heard.fault = reception.fault;
  if (reception.count == 0) return false;
  if (before == 0) heard.first_seen = now();
  for (std::size_t k = 0; k < reception.count; ++k)
    heard.starts[before + k] = reception.first_start + character_ * static_cast<std::int64_t>(k);
  heard.count += reception.count;
  return true;
}

void RawLine::listen(Heard& heard, Time deadline, std::size_t enough) {
  const Time begin = now();
  for (;;) {
    while (take(heard)) {
    }
    if (heard.count >= std::min(enough, Heard::kCapacity)) return;
    if (heard.fault == Errc::port_gone || stop_requested()) return;
    const Time at = now();
    if (at >= deadline) return;
    if (simulated_) {
      const Time event = port_->next_event();
      virtual_clock_.advance_to(event > at ? std::min(event, deadline) : deadline);
    } else if (at - begin > kSpin) {
      (void)clock_.sleep_until(std::min(deadline, at + kNap));
    }
  }
}

}  // namespace tm485::cli::doctor
