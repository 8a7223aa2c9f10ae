// The scheduler: the grid, its phase, the lock to a servo clock.
#include <expected>
#include <optional>

#include "tm485/bus/scheduler.hpp"

using namespace tm485;

extern "C" {
Errc part_scheduler_make(const Pattern& pattern, const Phase& phase, const CompiledProfile& profile,
                         const PortCapability& port, std::optional<Scheduler>& to) {
  const auto made = Scheduler::make(pattern, phase, profile, port);
  if (!made) return made.error().code;
  to = *made;
  return Errc::ok;
}
void part_scheduler_feasibility(const Scheduler& scheduler, Feasibility& to) { to = scheduler.feasibility(); }
void part_scheduler_begin(Scheduler& scheduler, const Time& first) { scheduler.begin(first); }
void part_scheduler_start(Scheduler& scheduler, const Time& start, Statistics& statistics) {
  scheduler.on_start(start, statistics);
}
void part_scheduler_unused(Scheduler& scheduler, const Time& now, Statistics& statistics) {
  scheduler.on_unused(now, statistics);
}
std::uint32_t part_scheduler_give_way(Scheduler& scheduler, const Time& free_at) {
  return scheduler.give_way(free_at);
}
void part_scheduler_tick(Scheduler& scheduler, const Time& tick, Statistics& statistics) {
  scheduler.on_servo_tick(tick, statistics);
}
void part_scheduler_spacing(RequestSpacing& spacing, const Time& at, const Time& t1) {
  spacing.on_start(at, t1);
  spacing.on_reply_seen(at, t1, t1);
}
}
