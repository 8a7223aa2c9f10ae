// The exchange: one request and its reply.
#include "tm485/bus/exchange.hpp"

using namespace tm485;

extern "C" {
void part_exchange_begin(Exchange& exchange, const Request& request, const Time& start,
                         const CompiledProfile& profile, const PortCapability& port) {
  exchange.begin(request, start, profile, port);
}
void part_exchange_received(Exchange& exchange, const Reception& reception, const Time& now) {
  exchange.on_received(reception, now);
}
void part_exchange_time(Exchange& exchange, const Time& now) { exchange.on_time(now); }
std::uint8_t* part_exchange_room(Exchange& exchange) { return exchange.room().data(); }
}
