// The simulated encoder: characters of requests in, replies out, with its own idea of the protocol.
//
// It is a judge of the stack under test, so it shares no table and no code with it. It answers as the
// specification says a device answers (sections 2 to 6), takes the position at one instant for single-turn
// and multi-turn, and asserts T1 on the start bits that it sees. It knows nothing of the line that carries
// its characters: `Line` and `Server` both drive it.
#pragma once

#include <array>
#include <cstdint>

#include "tm485/sim/burst.hpp"
#include "tm485/sim/eeprom_model.hpp"
#include "tm485/sim/motion_profile.hpp"
#include "tm485/sim/random.hpp"
#include "tm485/sim/t1_judge.hpp"
#include "tm485/time.hpp"

namespace tm485::sim {

enum class Flavour : std::uint8_t {
  tm485,     ///< SF bits 6 and 7 are always 0
  t_format,  ///< the ID3 reply after a bad request reports it: SF.6 CF parity, SF.7 delimiter (stop bit)
};

/// What kind of encoder it is. Fixed once the model is built.
struct EncoderConfig {
  Flavour flavour = Flavour::tm485;
  unsigned single_turn_bits = 17;  ///< 1..24
  std::uint8_t enid = 0x11;
  bool multi_turn = true;  ///< false: ABM is always 0
  bool battery = false;    ///< true: the turn count survives a power cycle
  /// Turn count at power-up and after an IDC run. With a battery it is the count of the shaft's revolution 0
  /// and survives a power cycle.
  std::int64_t start_turn = 1;
  std::uint8_t sf = 0;         ///< SF bits whose cause lasts: no reset clears them
  std::uint8_t almc = 0;       ///< ALMC bits whose cause lasts
  Time t2_min{2900};           ///< end of request to start of reply: uniform in t2_min..t2_max
  Time t2_max{3100};           ///< less than 4 s above t2_min
  Time latch_offset{0};        ///< position is taken this long after the end of the request's stop bit
  Time boot_time{0};           ///< deaf and silent for this long after power-up
  Time request_gap{12'000};    ///< a pause this long on the line ends a request
  Time reset_spacing{62'500};  ///< a reset run with a shorter interval starts anew
  Time zero_settle = std::chrono::milliseconds{100};  ///< ID8 takes effect this long after the tenth request
  std::uint64_t seed = 1;
  double standstill_rpm = 0.1;  ///< ID8 is refused while the shaft is faster
  EepromConfig eeprom = {};     ///< with a seed of its own
};

/// What the encoder took at the latch instant of its last request.
struct Latch {
  Time time = kNever;       ///< kNever: nothing was latched yet
  std::int64_t counts = 0;  ///< unwrapped position: (turns - start_turn) * 2^bits + abs
  std::int64_t turns = 0;   ///< the turn count before it wraps to 16 bits
  std::uint32_t abs = 0;    ///< single-turn position
  std::uint16_t abm = 0;    ///< the turn count as sent
};

struct EncoderStatistics {
  std::array<std::uint64_t, 16> requests{};  ///< good requests by data ID
  std::uint64_t replies = 0;
  std::uint64_t unknown_cf = 0;     ///< first byte is no CF of a defined ID (parity errors included)
  std::uint64_t bad_requests = 0;   ///< wrong CRC, cut short, or a character without a stop bit
  std::uint64_t deaf_requests = 0;  ///< began while the encoder itself was on the line
  std::uint64_t resets_done = 0;    ///< complete runs of ten, ID8 in standstill only
  std::uint64_t zero_refused = 0;   ///< complete runs of ID8 while the shaft moved
  std::uint64_t busy_reads = 0;     ///< EEPROM reads answered with ADF.7
  std::uint64_t busy_writes = 0;    ///< EEPROM writes answered with ADF.7 and not stored
  std::uint64_t busy_silences = 0;  ///< other requests not answered: EepromConfig::deaf_while_busy
  std::uint64_t power_ups = 0;
};

/// Whether a character may be held against the host in the T1 account.
enum class Judged : std::uint8_t { no, yes };

/// One owner, no locks; no function blocks or allocates; constant time. Instants never go back.
class EncoderModel {
 public:
  explicit EncoderModel(const EncoderConfig& config = {}, const MotionProfile& motion = {}) noexcept;

  /// A character on the line, from its start bit to the end of its stop bit. `framing_ok` false: the stop
  /// bit was missing. Returns true if it completed a request that is answered; `reply` is then the burst to
  /// put on the line (shorter if a power-off cuts it); otherwise its content means nothing.
  [[nodiscard]] bool on_character(std::uint8_t byte, Time start, Time end, bool framing_ok, Judged judged,
                                  Burst& reply) noexcept;

  /// True while a request is incomplete.
  [[nodiscard]] bool mid_request() const noexcept { return phase_ == Phase::collecting; }

  /// What the shaft does from now on.
  void set_motion(const MotionProfile& motion) noexcept { (stale_ ? unseen_motion_ : motion_) = motion; }

  /// Alarm bits whose cause lasts; replaces those of the configuration.
  void set_alarms(std::uint8_t sf, std::uint8_t almc) noexcept;

  /// The sensor delivers nothing new any more: from now on every position is that of the instant `since`, and the
  /// counting error (SF.4, ALMC.2) is latched; ID7 and IDC clear it only once sample_fresh() was called. An encoder that
  /// has not noticed it reports nothing.
  void sample_stale(Time since, bool noticed = true) noexcept;
  void sample_fresh() noexcept;

  /// Alarm bits that stay until an ID7 or IDC run or a power cycle clears them.
  void latch_alarms(std::uint8_t sf, std::uint8_t almc) noexcept;

  /// SF as it follows from ALMC: SF.4 = ALMC.2, SF.5 = any of the over-heat, multi-turn and battery bits.
  [[nodiscard]] static constexpr std::uint8_t sf_of(std::uint8_t almc) noexcept {
    return static_cast<std::uint8_t>(((almc & 0x04) != 0 ? 0x10 : 0) | ((almc & 0xF0) != 0 ? 0x20 : 0));
  }

  /// Cuts or restores the supply at `instant`, which must not be earlier than the last character nor than
  /// the last change announced. At most kPowerChanges may be waiting; returns false if one too many.
  bool power_off(Time instant) noexcept { return add_power_change(instant, false); }
  bool power_on(Time instant) noexcept { return add_power_change(instant, true); }
  static constexpr std::size_t kPowerChanges = 8;

  /// What happens by itself up to `now`, power changes above all, has then happened. Every character does the same up
  /// to its own end: needed only to look at the EEPROM after a power loss that nobody has asked since.
  void advance_to(Time now) noexcept {
    if (now >= next_change_) apply_changes(now);
  }

  /// Where the shaft really is at `at`, in the counts of Latch::counts: also while the sensor is stale. Of an instant
  /// before a power cycle or a reset it says what it would be by the counts of now.
  [[nodiscard]] std::int64_t shaft_counts(Time at) const noexcept {
    const std::int64_t shaft =
        (stale_ ? unseen_motion_ : motion_).counts(at, config_.single_turn_bits) - zero_offset_;
    return shaft + ((turn_base_ - config_.start_turn) << config_.single_turn_bits);
  }

  [[nodiscard]] const EncoderConfig& config() const noexcept { return config_; }
  [[nodiscard]] const Latch& last_latch() const noexcept { return latch_; }
  [[nodiscard]] const EncoderStatistics& statistics() const noexcept { return statistics_; }
  [[nodiscard]] const T1Judge& t1() const noexcept { return t1_; }
  [[nodiscard]] EepromModel& eeprom() noexcept { return eeprom_; }
  [[nodiscard]] const EepromModel& eeprom() const noexcept { return eeprom_; }

 private:
  enum class Phase : std::uint8_t {
    collecting,  // the CF is known, more characters belong to the request
    ignoring,    // answered or bad: everything up to the next gap is dropped
  };
  enum class Power : std::uint8_t { off, booting, on };
  struct PowerChange {
    Time at{0};
    bool on = false;
  };

  bool begin_request(std::uint8_t byte, Time start, Time end, bool framing_ok, Judged judged,
                     Burst& reply) noexcept;
  bool collect(std::uint8_t byte, Time end, bool framing_ok, Burst& reply) noexcept;
  bool answer(Time end, Burst& reply) noexcept;
  bool answer_eeprom(Time end, Burst& reply) noexcept;
  bool send(std::uint64_t front, std::uint64_t back, Time end, Burst& reply) noexcept;
  [[nodiscard]] bool only_eeprom_is_deaf(Time start) const noexcept;
  void take_position(Time end) noexcept;
  [[nodiscard]] bool shaft_moves(Time at) const noexcept;
  void note_reset(std::uint8_t id) noexcept;
  void clear_alarms() noexcept;
  void refuse_request(std::uint64_t& counter, std::uint8_t t_format_flag) noexcept;
  void cut_by_power_off(Burst& reply) noexcept;

  bool add_power_change(Time instant, bool on) noexcept;
  void apply_changes(Time now) noexcept;
  void power_up(Time at) noexcept;
  void schedule_changes() noexcept;

  EncoderConfig config_;
  MotionProfile motion_;
  std::int64_t t2_choices_;
  std::uint32_t abs_mask_;
  Random random_;

  // The request being received.
  Phase phase_ = Phase::ignoring;
  std::uint8_t kind_ = 0;  // row of the request table
  std::uint8_t received_ = 0;
  std::array<std::uint8_t, 4> request_{};
  Time request_start_{0};
  Time last_end_ = -kNever;
  Time character_time_{0};
  Time deaf_until_ = -kNever;  // for the own reply or, with deaf_while_busy, as long as the EEPROM is busy

  // The position.
  std::int64_t zero_offset_ = 0;  // shaft counts at which ABS is 0
  std::int64_t turn_base_ = 0;    // turn count while the shaft is in its turn 0
  Latch latch_;

  // Resets.
  std::uint8_t reset_id_ = 0xFF;
  std::uint8_t reset_count_ = 0;
  Time reset_start_{0};
  Time zero_at_ = kNever;         // when a pending ID8 takes effect
  std::int64_t zero_counts_ = 0;  // and by how much it moves the zero

  // Alarms: what lasts, what is latched, and the request errors that the next ID3 reports.
  std::uint8_t latched_sf_ = 0;
  std::uint8_t latched_almc_ = 0;
  std::uint8_t request_flags_ = 0;
  std::uint8_t sf_now_ = 0;
  std::uint8_t almc_now_ = 0;

  // Power.
  Power power_ = Power::off;
  Time boot_done_ = kNever;
  Time next_change_{0};  // nothing happens by itself before
  std::array<PowerChange, kPowerChanges> power_changes_{};
  std::size_t power_change_count_ = 0;

  T1Judge t1_;
  EncoderStatistics statistics_;

  // What few cycles need.
  Time speaking_until_ = -kNever;  // end of the last reply about the EEPROM
  bool stale_ = false;
  bool stale_noticed_ = false;
  MotionProfile unseen_motion_;  // the shaft's, while the sensor is stale
  EepromModel eeprom_;
};

}  // namespace tm485::sim
