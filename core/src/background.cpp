#include "tm485/bus/background.hpp"

namespace tm485 {
namespace {

[[nodiscard]] constexpr std::uint8_t bit(std::size_t index) noexcept {
  return static_cast<std::uint8_t>(1U << index);
}

}  // namespace

std::expected<void, Errc> BackgroundQueue::offer(const Request& request, std::uint32_t ticket) noexcept {
  const auto index = static_cast<std::size_t>(priority_of(request));
  if (((waiting_ | done_) & bit(index)) != 0) return std::unexpected(Errc::busy);
  Place& place = places_[index];
  place.request = request;
  place.ticket = ticket;
  place.waited = 0;
  waiting_ |= bit(index);
  return {};
}

const Request* BackgroundQueue::choose() const noexcept {
  const Place& eeprom = at(Priority::eeprom);
  const Place& diagnostics = at(Priority::diagnostics);
  if (has_reset()) return &*at(Priority::reset_run).request;
  const bool has_eeprom = (waiting_ & bit(static_cast<std::size_t>(Priority::eeprom))) != 0;
  const bool has_diagnostics = (waiting_ & bit(static_cast<std::size_t>(Priority::diagnostics))) != 0;
  const bool aged = has_diagnostics && diagnostics.waited >= kAged;
  return has_eeprom && !aged ? &*eeprom.request : &*diagnostics.request;
}

std::optional<Priority> BackgroundQueue::on_slot_passed(std::uint32_t most) noexcept {
  std::optional<Priority> starved;
  for (std::size_t i = 0; i < kPriorities; ++i) {
    if ((waiting_ & bit(i)) == 0) continue;
    if (++places_[i].waited >= most) starved = static_cast<Priority>(i);
  }
  return starved;
}

void BackgroundQueue::complete(Priority priority, const std::expected<Reply, Errc>& result,
                               const std::optional<Reply>& heard) noexcept {
  const auto index = static_cast<std::size_t>(priority);
  if ((waiting_ & bit(index)) == 0) return;
  places_[index].result.emplace(result);
  places_[index].heard = heard;
  waiting_ = static_cast<std::uint8_t>(waiting_ & ~bit(index));
  done_ |= bit(index);
}

void BackgroundQueue::complete_all(Errc cause, std::optional<Priority> under_way,
                                   Errc cause_under_way) noexcept {
  for (std::size_t i = 0; i < kPriorities; ++i) {
    const auto priority = static_cast<Priority>(i);
    complete(priority, std::unexpected(under_way == priority ? cause_under_way : cause));
  }
}

std::optional<Completion> BackgroundQueue::take_from(std::size_t index) noexcept {
  if ((done_ & bit(index)) == 0) return std::nullopt;
  done_ = static_cast<std::uint8_t>(done_ & ~bit(index));
  const Place& place = places_[index];
  return Completion{*place.request, *place.result, place.ticket, place.heard};
}

std::optional<Completion> BackgroundQueue::take(Priority priority, std::uint32_t ticket) noexcept {
  const auto index = static_cast<std::size_t>(priority);
  if (places_[index].ticket != ticket) return std::nullopt;
  return take_from(index);
}

std::optional<Completion> BackgroundQueue::take() noexcept {
  for (std::size_t i = 0; i < kPriorities; ++i)
    if (auto completion = take_from(i)) return completion;
  return std::nullopt;
}

}  // namespace tm485
