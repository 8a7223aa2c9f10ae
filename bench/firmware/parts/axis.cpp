// Axis: what it adds to a bus. The part_isr_ functions are what a firmware calls from its interrupts.
#include "tm485/bus/axis.hpp"
#include "memory_port.hpp"

using namespace tm485;
using cost::MemoryPort;

extern "C" {
Errc part_axis_start(Axis<MemoryPort>& axis, const Time& now) {
  const auto started = axis.start(now);
  return started ? Errc::ok : started.error().code;
}
void part_isr_axis_poll(Axis<MemoryPort>& axis, Time& now) { now = axis.poll(now); }
void part_isr_axis_read(AxisClient& client, const Time& now, LoopState& to) { to = client.read(now); }
void part_isr_axis_estimate(const AxisClient& client, const Time& at, Estimate& to) {
  to = client.estimate_at(at);
}
}
