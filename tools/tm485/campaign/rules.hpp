// What the campaign judges, by which bounds, and what it counts.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "tm485/time.hpp"

namespace tm485::cli::campaign {

/// The bounds. A cycle is RunSetup::cycle_time().
/// A sample of an encoder that is gone is called fresh no longer.
inline constexpr int kCyclesUntilLoss = 3;
/// From the last effect of a fault to a fresh sample, without a start-up; of a pattern that reads no position in some
/// slots, so many positions.
inline constexpr int kCyclesUntilFresh = 4;
/// The same through a start-up, or from the end of the boot time.
inline constexpr int kCyclesAfterStartup = 20;
inline constexpr std::int64_t kQuantisation = 1;  ///< counts
/// A wrong position is dangerous from here on: 0.18 degrees.
inline constexpr std::int64_t kDangerousOfTurn = 2'000;

enum class Rule : std::uint8_t {
  position,          ///< a fresh sample is where the shaft was, or within the half-width stated with it
  broken_frame,      ///< no frame that is broken by its length, CF or CRC becomes a fresh sample
  stale,             ///< a fresh sample was latched in its own cycle
  failed_and_fresh,  ///< a failed cycle shows no fresh sample, a good one does
  turns,             ///< turns that come without a position are the encoder's
  loss,              ///< loss is found within kCyclesUntilLoss
  recovery,          ///< fresh again within the bounds after the last effect of a fault
  t1,                ///< T1 holds by the model's count
  statistics,        ///< what the bus counts is what was seen
  eeprom,            ///< what a background task has read, or says to have written, is what the EEPROM holds
  restart,  ///< behind a power-up of the encoder nothing is fresh before a start-up, or referenced unasked
  reset,    ///< a run of resets that was verified is done, and none that nobody has asked for
  axis,     ///< what a servo loop is told, and that it stays told to let go
  command,  ///< each command of a loop ends once, and with its own reply
  heap,     ///< nothing is allocated in the cycles
  refused,  ///< the cycle can be started at all
};
[[nodiscard]] constexpr std::string_view name(Rule rule) noexcept {
  constexpr std::array<std::string_view, 16> kNames{
      "position", "broken_frame", "stale",      "failed_and_fresh", "turns",   "loss",
      "recovery", "t1",           "statistics", "eeprom",           "restart", "reset",
      "axis",     "command",      "heap",       "refused"};
  return kNames[static_cast<std::size_t>(rule)];
}

struct Violation {
  Rule rule = Rule::position;
  std::uint64_t cycle = 0;
  Time time{0};
  std::int64_t seen = 0;     ///< counts, ns or a number, by the rule
  std::int64_t allowed = 0;  ///< likewise
  std::string_view what;     ///< of rules with more than one way to be broken
};

/// What was before a sample was fresh again.
enum class Recovery : std::uint8_t {
  plain,    ///< faults
  step,     ///< likewise, and the last fresh sample was wrong or of a sensor that stood still
  startup,  ///< a start-up
};
inline constexpr std::size_t kRecoveries = 3;

/// What was seen, good and bad.
struct Totals {
  std::uint64_t runs = 0;
  std::uint64_t axis_runs = 0;   ///< of them with a servo loop
  std::uint64_t mixed_runs = 0;  ///< with a pattern of several requests
  std::uint64_t slow_runs = 0;   ///< on a port without wire timestamps
  std::uint64_t cycles = 0;
  std::uint64_t good = 0;
  std::uint64_t failed = 0;
  std::uint64_t startups = 0;
  std::uint64_t restarts = 0;
  std::uint64_t touched = 0;            ///< cycles in which a fault had an effect
  std::uint64_t changed = 0;            ///< those in which bits were changed
  std::uint64_t changed_and_fresh = 0;  ///< and whose reply became a fresh sample
  std::uint64_t wrong = 0;              ///< of these: a wrong position
  std::uint64_t dangerous = 0;          ///< of these: by more than 0.18 degrees
  std::uint64_t frozen_and_wrong = 0;   ///< fresh, but the sensor stood still
  /// Beyond the half-width stated, where nothing can be told: see Judge::on_position().
  std::uint64_t beyond = 0;
  /// Fresh, whole turns off: read without turns (ID0), after a step of which no host can tell the direction, or after a
  /// sensor that stood still for half a turn.
  std::uint64_t lost_turns = 0;
  std::uint64_t eeprom_reads = 0;        ///< background tasks
  std::uint64_t eeprom_writes = 0;       ///< likewise
  std::uint64_t eeprom_judged = 0;       ///< of both those of whose exchanges no bit was changed
  std::uint64_t resets = 0;              ///< runs of resets
  std::uint64_t resets_verified = 0;     ///< of them
  std::uint64_t loop_reads = 0;          ///< by servo loops
  std::uint64_t let_go = 0;              ///< times that one was told to
  std::uint64_t resumed = 0;             ///< times that one took hold again
  std::uint64_t commands = 0;            ///< of servo loops
  std::uint64_t estimates = 0;           ///< that were held against the shaft
  std::uint64_t phases = 0;              ///< samples that were held against a servo clock
  Time longest_loss{0};                  ///< the oldest sample that was called fresh
  std::int64_t longest_loss_cycles = 0;  ///< the same in hundredths of its run's cycle
  /// How many samples were fresh again after so many cycles, rounded up; the last one: more. Positions instead of cycles
  /// where the pattern reads some.
  static constexpr std::size_t kRecoveryBins = 24;
  std::array<std::array<std::uint64_t, kRecoveryBins>, kRecoveries> recovered{};
  std::array<std::int64_t, kRecoveries> longest_recovery{};  ///< in hundredths of a cycle
  Time longest_startup{0};  ///< from the last effect to the fresh sample, through a start-up
  Time smallest_t1_margin = kNever;

  void add(const Totals& other) noexcept;
};

}  // namespace tm485::cli::campaign
