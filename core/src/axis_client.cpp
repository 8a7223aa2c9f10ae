#include "tm485/bus/axis_client.hpp"

namespace tm485 {

LoopState AxisClient::read(Time now) noexcept {
  const AxisView& view = link_->view.get();
  view_ = &view;
  if (silent_ && view.resumed != silent_since_resume_) silent_ = false;
  LoopState state;
  state.sample = &view.sample;
  const bool in_time = now < view.valid_until;
  if (view.valid && !in_time && was_valid_ && !silent_) {
    silent_ = true;  // the bus has not been polled: nobody there can say so
    silent_since_resume_ = view.resumed;
  }
  if (!view.valid || !in_time || silent_) {
    was_valid_ = false;
    return state;
  }
  was_valid_ = true;
  state.validity =
      view.newest && now < view.fresh_until ? SampleValidity::fresh : SampleValidity::extrapolated;
  return state;
}

std::expected<std::uint32_t, Errc> AxisClient::post(const Command& command) noexcept {
  // As many results as commands have room, so the bus can always tell how a command ended.
  if (under_way_ == kAxisCommands) return std::unexpected(Errc::busy);
  if (!commands_.try_push({next_ticket_, command})) return std::unexpected(Errc::busy);
  ++under_way_;
  return next_ticket_++;
}

std::optional<CommandResult> AxisClient::poll_completion() noexcept {
  CommandResult result;
  if (!results_.try_pop(result)) return std::nullopt;
  --under_way_;
  return result;
}

}  // namespace tm485
