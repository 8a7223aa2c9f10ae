// The position: replies in, samples out.
#include <optional>

#include "tm485/motion/position_tracker.hpp"

using namespace tm485;

extern "C" {
void part_position_make(const CompiledProfile& profile, const AxisConfig& axis,
                        std::optional<PositionTracker>& to) {
  to.emplace(profile, axis);
}
Errc part_position_update(PositionTracker& tracker, const Reply& reply, const Time& latch,
                          const Time& uncertainty, Sample& to) {
  return tracker.update(reply, latch, uncertainty, to);
}
Errc part_position_note(PositionTracker& tracker, const Reply& reply, const Time& latch,
                        const Time& uncertainty) {
  return tracker.note(reply, latch, uncertainty);
}
void part_position_hold(PositionTracker& tracker, const Time& now, const Time& max_hold, Sample& to) {
  to = tracker.hold(now, max_hold);
}
void part_position_forget(PositionTracker& tracker, Sample& to) { to = tracker.forget(); }
}
