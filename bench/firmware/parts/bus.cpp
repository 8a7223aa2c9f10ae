// The bus, on a port in memory. The part_isr_ functions are what a firmware calls from its interrupts.
#include "tm485/bus/bus.hpp"
#include "memory_port.hpp"

using namespace tm485;
using cost::MemoryPort;

extern "C" {
Errc part_bus_start(MemoryPort& port, const CompiledProfile& profile, const BusConfig& config,
                    const Time& now) {
  Bus<MemoryPort> bus(port, profile, config);
  const auto started = bus.start(now);
  return started ? Errc::ok : started.error().code;
}
void part_bus_stop(Bus<MemoryPort>& bus) { bus.stop(); }
void part_isr_bus_poll(Bus<MemoryPort>& bus, Time& now) { now = bus.poll(now); }
const Sample* part_isr_bus_latest(Bus<MemoryPort>& bus) { return &bus.latest(); }
void part_isr_bus_servo_tick(Bus<MemoryPort>& bus, const Time& tick) { bus.on_servo_tick(tick); }
void part_bus_restart(Bus<MemoryPort>& bus, const Time& now) { bus.on_restart(now); }
bool part_isr_bus_offer(Bus<MemoryPort>& bus, const Request& request) {
  return bus.offer(request).has_value();
}
bool part_isr_bus_take(Bus<MemoryPort>& bus, std::optional<Completion>& to) {
  to = bus.take_completion();
  return to.has_value();
}
}
