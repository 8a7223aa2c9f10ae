// A half-duplex RS-485 line in character time, with its encoder. Specification: section 1.
//
// Talkers put gapless bursts on it; a character whose time overlaps the driver interval of another talker is
// corrupted for everyone who hears it, so a driver released late or two talkers at once do what they do on a
// real wire. Nothing happens by itself: a burst is worked off, in the order of time, when somebody asks. A
// burst costs a few tens of nanoseconds, however many characters it has.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "tm485/sim/distortion.hpp"
#include "tm485/sim/encoder_model.hpp"
#include "tm485/sim/fault_hook.hpp"
#include "tm485/sim/random.hpp"
#include "tm485/time.hpp"

namespace tm485::sim {

struct LineConfig {
  std::int64_t bits_per_second = 2'500'000;  ///< 1..10^9; a character is 10 bits, rounded to whole ns
  std::int64_t encoder_bits_per_second = 0;  ///< 0: the same; another one needs a Distortion to be felt
  bool echo = false;                         ///< the host hears its own characters
  std::uint64_t seed = 1;                    ///< of the garbage that a collision makes
};

/// What the host's receiver has for it.
struct HostReception {
  std::size_t count = 0;       ///< bytes written
  Time first_start{0};         ///< start bit of the first of them
  bool framing_error = false;  ///< one of them had no stop bit
  bool lost = false;           ///< characters were lost since the last call: nobody took them in time
};

struct LineStatistics {
  std::uint64_t bursts = 0;
  std::uint64_t collisions = 0;  ///< characters corrupted by another talker's driver
  std::uint64_t refused = 0;     ///< bursts not taken: too many were waiting for their time
  std::uint64_t lost = 0;        ///< bursts that the host did not take in time
};

/// One owner, no locks; no function blocks or allocates. Instants passed to `advance_to` and `host_receive`
/// need not rise, but what has been processed stays processed.
class Line {
 public:
  /// `encoder` (may be null) must outlive the line. It hears every talker but itself.
  explicit Line(EncoderModel* encoder, const LineConfig& config = {}) noexcept;

  /// Puts `bytes` on the line: the first start bit at `start`, the driver enabled from `driver_on` to
  /// `driver_off`. An interval that reaches back before the instant processed so far corrupts only what has
  /// not been heard yet. Returns false, and sends nothing more, if more than kBursts bursts wait.
  bool transmit(Talker talker, Time start, std::span<const std::uint8_t> bytes, Time driver_on,
                Time driver_off) noexcept;

  /// Works off every character that ends by `now`; the encoder's replies join the line.
  void advance_to(Time now) noexcept {
    if (now > processed_) processed_ = now;
    if (now >= own_due_) [[unlikely]]
      settle_with_own(now);
    if (first_open_ != head_) settle(processed_);
  }

  /// Takes characters whose stop bit ended by `now`: at most `buffer.size()` of one burst, so the bytes of
  /// one call are gapless and `first_start` speaks for all of them. Call again for the next burst.
  HostReception host_receive(std::span<std::uint8_t> buffer, Time now) noexcept;

  /// When the host can next hear something whole: the end of the burst under way, or of the reply to the
  /// request under way; when a fault next speaks by itself; an instant in the past if characters wait to be taken; kNever
  /// if nothing is coming.
  /// To know that, it works off the request under way to its end: put any disturbance that overlaps the
  /// request on the line before this call.
  [[nodiscard]] Time next_event() noexcept;

  /// Sets the fault that sees every burst from now on; null for none. It must outlive its use.
  void set_fault_hook(FaultHook* hook) noexcept {
    hook_ = hook;
    own_due_ = hook == nullptr ? kNever : hook->next_own();
  }

  /// Sets what the receivers make of every burst from now on, after the fault hook; null: they hear what was sent. It
  /// must outlive its use.
  void set_distortion(Distortion* distortion) noexcept { distortion_ = distortion; }

  void set_echo(bool echo) noexcept { echo_ = echo; }

  /// The host's receiver has lost something: its next reception says so.
  void overrun_host() noexcept { lost_ = true; }

  [[nodiscard]] bool echo() const noexcept { return echo_; }
  [[nodiscard]] Time character_time() const noexcept { return character_time_; }
  [[nodiscard]] const LineStatistics& statistics() const noexcept { return statistics_; }

  static constexpr std::uint32_t kBursts = 32;

 private:
  struct alignas(64) Entry {
    Burst burst;
    Time end{0};               // end of its last stop bit
    std::uint8_t settled = 0;  // characters whose time has passed
    std::uint8_t taken = 0;    // characters that the host has fetched
    bool audible = false;      // to the host
    bool unheard = false;      // by the encoder
    bool contended = false;    // its driver interval meets another talker's
    Judged judged = Judged::no;
  };

  [[nodiscard]] Entry& at(std::uint32_t index) noexcept { return ring_[index % kBursts]; }
  [[nodiscard]] Time end_of(const Entry& entry, std::uint8_t k) const noexcept {
    return entry.burst.start + character_time_ * (k + 1);
  }

  Entry* make_room() noexcept;
  bool drop_oldest() noexcept;
  void commit(Entry& entry) noexcept;
  void enter(Entry& entry, bool altered) noexcept;
  void add_own(Time until) noexcept;
  void settle_with_own(Time until) noexcept;
  void distort(Entry& entry) noexcept;
  void mark_contention(Entry& added) noexcept;
  void skip_done() noexcept;
  void settle(Time until) noexcept;
  void settle_among_others(Time until) noexcept;
  void settle_character(Entry& entry) noexcept;
  bool transmit_long(Talker talker, Time start, std::span<const std::uint8_t> bytes, Time driver_on,
                     Time driver_off) noexcept;
  HostReception receive_in_turn(std::span<std::uint8_t> buffer, Time now) noexcept;
  void corrupt_if_overlapped(Entry& entry, std::uint8_t k) noexcept;

  EncoderModel* encoder_;
  FaultHook* hook_ = nullptr;
  Distortion* distortion_ = nullptr;
  Time own_due_ = kNever;  // FaultHook::next_own
  Time character_time_;
  Time processed_ = -kNever;
  bool echo_;
  bool lost_ = false;
  // Ring indices, tail_ <= done_ <= first_open_ <= head_: entries before first_open_ are settled, those before
  // done_ have also been fetched by the host if it hears them, those before tail_ are free.
  std::uint32_t tail_ = 0;
  std::uint32_t done_ = 0;
  std::uint32_t first_open_ = 0;
  std::uint32_t head_ = 0;
  Random garbage_;
  LineStatistics statistics_;
  Burst unheard_{};  // where a reply goes that the line has no room for
  std::array<Entry, kBursts> ring_;
};

}  // namespace tm485::sim
