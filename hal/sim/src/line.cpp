#include "tm485/sim/line.hpp"

#include <algorithm>
#include <cstring>

namespace tm485::sim {
namespace {

constexpr std::int64_t kBitsPerCharacter = 10;
constexpr std::int64_t kNsPerSecond = 1'000'000'000;

constexpr Time character_time_at(std::int64_t bits_per_second) noexcept {
  return Time{(kBitsPerCharacter * kNsPerSecond + bits_per_second / 2) / bits_per_second};
}

/// Copies a few bytes in moves of 8, 4, 2 and 1: a frame is too short for memcpy's bookkeeping.
void copy_bytes(std::uint8_t* to, const std::uint8_t* from, std::size_t count) noexcept {
  if (count == 1) {
    *to = *from;
    return;
  }
  for (; count >= 8; count -= 8, to += 8, from += 8) std::memcpy(to, from, 8);
  for (std::size_t move = 4; move != 0; move /= 2) {
    if ((count & move) == 0) continue;
    std::memcpy(to, from, move);
    to += move;
    from += move;
  }
}

}  // namespace

Line::Line(EncoderModel* encoder, const LineConfig& config) noexcept
    : encoder_{encoder},
      character_time_{character_time_at(config.bits_per_second)},
      echo_{config.echo},
      garbage_{config.seed} {}

bool Line::transmit(Talker talker, Time start, std::span<const std::uint8_t> bytes, Time driver_on,
                    Time driver_off) noexcept {
  if (bytes.size() > Burst::kCapacity) [[unlikely]] {
    return transmit_long(talker, start, bytes, driver_on, driver_off);
  }
  if (const Time end = start + character_time_ * static_cast<std::int64_t>(bytes.size()); end >= own_due_)
      [[unlikely]]
    add_own(end);
  Entry* entry = make_room();
  if (entry == nullptr) [[unlikely]]
    return false;
  Burst& burst = entry->burst;
  burst.start = start;
  burst.driver_on = driver_on;
  burst.driver_off = driver_off;
  burst.talker = talker;
  burst.count = static_cast<std::uint8_t>(bytes.size());
  burst.framing_errors = 0;
  copy_bytes(burst.bytes.data(), bytes.data(), bytes.size());
  commit(*entry);
  return true;
}

/// A long transmission becomes several bursts that join without a gap.
bool Line::transmit_long(Talker talker, Time start, std::span<const std::uint8_t> bytes, Time driver_on,
                         Time driver_off) noexcept {
  while (bytes.size() > Burst::kCapacity) {
    const Time end = start + character_time_ * static_cast<std::int64_t>(Burst::kCapacity);
    if (!transmit(talker, start, bytes.first(Burst::kCapacity), driver_on, end)) return false;
    bytes = bytes.subspan(Burst::kCapacity);
    start = end;
    driver_on = end;
  }
  return transmit(talker, start, bytes, driver_on, driver_off);
}

/// The next free entry, or null if kBursts bursts wait for their time. Frees the entries that nobody needs
/// any more: done, and their driver off for so long that no character still open can overlap it.
inline Line::Entry* Line::make_room() noexcept {
  while (tail_ != done_ && at(tail_).burst.driver_off + character_time_ <= processed_) ++tail_;
  if (tail_ == head_)
    tail_ = done_ = first_open_ = head_ = 0;  // the same entries again: they stay in the cache
  if (head_ - tail_ == kBursts) [[unlikely]] {
    if (!drop_oldest()) return nullptr;
  }
  return &at(head_);
}

bool Line::drop_oldest() noexcept {
  if (tail_ == first_open_) {
    ++statistics_.refused;
    return false;
  }
  if (tail_ == done_) {
    ++done_;
    ++statistics_.lost;
    lost_ = true;
  }
  ++tail_;
  return true;
}

inline void Line::commit(Entry& entry) noexcept {
  Burst& burst = entry.burst;
  bool altered = false;
  if (hook_ != nullptr) [[unlikely]] {
    altered = hook_->on_burst(burst);
    own_due_ = hook_->next_own();
  }
  if (distortion_ != nullptr) [[unlikely]] {
    distort(entry);
    return;
  }
  enter(entry, altered);
}

/// What the fault says by itself up to `until` joins the line; contention with what is there already follows from it.
void Line::add_own(Time until) noexcept {
  while (own_due_ <= until) {
    Entry* const entry = make_room();
    Burst& burst = entry != nullptr ? entry->burst : unheard_;
    const bool speaks = hook_->on_own(burst);
    own_due_ = hook_->next_own();
    if (speaks && entry != nullptr && burst.count != 0) enter(*entry, true);
  }
}

/// In turns, so that a talker who has spoken for long needs no more room than one who begins.
void Line::settle_with_own(Time until) noexcept {
  while (own_due_ <= until) {
    const Time due = own_due_;
    settle(due);
    add_own(due);
  }
}

/// Each listener hears the burst in its own way: the host's own echo and what the encoder hears become two entries.
void Line::distort(Entry& entry) noexcept {
  if (entry.burst.talker == Talker::encoder) {
    distortion_->encoder_at_host(entry.burst);
    enter(entry, true);
    return;
  }
  if (entry.burst.talker != Talker::host) {
    enter(entry, true);
    return;
  }
  const Burst sent = entry.burst;
  if (echo_) {
    distortion_->host_at_host(entry.burst);
    enter(entry, true);
    entry.unheard = true;
  }
  Entry* const at_encoder = echo_ ? make_room() : &entry;
  if (at_encoder == nullptr) return;
  at_encoder->burst = sent;
  distortion_->host_at_encoder(at_encoder->burst);
  enter(*at_encoder, true);
  at_encoder->audible = false;
}

inline void Line::enter(Entry& entry, bool altered) noexcept {
  Burst& burst = entry.burst;
  entry.end = burst.start + character_time_ * burst.count;
  entry.settled = 0;
  entry.taken = 0;
  entry.contended = false;
  entry.unheard = false;
  const bool from_host = burst.talker == Talker::host;
  entry.audible = !from_host || echo_;
  entry.judged = from_host && !altered ? Judged::yes : Judged::no;
  if (tail_ != head_) mark_contention(entry);
  ++head_;
  ++statistics_.bursts;
}

inline void Line::mark_contention(Entry& added) noexcept {
  for (std::uint32_t i = tail_; i != head_; ++i) {
    Entry& other = at(i);
    if (other.burst.talker != added.burst.talker && other.burst.driver_on < added.burst.driver_off &&
        added.burst.driver_on < other.burst.driver_off) [[unlikely]] {
      other.contended = true;
      added.contended = true;
    }
  }
}

inline void Line::skip_done() noexcept {
  while (done_ != first_open_) {
    const Entry& entry = at(done_);
    if (entry.audible && entry.taken < entry.burst.count) return;
    ++done_;
  }
}

void Line::settle(Time until) noexcept {
  while (first_open_ != head_) {
    Entry& first = at(first_open_);
    if (head_ - first_open_ != 1 || first.contended) [[unlikely]] {
      settle_among_others(until);
      break;
    }
    // Alone on the line, so there is no need to look at anyone else, until one of its characters is answered.
    if (first.end > until) {
      if (end_of(first, first.settled) > until) break;
      settle_character(first);
    } else if (first.burst.talker == Talker::encoder) {
      first.settled = first.burst.count;
      ++first_open_;
    } else {
      const std::uint32_t alone = head_;
      while (first.settled < first.burst.count && head_ == alone) settle_character(first);
      if (first.settled == first.burst.count) ++first_open_;
    }
  }
  skip_done();
}

/// Character by character in the order of time: several bursts are open, or one in part.
void Line::settle_among_others(Time until) noexcept {
  for (;;) {
    while (first_open_ != head_ && at(first_open_).settled == at(first_open_).burst.count) ++first_open_;
    Entry* earliest = nullptr;
    for (std::uint32_t i = first_open_; i != head_; ++i) {
      Entry& entry = at(i);
      if (entry.settled == entry.burst.count) continue;
      if (earliest == nullptr || end_of(entry, entry.settled) < end_of(*earliest, earliest->settled)) {
        earliest = &entry;
      }
    }
    if (earliest == nullptr || end_of(*earliest, earliest->settled) > until) return;
    settle_character(*earliest);
  }
}

/// The next character of `entry` has passed: everyone who listens has heard it.
inline void Line::settle_character(Entry& entry) noexcept {
  Burst& burst = entry.burst;
  const std::uint8_t k = entry.settled++;
  if (entry.contended) [[unlikely]]
    corrupt_if_overlapped(entry, k);
  if (burst.talker == Talker::encoder || encoder_ == nullptr || entry.unheard) return;

  Entry* room = make_room();
  const Time end = end_of(entry, k);
  const bool framing_ok = ((burst.framing_errors >> k) & 1u) == 0;
  const bool answered = encoder_->on_character(burst.bytes[k], end - character_time_, end, framing_ok,
                                               entry.judged, room != nullptr ? room->burst : unheard_);
  if (!answered || room == nullptr) return;
  commit(*room);
  if (own_due_ != kNever) [[unlikely]]
    add_own(room->end);
}

void Line::corrupt_if_overlapped(Entry& entry, std::uint8_t k) noexcept {
  Burst& burst = entry.burst;
  const Time end = end_of(entry, k);
  const Time start = end - character_time_;
  for (std::uint32_t i = tail_; i != head_; ++i) {
    const Burst& other = at(i).burst;
    if (other.talker == burst.talker || other.driver_on >= end || other.driver_off <= start) continue;
    burst.bytes[k] = static_cast<std::uint8_t>(burst.bytes[k] ^ (garbage_.next() | 1u));
    burst.framing_errors |= std::uint32_t{1} << k;
    ++statistics_.collisions;
    return;
  }
}

HostReception Line::host_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
  if (head_ - done_ == 1 && !lost_ && own_due_ > now) [[likely]] {
    // One burst that is whole, untouched and not disturbed: the way of nearly every reply. The host is the
    // only one who hears the encoder, so this settles it as well.
    const Entry& entry = at(done_);
    const Burst& burst = entry.burst;
    if (burst.talker == Talker::encoder && entry.end <= now && entry.taken == 0 && !entry.contended &&
        burst.count <= buffer.size()) [[likely]] {
      copy_bytes(buffer.data(), burst.bytes.data(), burst.count);
      processed_ = std::max(processed_, now);
      done_ = first_open_ = head_;
      return {.count = burst.count, .first_start = burst.start, .framing_error = burst.framing_errors != 0};
    }
  }
  advance_to(now);
  return receive_in_turn(buffer, now);
}

