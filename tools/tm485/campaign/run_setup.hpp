// RunSetup: one run of the campaign: encoder, cycle, movement and fault plan, all of it drawn from a seed and a number.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "tm485/protocol/control_field.hpp"
#include "tm485/sim/fault_plan.hpp"
#include "tm485/sim/motion_profile.hpp"
#include "tm485/sim/sim_options.hpp"
#include "tm485/time.hpp"

namespace tm485::cli::campaign {

/// A value; the same seed and run give the same one on every machine.
struct RunSetup {
  std::uint64_t seed = 1;
  std::uint64_t run = 0;
  std::string profile = "tm485_17";
  DataId id = DataId::everything;
  Time period{0};  ///< 0: the shortest possible
  Time start_jitter{0};
  bool eeprom = false;            ///< it is read in the background
  std::uint64_t cycles = 20'000;  ///< after so many it ends
  std::string motion;             ///< in the words of sim::parse_sim_options
  sim::MotionProfile shaft;
  sim::FaultPlan plan;  ///< each line with a seed of its own, so that it does the same without its neighbours

  /// Everything but the plan, on one line.
  [[nodiscard]] std::string text() const;
  /// What the simulated encoder is told.
  [[nodiscard]] sim::SimOptions sim_options() const;
};

/// Draws the run. With a `plan` its faults are these, otherwise they are drawn too. `cycles` of 0: the default.
[[nodiscard]] RunSetup draw_run(std::uint64_t seed, std::uint64_t run, std::uint64_t cycles,
                                const std::optional<sim::FaultPlan>& plan);

}  // namespace tm485::cli::campaign
