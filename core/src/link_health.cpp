#include "tm485/bus/link_health.hpp"

namespace tm485 {

std::string_view name(LinkState state) noexcept {
  constexpr std::array<std::string_view, 3> kNames{"good", "degraded", "lost"};
  return kNames[static_cast<std::size_t>(state) % kNames.size()];
}

std::string_view name(LinkCause cause) noexcept {
  constexpr std::array<std::string_view, kLinkCauses> kNames{"silence", "damage", "implausible", "host"};
  return kNames[static_cast<std::size_t>(cause) % kNames.size()];
}

LinkCause link_cause(Errc code) noexcept {
  switch (code) {
    case Errc::timeout:
      return LinkCause::silence;
    case Errc::overrun:
    case Errc::send_failed:
    case Errc::port_gone:
      return LinkCause::host;
    case Errc::abs_out_of_range:
    case Errc::abm_reserved_bits:
    case Errc::enid_unexpected:
    case Errc::status_inconsistent:
    case Errc::position_implausible:
    case Errc::position_lost:
    case Errc::encoder_restarted:
      return LinkCause::implausible;
    default:
      return LinkCause::damage;
  }
}

void LinkHealth::on_failed(Errc cause) noexcept {
  ++now_[static_cast<std::size_t>(link_cause(cause))];
  if (in_a_row_ < UINT8_MAX) ++in_a_row_;
  if (in_a_row_ >= limits_.lost_after) {
    state_ = LinkState::lost;
  } else if (state_ == LinkState::good && total(now_) >= limits_.degraded_at) {
    state_ = LinkState::degraded;
  }
  if (++cycles_ >= limits_.window) close_window();
}

void LinkHealth::on_found(bool first) noexcept {
  in_a_row_ = 0;
  cycles_ = 0;
  now_ = {};
  state_ = first ? LinkState::good : LinkState::degraded;
}

void LinkHealth::close_window() noexcept {
  if (state_ == LinkState::degraded && total(now_) < limits_.good_below) state_ = LinkState::good;
  last_ = now_;
  now_ = {};
  cycles_ = 0;
  measured_ = true;
}

std::uint32_t LinkHealth::total(const Counts& counts) noexcept {
  std::uint32_t sum = 0;
  for (const std::uint16_t count : counts) sum += count;
  return sum;
}

std::uint32_t LinkHealth::rate_ppm(LinkCause cause) const noexcept {
  return static_cast<std::uint32_t>(std::uint64_t{failures(cause)} * 1'000'000 / limits_.window);
}

std::uint32_t LinkHealth::rate_ppm() const noexcept {
  return static_cast<std::uint32_t>(std::uint64_t{total(last_)} * 1'000'000 / limits_.window);
}

}  // namespace tm485
