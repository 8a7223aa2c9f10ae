// Start-up: the sequence without its I/O.
#include <optional>

#include "tm485/bus/startup.hpp"

using namespace tm485;

extern "C" {
void part_startup_make(const CompiledProfile& profile, PositionTracker& tracker, std::uint8_t frames,
                       std::optional<Startup>& to) {
  to.emplace(profile, tracker, frames);
}
void part_startup_begin(Startup& startup, const Time& now, const Time& latency) {
  startup.begin(now, latency);
}
void part_startup_noise(Startup& startup, Errc cause, const Time& now) { startup.on_noise(cause, now); }
void part_startup_quiet(Startup& startup, const Time& now) { startup.on_quiet_time(now); }
void part_startup_frame(Startup& startup, const Frame& frame, const Time& latch, const Time& uncertainty,
                        const Time& now) {
  startup.on_frame(frame, latch, uncertainty, now);
}
void part_startup_error(Startup& startup, Errc cause, const Time& now) { startup.on_error(cause, now); }
bool part_startup_failed(Startup& startup) { return startup.take_failure().has_value(); }
}
