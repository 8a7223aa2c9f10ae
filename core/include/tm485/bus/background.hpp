// BackgroundQueue: the exchanges that wait for free time between the cyclic ones, and their results.
//
// Three classes, by the ID of the request, each with one place: reset requests go before the cycle, EEPROM requests
// and everything else (diagnostics) after it, in this order, but who has waited for 32 slots goes first. A place is
// free again when its completion was taken, so nothing that was offered is ever lost.
#pragma once

#include <array>
#include <cstdint>
#include <expected>
#include <optional>

#include "tm485/errc.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/request.hpp"

namespace tm485 {

/// Who goes first. Cyclic requests stand between reset_run and eeprom.
enum class Priority : std::uint8_t { reset_run, eeprom, diagnostics };
inline constexpr std::size_t kPriorities = 3;

/// The class of a request: what it asks for says how urgent it is.
[[nodiscard]] constexpr Priority priority_of(const Request& request) noexcept {
  switch (request.id()) {
    case DataId::reset_errors:
    case DataId::reset_single_turn:
    case DataId::reset_multi_turn:
      return Priority::reset_run;
    case DataId::eeprom_read:
    case DataId::eeprom_write:
      return Priority::eeprom;
    default:
      return Priority::diagnostics;
  }
}

/// A finished background exchange.
struct Completion {
  Request request;
  std::expected<Reply, Errc> result;
  std::uint32_t ticket = 0;  ///< as offered
  /// What the encoder said, also where `result` is eeprom_busy or eeprom_address_mismatch: a reply that the line's and
  /// the profile's checks let pass.
  std::optional<Reply> heard;
};

/// One owner (the bus). Every function: constant time.
class BackgroundQueue {
 public:
  /// After so many slots a request goes before the other class.
  static constexpr std::uint16_t kAged = 32;
  /// After so many chances that did not fit it ends with no_gap.
  static constexpr std::uint16_t kMostSlots = 64;

  /// busy while the class has a request, or a completion that was not taken.
  [[nodiscard]] std::expected<void, Errc> offer(const Request& request, std::uint32_t ticket) noexcept;
  /// The request that is next, or null. Stays until it is completed.
  [[nodiscard]] const Request* next() const noexcept { return waiting_ == 0 ? nullptr : choose(); }
  [[nodiscard]] bool empty() const noexcept { return waiting_ == 0; }
  [[nodiscard]] bool has_reset() const noexcept { return (waiting_ & 1U) != 0; }
  /// A cyclic slot went by. Answers the class whose request has now waited for `most` slots, if one has.
  [[nodiscard]] std::optional<Priority> on_slot_passed(std::uint32_t most) noexcept;
  /// How many slots the request of a class has waited.
  [[nodiscard]] std::uint32_t waited(Priority priority) const noexcept { return at(priority).waited; }
  /// The request of a class has its result.
  void complete(Priority priority, const std::expected<Reply, Errc>& result) noexcept {
    complete(priority, result, result ? std::optional(*result) : std::nullopt);
  }
  void complete(Priority priority, const std::expected<Reply, Errc>& result,
                const std::optional<Reply>& heard) noexcept;
  /// Everything that waits ends with `cause`, but what is under way with `cause_under_way`.
  void complete_all(Errc cause, std::optional<Priority> under_way, Errc cause_under_way) noexcept;
  /// A completion, once; that of the most urgent class first.
  [[nodiscard]] std::optional<Completion> take() noexcept;
  /// That of one class, if it has this ticket.
  [[nodiscard]] std::optional<Completion> take(Priority priority, std::uint32_t ticket) noexcept;

 private:
  struct Place {
    std::optional<Request> request;
    std::optional<std::expected<Reply, Errc>> result;
    std::optional<Reply> heard;
    std::uint32_t ticket = 0;
    std::uint32_t waited = 0;
  };

  [[nodiscard]] Place& at(Priority priority) noexcept { return places_[static_cast<std::size_t>(priority)]; }
  [[nodiscard]] const Place& at(Priority priority) const noexcept {
    return places_[static_cast<std::size_t>(priority)];
  }
  [[nodiscard]] const Request* choose() const noexcept;
  [[nodiscard]] std::optional<Completion> take_from(std::size_t index) noexcept;

  std::array<Place, kPriorities> places_;
  std::uint8_t waiting_ = 0;  ///< a bit for each class
  std::uint8_t done_ = 0;
};

}  // namespace tm485
