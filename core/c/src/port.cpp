// The port that calls the user's functions.
#include "tm485/c/port.h"

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <type_traits>

#include "convert.hpp"
#include "handles.hpp"

namespace tm485::c {
namespace {

using State = Transmission::State;

static_assert(std::has_unique_object_representations_v<tm485_port_capability> &&
              std::has_unique_object_representations_v<tm485_reception>);
static_assert(value(TimingClass::hard) == TM485_TIMING_HARD &&
              value(TimingClass::soft) == TM485_TIMING_SOFT &&
              value(TimingClass::best_effort) == TM485_TIMING_BEST_EFFORT);
static_assert(value(State::idle) == TM485_TRANSMISSION_IDLE &&
              value(State::sending) == TM485_TRANSMISSION_SENDING &&
              value(State::sent) == TM485_TRANSMISSION_SENT &&
              value(State::failed) == TM485_TRANSMISSION_FAILED);

/// No instant that a port may name is further from now than this; sums with it cannot overflow.
constexpr Time kFurthest = std::chrono::hours(1);

[[nodiscard]] bool plausible(tm485_time instant, Time now) noexcept {
  return instant >= (now - kFurthest).count() && instant <= (now + kFurthest).count();
}

}  // namespace

PortCapability CPort::capability() const noexcept {
  tm485_port_capability stated{};
  port_->capability(port_->context, &stated);
  return {.shortest_exchange = Time{stated.shortest_exchange},
          .jitter_margin = Time{stated.jitter_margin},
          .latency_allowance = Time{stated.latency_allowance},
          .wire_timestamps = stated.wire_timestamps != 0,
          .release_bound = Time{stated.release_bound},
          // A class that is none promises nothing.
          .timing = stated.timing <= TM485_TIMING_BEST_EFFORT ? static_cast<TimingClass>(stated.timing)
                                                              : TimingClass::best_effort};
}

std::expected<Time, Errc> CPort::try_send(std::span<const std::uint8_t> request, Time now) noexcept {
  tm485_time start = now.count();
  const tm485_errc error =
      port_->try_send(port_->context, request.data(), request.size(), now.count(), &start);
  if (error == TM485_OK && plausible(start, now)) [[likely]]
    return Time{start};
  return std::unexpected(error == TM485_ERR_SEND_FAILED ? Errc::send_failed : Errc::port_gone);
}

Transmission CPort::transmission(Time now) noexcept {
  tm485_errc fault = TM485_OK;
  const tm485_transmission_state state = port_->transmission(port_->context, now.count(), &fault);
  if (state < TM485_TRANSMISSION_FAILED) [[likely]]
    return {.state = static_cast<State>(state)};
  const bool named = state == TM485_TRANSMISSION_FAILED && known(fault) && fault != TM485_OK;
  return {.state = State::failed, .fault = named ? static_cast<Errc>(fault) : Errc::port_gone};
}

Reception CPort::try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
  tm485_reception reception{};
  port_->try_receive(port_->context, buffer.data(), buffer.size(), now.count(), &reception);
  if (reception.count > buffer.size() || !known(reception.fault) ||
      (reception.count != 0 && !plausible(reception.first_start, now) && reception.first_start != 0))
      [[unlikely]]
    return {.fault = Errc::port_gone};
  return {.count = reception.count,
          .first_start = Time{reception.first_start},
          .fault = static_cast<Errc>(reception.fault)};
}

}  // namespace tm485::c
