// Reads a simulated encoder every 62.5 us, in virtual time, and prints the newest sample every 100 ms.
#include <algorithm>
#include <chrono>
#include <cstdio>

#include "tm485/bus/bus.hpp"
#include "tm485/sim/simulated_encoder.hpp"

int main() {
  using namespace std::chrono_literals;

  // What the encoder is: a preset, checked and turned into masks once.
  const auto profile = tm485::CompiledProfile::compile(*tm485::find_profile("tm485_17"));

  // What stands at the other end of the line: 17 bit, multi-turn, 3000 rpm.
  tm485::sim::SimulatedEncoder encoder(*tm485::sim::parse_sim_options("profile=tm485_17,rpm=3000"));

  // ID3 (position, turns, alarms) every 62.5 us, the shortest period that the protocol allows.
  tm485::BusConfig config;
  config.cycle = tm485::Cycle{.id = tm485::DataId::everything, .period = 62500ns};
  tm485::Bus bus(encoder.port(), *profile, config);

  tm485::Time now{0};
  if (!bus.start(now)) return 1;  // a period below T1, or below what the port holds; the error says which
  for (tm485::Time show = 100ms; show <= 500ms; show += 100ms) {
    while (now < show) {
      const tm485::Time due = bus.poll(now);  // sends, receives, publishes: whatever is due
      now = std::max(now, std::min(due, encoder.line().next_event()));
    }
    const tm485::Sample& sample = bus.latest();
    const bool fresh = sample.quality() == tm485::Quality::fresh;
    std::printf("position %8lld counts, turn %2d, %s, latched at %11.3f us\n",
                static_cast<long long>(sample.position()), static_cast<int>(sample.turns()),
                fresh ? "fresh" : "not fresh", static_cast<double>(sample.latch_time().count()) * 1e-3);
  }
  std::printf("%u cycles, %u failed\n", bus.statistics().cycles, bus.statistics().failed);
  return bus.statistics().failed == 0 ? 0 : 1;
}
