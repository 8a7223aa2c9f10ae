// A run of the campaign that reads turns without a position (ID1) in most slots, on a noisy line.
#pragma once

#include <cstdint>

#include "campaign/run_setup.hpp"
#include "support/print.hpp"

namespace tm485::test {

inline cli::campaign::RunSetup mostly_turns(std::uint64_t run) {
  cli::campaign::RunSetup setup =
      cli::campaign::draw_run(485, run, 20'000, *sim::FaultPlan::parse("bits replies=1e-3"));
  setup.pattern = Pattern(us(63), {{DataId::single_turn, 1}, {DataId::multi_turn, 8}});
  setup.background = cli::campaign::Background::none;
  setup.steal_every = 0;
  setup.axis = false;
  setup.servo.reset();
  return setup;
}

}  // namespace tm485::test
