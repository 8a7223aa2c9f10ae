// A port of C++ behind the callbacks of C.
#pragma once

#include <algorithm>
#include <string_view>

#include "c/program.h"
#include "tm485/sim/sim_options.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::test {

/// A simulated encoder as a C program sees it.
class CLine {
 public:
  explicit CLine(std::string_view options) : encoder_(*sim::parse_sim_options(options)) {}
  CLine(const CLine&) = delete;
  CLine& operator=(const CLine&) = delete;

  [[nodiscard]] test_line view() noexcept {
    return {.port = {.context = this,
                     .capability = capability,
                     .try_send = try_send,
                     .transmission = transmission,
                     .try_receive = try_receive},
            .next_event = next_event,
            .context = this};
  }
  [[nodiscard]] sim::SimulatedEncoder& encoder() noexcept { return encoder_; }

 private:
  static sim::SimPort& port(void* context) noexcept { return static_cast<CLine*>(context)->encoder_.port(); }
  static void capability(void* context, tm485_port_capability* to) {
    const PortCapability& from = port(context).capability();
    to->shortest_exchange = from.shortest_exchange.count();
    to->jitter_margin = from.jitter_margin.count();
    to->latency_allowance = from.latency_allowance.count();
    to->release_bound = from.release_bound.count();
    to->wire_timestamps = from.wire_timestamps ? 1 : 0;
    to->timing = static_cast<tm485_timing_class>(from.timing);
  }
  static tm485_errc try_send(void* context, const uint8_t* request, size_t count, tm485_time now,
                             tm485_time* start) {
    const auto sent = port(context).try_send({request, count}, Time{now});
    if (!sent) return static_cast<tm485_errc>(sent.error());
    *start = sent->count();
    return TM485_OK;
  }
  static tm485_transmission_state transmission(void* context, tm485_time now, tm485_errc* fault) {
    const Transmission got = port(context).transmission(Time{now});
    *fault = static_cast<tm485_errc>(got.fault);
    return static_cast<tm485_transmission_state>(got.state);
  }
  static void try_receive(void* context, uint8_t* buffer, size_t size, tm485_time now, tm485_reception* to) {
    const Reception got = port(context).try_receive({buffer, size}, Time{now});
    to->count = static_cast<std::uint32_t>(got.count);
    to->first_start = got.first_start.count();
    to->fault = static_cast<tm485_errc>(got.fault);
  }
  static tm485_time next_event(void* context) {
    return static_cast<CLine*>(context)->encoder_.line().next_event().count();
  }

  sim::SimulatedEncoder encoder_;
};

}  // namespace tm485::test
