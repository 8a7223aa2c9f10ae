// BusGroup: many buses polled from one context.
//
// The owner calls poll() as it would call that of one bus, and every member is polled when it wants to be. The
// members know nothing of each other: each has its port, profile and pattern.
//
//   staggered   Phase::at(epoch + stagger(i, n, length)): the starts are spread evenly, and so is the work
//   aligned     Phase::at(epoch) for all: one latch instant, whatever each profile's request length; GroupConfig::round
//               has the group report by how much the latches differ
//
// When a member is polled next: at the instant that its own poll() has answered, or earlier if a reply may be there
// (GroupConfig::look_again), or at the next call after wake().
//
// The schedule is a wheel of short spans of time (a list of members in each, a bit for each that has any) in front of
// a heap with whatever is due in the present span, or beyond the wheel. So a call costs the same for one member and
// for hundreds, and at worst, if all are due within one span, the logarithm of their number. Specification: section 4.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <type_traits>

#include "tm485/bus/latch_skew.hpp"
#include "tm485/bus/statistics.hpp"
#include "tm485/errc.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// What a group polls: Bus, Axis, or anything around one. `poll` does what is due and answers when to be called again
/// at the latest; earlier is allowed.
template <class M>
concept Pollable = requires(M& member, Time now) {
  { member.poll(now) } noexcept -> std::same_as<Time>;
};

struct GroupConfig {
  /// For ports that tell nobody when bytes arrive: from the instant at which a reply can be complete (Bus::reply_expected)
  /// a member is polled again after this time, until it has its verdict. kNever: the owner calls wake().
  Time look_again{500};
  /// How many members one call polls at most. Few, so that `now` is not long past for the last of them.
  std::uint32_t at_once = 8;
  /// The members' patterns are this long and aligned to `epoch`: their skew is reported, from the records of member or
  /// member.bus(). 0: not.
  Time round{0};
  Time epoch{0};
};

/// Member `i` of `n` starts this long after the first, for starts that are spread evenly over `length`.
[[nodiscard]] constexpr Time stagger(std::size_t i, std::size_t n, Time length) noexcept {
  return n == 0 ? Time{0} : length * static_cast<std::int64_t>(i) / static_cast<std::int64_t>(n);
}