HostReception Line::receive_in_turn(std::span<std::uint8_t> buffer, Time now) noexcept {
  HostReception reception;
  reception.lost = lost_;
  lost_ = false;
  // The burst whose next character ended first, and until when it may be read before another has its turn.
  Entry* source = nullptr;
  Time source_end = kNever;
  Time limit = now;
  for (std::uint32_t i = done_; i != head_; ++i) {
    Entry& entry = at(i);
    if (!entry.audible || entry.taken == entry.settled) continue;
    const Time next_end = end_of(entry, entry.taken);
    if (next_end < source_end) {
      limit = std::min(limit, source_end);
      source_end = next_end;
      source = &entry;
    } else {
      limit = std::min(limit, next_end);
    }
  }
  if (source == nullptr || source_end > limit || buffer.empty()) return reception;

  const std::uint8_t first = source->taken;
  std::size_t count = 1;
  while (first + count < source->settled && count < buffer.size() &&
         end_of(*source, static_cast<std::uint8_t>(first + count)) <= limit) {
    ++count;
  }
  copy_bytes(buffer.data(), source->burst.bytes.data() + first, count);
  source->taken = static_cast<std::uint8_t>(first + count);
  const std::uint64_t run = ((std::uint64_t{1} << count) - 1) << first;
  reception.count = count;
  reception.first_start = source_end - character_time_;
  reception.framing_error = (source->burst.framing_errors & run) != 0;
  skip_done();
  return reception;
}

Time Line::next_event() noexcept {
  for (;;) {
    Time heard = kNever;    // by the host
    Time request = kNever;  // heard by the encoder only: a reply may follow
    for (std::uint32_t i = done_; i != head_; ++i) {
      const Entry& entry = at(i);
      if (!entry.audible) {
        if (entry.settled < entry.burst.count) request = std::min(request, entry.end);
      } else if (entry.taken < entry.burst.count) {
        heard = std::min(heard, entry.end);
      }
    }
    if (heard <= request || own_due_ <= request) return std::min(heard, own_due_);
    advance_to(request);
  }
}

}  // namespace tm485::sim
