// RunSetup: one run of the campaign: encoder, port, what is read how, movement and fault plan, all of it drawn from a seed
// and a number.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "campaign/dice.hpp"
#include "tm485/bus/pattern.hpp"
#include "tm485/motion/axis_config.hpp"
#include "tm485/motion/estimator_gains.hpp"
#include "tm485/protocol/control_field.hpp"
#include "tm485/sim/fault_plan.hpp"
#include "tm485/sim/motion_profile.hpp"
#include "tm485/sim/sim_options.hpp"
#include "tm485/time.hpp"

namespace tm485::cli::campaign {

/// What goes on between the cycles.
enum class Background : std::uint8_t {
  none,
  eeprom_reads,
  eeprom_writes,  ///< and reads
  resets,         ///< of errors, turns and zero
};

/// The servo clock that the cycle is locked to.
struct ServoDraw {
  ServoClock clock;
  std::int64_t drift_ppm = 0;  ///< by which its ticks are further apart than the nominal period
  Time tick_jitter{0};         ///< a tick is stamped up to so late
};

/// A value; the same seed and run give the same one on every machine.
struct RunSetup {
  std::uint64_t seed = 1;
  std::uint64_t run = 0;
  std::string profile = "tm485_17";
  /// What is read: of one ID, or of several if there is more than one step.
  Pattern pattern;
  Time start_jitter{0};
  /// Of a port that does not know when anything was on the line: it hands bytes over up to so late; 0: a port that knows.
  Time latency{0};
  bool axis = false;  ///< with a servo loop that reads, lets go and takes hold; otherwise a bus alone
  Continuity after_restart = Continuity::until_resumed;
  double bandwidth = 0;            ///< of the axis's estimator, as a part of the rate of positions; 0: none
  std::optional<ServoDraw> servo;  ///< likewise
  Background background = Background::none;
  std::uint16_t steal_every = 0;  ///< BusConfig::steal_every
  std::uint64_t cycles = 20'000;  ///< after so many it ends
  std::string motion;             ///< in the words of sim::parse_sim_options
  sim::MotionProfile shaft;
  sim::FaultPlan plan;  ///< each line with a seed of its own, so that it does the same without its neighbours

  /// Everything but the plan, on one line.
  [[nodiscard]] std::string text() const;
  /// The command that does the same run again.
  [[nodiscard]] std::string replay_command() const;
  /// What the simulated encoder is told.
  [[nodiscard]] sim::SimOptions sim_options() const;
  /// From one request of the cycle to the next, at most, without a fault.
  [[nodiscard]] Time cycle_time() const noexcept;
  /// No request can start so late that the next slot is lost to T1.
  [[nodiscard]] bool keeps_every_slot() const noexcept;
  /// From one position to the next, at most, likewise, if the background takes no slot.
  [[nodiscard]] Time position_time() const noexcept;
  /// For so many of them, with the slots that the background may take meanwhile.
  [[nodiscard]] Time time_of_positions(int positions) const noexcept;
  /// From one position to the next, on average.
  [[nodiscard]] Time position_period() const noexcept;
  /// Of the estimator, if there is one.
  [[nodiscard]] std::optional<EstimatorGains> gains() const;
  /// Writes to the EEPROM of this encoder keep everything else from the line.
  [[nodiscard]] bool writes_hold_the_line() const { return profile.starts_with("tm485"); }
};

/// Draws the run. With a `plan` its faults are these, otherwise they are drawn too. `cycles` of 0: the default.
[[nodiscard]] RunSetup draw_run(std::uint64_t seed, std::uint64_t run, std::uint64_t cycles,
                                const std::optional<sim::FaultPlan>& plan);

/// One line of a plan for a run of this length.
[[nodiscard]] sim::FaultLine draw_fault(Dice& dice, Time length);

}  // namespace tm485::cli::campaign
