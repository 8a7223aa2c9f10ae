#include "tm485/bus/scheduler.hpp"

#include <algorithm>

namespace tm485 {

std::expected<Scheduler, CycleRefusal> Scheduler::make(const Cycle& cycle, const CompiledProfile& profile,
                                                       const PortCapability& port) noexcept {
  constexpr Time kLongest = std::chrono::hours(1);
  if (number(cycle.id) > number(DataId::everything)) return std::unexpected(CycleRefusal{Errc::bad_argument});
  if (cycle.period > kLongest) return std::unexpected(CycleRefusal{Errc::bad_argument, kLongest});
  const Time t1 = profile.t1(cycle.id);
  const Time nearest = std::max(t1, port.shortest_exchange);
  const Time period = cycle.period == Time{0} ? nearest : cycle.period;
  if (period < t1) return std::unexpected(CycleRefusal{Errc::period_below_t1, nearest});
  if (period < port.shortest_exchange) return std::unexpected(CycleRefusal{Errc::period_below_port, nearest});
  return Scheduler(cycle.id, period, t1, port.jitter_margin);
}

void Scheduler::catch_up(Time late, Statistics& statistics) noexcept {
  const std::int64_t passed = late / period_;
  const auto counted = static_cast<std::uint32_t>(std::min<std::int64_t>(passed, UINT32_MAX));
  saturating_increment(statistics.skipped, counted);
  slot_ += passed * period_;
}

}  // namespace tm485
