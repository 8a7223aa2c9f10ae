// A scheduler that is locked to a servo clock, the clock, and a host that starts every request when it is due.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/bus/scheduler.hpp"

namespace tm485::test::servo {

inline const CompiledProfile& profile() {
  static const CompiledProfile kProfile = test::compiled("tm485_17");
  return kProfile;
}

/// A servo clock of its own, and a host that starts every request when it is due.
struct World {
  Scheduler scheduler;
  Time servo_period;
  double ppm = 0;                ///< the servo clock is slower by so much
  std::int64_t tick_jitter = 0;  ///< a tick is stamped up to so many ns late
  std::int64_t host_jitter = 0;
  bool ticking = true;
  test::Rng rng{80};
  Statistics statistics{};
  RequestSpacing spacing{};
  long double tick_at = 123'456.0L;  ///< ns
  Time last_latch{0};                ///< of the pattern's first step
  Time previous_start = -kNever;
  Time previous_t1{0};
  std::uint64_t t1_violations = 0;
  Time now{0};

  Time jitter(std::int64_t most) {
    return Time{most == 0
                    ? 0
                    : static_cast<std::int64_t>(test::random_below(rng, static_cast<std::size_t>(most + 1)))};
  }
  long double period() const { return static_cast<long double>(servo_period.count()) * (1.0L + ppm * 1e-6L); }

  /// One event: a tick or a request, whichever comes first. Answers the true tick if it was one.
  bool step(Time& true_tick) {
    const Time due = std::max(scheduler.slot(), spacing.earliest());
    const Time tick{static_cast<std::int64_t>(std::llround(tick_at))};
    if (tick <= due) {
      now = std::max(now, tick);
      if (ticking) scheduler.on_servo_tick(tick + jitter(tick_jitter), statistics);
      true_tick = tick;
      tick_at += period();
      return true;
    }
    const Time start = due + jitter(host_jitter);
    now = std::max(now, start);
    if (start - previous_start < previous_t1) ++t1_violations;
    previous_start = start;
    previous_t1 = profile().t1(scheduler.id());
    if (scheduler.step() == 0) last_latch = start + us(4);
    spacing.on_start(start, previous_t1);
    scheduler.on_start(start, statistics);
    return false;
  }
};

inline World make(const Pattern& pattern, Time servo_period, Time lead, Time jitter_margin = Time{0}) {
  PortCapability port;
  port.jitter_margin = jitter_margin;
  World world{*Scheduler::make(pattern, Phase::locked_to({servo_period, lead}), profile(), port),
              servo_period};
  world.scheduler.begin(us(7));
  return world;
}

/// Runs until `ticks` have come and answers the largest distance of a latch from lead before its tick, over the last
/// quarter of them.
inline Time worst_error(World& world, Time lead, int ticks) {
  Time worst{0};
  Time tick;
  for (int i = 0; i < ticks;) {
    if (!world.step(tick)) continue;
    ++i;
    if (i < ticks * 3 / 4) continue;
    Time error = (tick - lead - world.last_latch) % std::min(world.scheduler.length(), world.servo_period);
    const Time unit = std::min(world.scheduler.length(), world.servo_period);
    if (error > unit / 2) error -= unit;
    if (error < -unit / 2) error += unit;
    worst = std::max(worst, std::max(error, -error));
  }
  return worst;
}

}  // namespace tm485::test::servo
