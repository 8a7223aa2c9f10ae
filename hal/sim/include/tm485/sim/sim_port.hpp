// The host's port on a simulated line, with exact wire timestamps. Specification: sections 1 and 4.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>

#include "tm485/bus/port.hpp"
#include "tm485/errc.hpp"
#include "tm485/sim/line.hpp"
#include "tm485/sim/random.hpp"
#include "tm485/time.hpp"

namespace tm485::sim {

struct SimPortConfig {
  Time driver_lead{1'000};  ///< driver enabled this long before the start bit
  Time release{200};        ///< driver off the line this long after the last stop bit; also the bound stated
  Time start_jitter{0};     ///< a request starts uniformly 0..start_jitter late; less than 4 s
  Time jitter_margin{0};    ///< stated in the capability; at least start_jitter for an honest port
  std::uint64_t seed = 1;   ///< of the jitter
};

/// Satisfies `tm485::Port`. One owner; no function blocks or allocates; bounded by the line's kBursts.
class SimPort {
 public:
  /// `line` must outlive the port.
  explicit SimPort(Line& line, const SimPortConfig& config = {}) noexcept
      : line_{&line}, config_{config}, jitter_{config.seed} {
    capability_.jitter_margin = config.jitter_margin;
    capability_.wire_timestamps = true;
    capability_.release_bound = config.release;
    capability_.timing = TimingClass::hard;
  }

  [[nodiscard]] const PortCapability& capability() const noexcept { return capability_; }

  /// Starts `request` (1..4 bytes) at `now` plus the jitter and answers the start bit's instant. send_failed
  /// if the length is wrong, the request before is still being sent, or the line took too many bursts.
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    if (request.empty() || request.size() > kLongestRequest || now < released_) [[unlikely]] {
      return std::unexpected{Errc::send_failed};
    }
    if (now >= unplugged_) [[unlikely]]
      return std::unexpected{Errc::port_gone};
    line_->advance_to(now);
    Time start = now;
    if (config_.start_jitter > Time{0}) start += Time{jitter_.below(config_.start_jitter.count() + 1)};
    const Time end = start + line_->character_time() * static_cast<std::int64_t>(request.size());
    const Time released = end + config_.release;
    if (!line_->transmit(Talker::host, start, request, start - config_.driver_lead, released)) [[unlikely]] {
      return std::unexpected{Errc::send_failed};
    }
    released_ = released;
    return start;
  }

  /// `sent` once the last stop bit has left and the driver is off the line.
  [[nodiscard]] Transmission transmission(Time now) const noexcept {
    if (now >= unplugged_) [[unlikely]]
      return {.state = Transmission::State::failed, .fault = Errc::port_gone};
    if (released_ == kNothingSent) return {};
    return {.state = now >= released_ ? Transmission::State::sent : Transmission::State::sending};
  }

  /// Bytes of one burst at a time, never across a gap. `overrun` if nobody took earlier bytes in time,
  /// `framing_error` if one of these had no stop bit.
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    if (now >= unplugged_) [[unlikely]]
      return {.fault = Errc::port_gone};
    const HostReception heard = line_->host_receive(buffer, now);
    const Errc fault = heard.lost ? Errc::overrun : heard.framing_error ? Errc::framing_error : Errc::ok;
    return {.count = heard.count, .first_start = heard.first_start, .fault = fault};
  }

  /// From `at` on the port is gone, as an adapter that was pulled out. The encoder goes on.
  void unplug(Time at) noexcept { unplugged_ = at; }

 private:
  static constexpr std::size_t kLongestRequest = 4;
  static constexpr Time kNothingSent = -kNever;

  Line* line_;
  SimPortConfig config_;
  PortCapability capability_;
  Random jitter_;
  Time released_ = kNothingSent;
  Time unplugged_ = kNever;
};

static_assert(Port<SimPort>);

}  // namespace tm485::sim