/// One owner, the context of all its members. At most `Capacity` of them; 48 bytes for each and
/// at most 1.5 KiB besides.
template <Pollable M, std::size_t Capacity>
class BusGroup {
  static_assert(Capacity > 0 && Capacity < 65'535);

 public:
  explicit BusGroup(const GroupConfig& config = {}) noexcept : config_(config) {
    first_.fill(kNobody);
    if (config.round > Time{0}) skew_.emplace(config.epoch, config.round);
  }
  BusGroup(const BusGroup&) = delete;
  BusGroup& operator=(const BusGroup&) = delete;

  /// `member` must outlive the group; it is polled first with the next call. Answers its index. bad_state: the group
  /// is full. O(log n).
  std::expected<std::size_t, Errc> add(M& member) noexcept;

  /// Polls each member that is due at `now` once, the one that waits longest first, and at most GroupConfig::at_once.
  /// Answers when to call again at the latest: `now` if more are due; kNever if no member wants it. Earlier
  /// is allowed. `now` never goes back. Bounded by at_once times (what the members' poll is bounded by + O(log n)).
  Time poll(Time now) noexcept;

  /// Something happened at a member (bytes arrived; it was started, offered a request): it is polled with the next
  /// call. O(1) if it waits in the wheel, otherwise one step for each in the heap. `index` as answered by add().
  void wake(std::size_t index) noexcept;

  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  [[nodiscard]] static constexpr std::size_t capacity() noexcept { return Capacity; }
  [[nodiscard]] M& member(std::size_t index) noexcept { return *nodes_[index].member; }
  /// How long a member was due before it was polled, at most: what the context lacks if it is not fast enough.
  [[nodiscard]] Time latest_poll() const noexcept { return latest_poll_; }
  /// Of aligned members, if GroupConfig::round is given.
  [[nodiscard]] const std::optional<LatchSkew>& skew() const noexcept { return skew_; }

 private:
  using Index = std::uint16_t;
  enum class Place : std::uint8_t { heap, wheel };
  struct Node {
    M* member = nullptr;
    Time due{0};
    std::uint32_t records = 0;  ///< of its bus, when last looked at
    Index next = kNobody;       ///< in its span
    Index previous = kNobody;
    Place place = Place::heap;
  };
  struct Due {
    Time at;
    Index index;
  };

  static constexpr Index kNobody = 0xFFFF;
  static constexpr Time kWoken{-1};  ///< due before everyone else, and not late
  /// 131 us in all. More of them do not pay: with 512 members in 62.5 us about four polls fall into one.
  static constexpr std::size_t kSpans = std::clamp<std::size_t>(std::bit_ceil(2 * Capacity), 64, 512);
  static constexpr unsigned kShift = 17 - (std::bit_width(kSpans) - 1);
  static constexpr std::size_t kWords = kSpans / 64;
  static constexpr std::int64_t kNoSpan = std::int64_t{1} << 62;

  [[nodiscard]] static std::int64_t span_of(Time time) noexcept { return time.count() >> kShift; }
  [[nodiscard]] static std::size_t slot_of(std::int64_t span) noexcept {
    return static_cast<std::size_t>(span) % kSpans;
  }
  [[nodiscard]] Time poll_member(Index index, Time now) noexcept;
  void account(Node& node) noexcept;
  void insert(Index index, Time due) noexcept;
  void push(Index index, Time due) noexcept;
  void pop() noexcept;
  void unlink(Index index) noexcept;
  void load() noexcept;
  [[nodiscard]] std::int64_t span_after(std::int64_t span) const noexcept;

  GroupConfig config_;
  std::size_t size_ = 0;
  std::size_t heaped_ = 0;            ///< members in the heap
  std::int64_t span_ = 0;             ///< what is due in it, or before, is in the heap
  std::int64_t next_span_ = kNoSpan;  ///< the first in the wheel with a member
  Time latest_poll_{0};
  std::array<std::uint64_t, kWords> occupied_{};
  std::array<Index, kSpans> first_;
  std::array<Due, Capacity> heap_;  // the first heaped_ are valid
  std::array<Node, Capacity> nodes_;
  std::optional<LatchSkew> skew_;
};

template <Pollable M, std::size_t Capacity>
std::expected<std::size_t, Errc> BusGroup<M, Capacity>::add(M& member) noexcept {
  if (size_ == Capacity) return std::unexpected(Errc::bad_state);
  nodes_[size_].member = &member;
  push(static_cast<Index>(size_), kWoken);
  return size_++;
}

template <Pollable M, std::size_t Capacity>
Time BusGroup<M, Capacity>::poll(Time now) noexcept {
  if (next_span_ == kNoSpan) span_ = span_of(now);
  for (std::uint32_t polled = 0;; ++polled) {
    // The heap's first is the first of all if nothing in the wheel may be earlier.
    while (next_span_ != kNoSpan && (heaped_ == 0 || span_of(heap_[0].at) >= next_span_)) load();
    if (heaped_ == 0) return kNever;
    const Due due = heap_[0];
    if (due.at > now) return due.at;
    if (polled >= config_.at_once) return now;
    pop();
    if (due.at != kWoken) latest_poll_ = std::max(latest_poll_, now - due.at);
    insert(due.index, poll_member(due.index, now));
  }
}

/// Answers when it is due next: after `now`, so that no member is polled twice in one call.
template <Pollable M, std::size_t Capacity>
Time BusGroup<M, Capacity>::poll_member(Index index, Time now) noexcept {
  Node& node = nodes_[index];
  M& member = *node.member;
  Time due = member.poll(now);
  if constexpr (requires { member.reply_expected(); })
    due = std::min(due, std::max(member.reply_expected(), now + config_.look_again));
  if (skew_) account(node);
  return std::max(due, now + Time{1});
}

/// A good cycle of an aligned member counts for the skew.
template <Pollable M, std::size_t Capacity>
void BusGroup<M, Capacity>::account(Node& node) noexcept {
  const auto look = [&](const auto& bus) {
    if (bus.record_count() == node.records) return;
    node.records = bus.record_count();
    const auto& record = bus.last_record();
    using Record = std::remove_cvref_t<decltype(record)>;
    if (record.kind != Record::Kind::cyclic || record.result != Errc::ok) return;
    const Time latch_after = bus.latch_after(record.id);
    skew_->add(record.slot + latch_after, record.start + latch_after, static_cast<std::uint32_t>(size_));
  };
  if constexpr (requires { node.member->bus(); }) {
    look(node.member->bus());
  } else if constexpr (requires { node.member->last_record(); }) {
    look(*node.member);
  }
}

template <Pollable M, std::size_t Capacity>
void BusGroup<M, Capacity>::insert(Index index, Time due) noexcept {
  Node& node = nodes_[index];
  const std::int64_t span = span_of(due);
  const std::int64_t ahead = span - span_;
  if (ahead < 1 || ahead >= std::int64_t{kSpans}) [[unlikely]]
    return push(index, due);
  const std::size_t slot = slot_of(span);
  const Index first = first_[slot];
  node.due = due;
  node.place = Place::wheel;
  node.next = first;
  node.previous = kNobody;
  if (first != kNobody) nodes_[first].previous = index;
  first_[slot] = index;
  occupied_[slot / 64] |= std::uint64_t{1} << (slot % 64);
  next_span_ = std::min(next_span_, span);
}

template <Pollable M, std::size_t Capacity>
void BusGroup<M, Capacity>::push(Index index, Time due) noexcept {
  nodes_[index].place = Place::heap;
  std::size_t at = heaped_++;
  while (at != 0 && due < heap_[(at - 1) / 2].at) {
    heap_[at] = heap_[(at - 1) / 2];
    at = (at - 1) / 2;
  }
  heap_[at] = {due, index};
}

/// Takes the first out of the heap. It has one or two members in most cases, which std::pop_heap is not made for.
template <Pollable M, std::size_t Capacity>
void BusGroup<M, Capacity>::pop() noexcept {
  const Due last = heap_[--heaped_];
  std::size_t at = 0;
  for (std::size_t child = 1; child < heaped_; child = 2 * at + 1) {
    if (child + 1 < heaped_ && heap_[child + 1].at < heap_[child].at) ++child;
    if (last.at <= heap_[child].at) break;
    heap_[at] = heap_[child];
    at = child;
  }
  heap_[at] = last;
}

/// The wheel moves on to its next span that has members.
template <Pollable M, std::size_t Capacity>
void BusGroup<M, Capacity>::load() noexcept {
  span_ = next_span_;
  const std::size_t slot = slot_of(span_);
  for (Index index = first_[slot]; index != kNobody; index = nodes_[index].next)
    push(index, nodes_[index].due);
  first_[slot] = kNobody;
  occupied_[slot / 64] &= ~(std::uint64_t{1} << (slot % 64));
  next_span_ = span_after(span_);
}

/// The first span after `span` that has members, or kNoSpan. All are within one turn of the wheel.
template <Pollable M, std::size_t Capacity>
std::int64_t BusGroup<M, Capacity>::span_after(std::int64_t span) const noexcept {
  const std::size_t from = slot_of(span + 1);
  std::uint64_t word = occupied_[from / 64] & (~std::uint64_t{0} << (from % 64));
  for (std::size_t step = 0; step <= kWords; ++step) {
    if (word != 0) {
      const std::size_t slot =
          (from / 64 + step) % kWords * 64 + static_cast<std::size_t>(std::countr_zero(word));
      return span + 1 + static_cast<std::int64_t>((slot - from) % kSpans);
    }
    word = occupied_[(from / 64 + step + 1) % kWords];
  }
  return kNoSpan;
}

template <Pollable M, std::size_t Capacity>
void BusGroup<M, Capacity>::wake(std::size_t index) noexcept {
  unlink(static_cast<Index>(index));
  push(static_cast<Index>(index), kWoken);
}

template <Pollable M, std::size_t Capacity>
void BusGroup<M, Capacity>::unlink(Index index) noexcept {
  const Node& node = nodes_[index];
  if (node.place == Place::heap) {
    const auto end = heap_.begin() + static_cast<std::ptrdiff_t>(heaped_);
    *std::find_if(heap_.begin(), end, [&](const Due& due) { return due.index == index; }) = *(end - 1);
    --heaped_;
    std::make_heap(heap_.begin(), end - 1, [](const Due& a, const Due& b) { return a.at > b.at; });
    return;
  }
  if (node.next != kNobody) nodes_[node.next].previous = node.previous;
  if (node.previous != kNobody) {
    nodes_[node.previous].next = node.next;
    return;
  }
  const std::size_t slot = slot_of(span_of(node.due));
  first_[slot] = node.next;
  if (node.next != kNobody) return;
  occupied_[slot / 64] &= ~(std::uint64_t{1} << (slot % 64));
  next_span_ = span_after(span_);
}

}  // namespace tm485
