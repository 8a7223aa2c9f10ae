#include "campaign/run_setup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "quantity.hpp"
#include "tm485/design/estimator_design.hpp"

namespace tm485::cli::campaign {
namespace {

using std::chrono::microseconds;

/// The encoder of every run boots as long as its profiles promise at least; a shorter silence would be no restart.
constexpr Time kBoot = std::chrono::milliseconds(55);

/// A servo clock moves the start of a pattern by less than this part of a slot, drift included.
constexpr std::int64_t kServoPull = 32;

/// T1 as section 4 of the specification has it.
constexpr Time kShortT1{40'000};
constexpr Time kLongT1{62'500};
constexpr Time t1_of(DataId id) { return id == DataId::everything ? kLongT1 : kShortT1; }
constexpr bool has_position(DataId id) { return id == DataId::everything || id == DataId::single_turn; }

constexpr std::uint8_t number_of(DataId id) {
  switch (id) {
    case DataId::single_turn:
      return 0;
    case DataId::multi_turn:
      return 1;
    case DataId::encoder_id:
      return 2;
    default:
      return 3;
  }
}

std::string draw_motion(Dice& dice) {
  const double start = std::round(dice.between(-5.0, 5.0) * 1e3) * 1e-3;
  const auto rpm = std::llround(dice.between(-5'500.0, 5'500.0));
  switch (dice.below(4)) {
    case 0:
      return fmt::format("motion=constant:{},start={}", rpm, start);
    case 1: {
      // Amplitude in turns: 2 pi f of it is the top speed, kept below 5000 rpm, and (2 pi f)^2 the top acceleration, kept
      // below nine tenths of the 10^6 rpm/s that the axis is told.
      const auto hz = std::llround(dice.between(1.0, 40.0));
      const auto f = static_cast<double>(hz);
      const double most = std::min(13.0 / f, 380.0 / (f * f));
      const double amplitude = std::round(dice.between(0.01, most) * 1e4) * 1e-4;
      return fmt::format("motion=sine:{}:{},start={}", amplitude, hz, start);
    }
    case 2:
      return fmt::format("motion=trapezoid:{}:{}:{},start={}", rpm, std::llround(dice.decade(3.0, 6.0)), 0.05,
                         start);
    default:
      return fmt::format("motion=constant:0,start={}", start);
  }
}

/// Several requests: positions in most slots, turns, ENID and all of the status now and then.
Pattern draw_mix(Dice& dice) {
  const Time slot = dice.once_in(2) ? kShortT1 : dice.span_us(microseconds(41), microseconds(90));
  const auto some = [&](std::int64_t most) { return static_cast<std::uint8_t>(1 + dice.below(most)); };
  switch (dice.below(4)) {
    case 0:
      return {slot, {{DataId::single_turn, 6}, {DataId::everything, 1, 2}}};
    case 1:
      return {slot,
              {{DataId::single_turn, some(8)},
               {DataId::multi_turn, 1},
               {DataId::everything, 1, static_cast<std::uint8_t>(2 + dice.below(2))},
               {DataId::encoder_id, 1}}};
    case 2:
      return {slot, {{DataId::single_turn, some(3)}, {DataId::multi_turn, 1}}};
    default:
      return {std::max(slot, kLongT1), {{DataId::everything, some(3)}, {DataId::single_turn, some(2)}}};
  }
}

void draw_pattern(Dice& dice, RunSetup& setup) {
  if (dice.once_in(5)) {
    setup.pattern = draw_mix(dice);
    return;
  }
  Cycle cycle{dice.once_in(3) ? DataId::single_turn : DataId::everything};
  if (dice.once_in(2)) cycle.period = dice.span_us(microseconds(63), microseconds(250));
  setup.pattern = cycle;
}

bool needs_unwrapping(const Pattern& pattern) {
  for (std::size_t k = 0; k < pattern.size(); ++k)
    if (pattern.step(k).id == DataId::single_turn) return true;
  return false;
}

/// What goes on between the cycles, with the room that it needs.
void draw_background(Dice& dice, RunSetup& setup) {
  if (!dice.once_in(3)) return;
  constexpr std::array kKinds{Background::eeprom_reads, Background::eeprom_writes, Background::resets};
  setup.background = kKinds[static_cast<std::size_t>(dice.below(kKinds.size()))];
  // A change of the page that keeps the line for 18 ms is refused where turns would be lost over it.
  if (setup.writes_hold_the_line() && needs_unwrapping(setup.pattern)) setup.background = Background::resets;
  // Either there are gaps, or slots are taken: one in so many.
  if (dice.once_in(2)) {
    setup.pattern.set_slot(dice.span_us(microseconds(120), microseconds(250)));
  } else {
    constexpr std::array<std::uint16_t, 3> kEvery{2, 4, 16};
    setup.steal_every = kEvery[static_cast<std::size_t>(dice.below(kEvery.size()))];
  }
}

/// A port without wire timestamps: the period leaves room for what it may be late by.
void draw_port(Dice& dice, RunSetup& setup) {
  if (dice.once_in(3)) setup.start_jitter = Time{dice.below(3'000)};
  if (!dice.once_in(5)) return;
  setup.latency = dice.span_us(microseconds(20), microseconds(150));
  setup.start_jitter = Time{dice.below(setup.latency.count() / 3)};
  setup.pattern.set_slot(kLongT1 + setup.latency + dice.span_us(microseconds(10), microseconds(150)));
}

/// The slot, or the shortest possible.
Time slot_of(const Pattern& pattern) {
  return pattern.slot() > Time{0} ? pattern.slot() : t1_of(pattern.step(0).id);
}

Time length_of(const Pattern& pattern) {
  std::int64_t slots = 0;
  for (std::size_t k = 0; k < pattern.size(); ++k) slots += pattern.step(k).slots;
  return slot_of(pattern) * slots;
}

Time length_of(const RunSetup& setup) {
  return length_of(setup.pattern) * static_cast<std::int64_t>(setup.cycles) /
         static_cast<std::int64_t>(setup.pattern.size());
}

/// A clock of the pattern's length, or of a few of them, or some of it in one pattern.
void draw_servo(Dice& dice, RunSetup& setup) {
  const Time length = length_of(setup.pattern);
  const std::int64_t times = 1 + dice.below(8);
  const bool slower = dice.once_in(2) || length.count() % times != 0 || length / times < microseconds(40);
  ServoDraw servo;
  servo.clock.period = slower ? length * times : length / times;
  // From the latch of the first step until its sample is there at the latest: T2 and the reply.
  const Time ready = t1_of(setup.pattern.step(0).id) - microseconds(5);
  servo.clock.lead = dice.span(ready, std::max(length, servo.clock.period));
  servo.drift_ppm = dice.below(801) - 400;
  if (dice.once_in(2)) servo.tick_jitter = Time{dice.below(2'000)};
  setup.servo = servo;
}

}  // namespace

Time RunSetup::cycle_time() const noexcept {
  Time longest{0};
  for (std::size_t k = 0; k < pattern.size(); ++k) {
    const Pattern::Step& step = pattern.step(k);
    // A late start moves a grid of the shortest period, so there a cycle takes as much longer.
    longest = std::max({longest, slot_of(pattern) * step.slots, t1_of(step.id)});
  }
  // A port that hands a reply over late gets as much time again before it is asked anew.
  return longest + start_jitter + latency * 2 + (servo ? longest / kServoPull : Time{0});
}

bool RunSetup::keeps_every_slot() const noexcept {
  for (std::size_t k = 0; k < pattern.size(); ++k) {
    const Pattern::Step& step = pattern.step(k);
    const Time slots = slot_of(pattern) * step.slots;
    // The servo clock pulls at them.
    const Time pulled = servo ? slots / kServoPull : Time{0};
    if (slots < t1_of(step.id) + start_jitter + pulled) return false;
  }
  return true;
}

Time RunSetup::position_time() const noexcept {
  std::int64_t most = 1;
  std::int64_t between = 0;
  for (std::size_t k = 0; k < 2 * pattern.size(); ++k) {
    if (has_position(pattern.step(k % pattern.size()).id)) between = 0;
    most = std::max(most, ++between);
  }
  // The slots of a pattern, and those of a servo clock, stay where they are: behind a late start the next one may be lost.
  if ((pattern.size() > 1 || servo) && !keeps_every_slot()) most *= 2;
  return cycle_time() * most;
}

Time RunSetup::time_of_positions(int positions) const noexcept {
  const Time undisturbed = position_time() * positions;
  if (steal_every == 0) return undisturbed;
  // Each that it takes is followed by at least so many that it leaves; one may go before the first, and of a pattern that
  // is not to be moved two. With a servo clock its step falls out, otherwise all of them are put off.
  const std::int64_t first = pattern.size() > 1 || servo ? 2 : 1;
  const std::int64_t taken = undisturbed / cycle_time() / (steal_every - 1) + first;
  return undisturbed + (servo ? position_time() : cycle_time()) * taken;
}

std::string RunSetup::replay_command() const {
  std::string lines;
  for (const sim::FaultLine& line : plan.lines())
    lines += (lines.empty() ? "" : "; ") + sim::FaultPlan::to_text(line);
  return fmt::format("tm485 campaign --replay {}:{} --cycles {} --plan '{}'", seed, run, cycles,
                     lines.empty() ? "#" : lines);
}

std::string RunSetup::text() const {
  std::string reads;
  for (std::size_t k = 0; k < pattern.size(); ++k) {
    const Pattern::Step& step = pattern.step(k);
    reads += fmt::format("{}ID{}{}", k == 0 ? "" : " ", number_of(step.id),
                         step.slots > 1 ? fmt::format("/{}", step.slots) : "");
  }
  std::string text = fmt::format("profile={}, {}, period {}, start jitter {}, {}", profile, reads,
                                 format_time(slot_of(pattern)), format_time(start_jitter), motion);
  if (latency > Time{0}) text += fmt::format(", a port without timestamps, {} late", format_time(latency));
  if (axis) {
    constexpr std::array<const char*, 3> kPolicies{"until resumed", "until homed", "re-reference"};
    text += fmt::format(", servo loop, {}", kPolicies[static_cast<std::size_t>(after_restart)]);
  }
  if (bandwidth != 0.0) text += ", estimator";
  if (servo)
    text += fmt::format(", servo clock {} {:+} ppm jitter {} lead {}", format_time(servo->clock.period),
                        servo->drift_ppm, format_time(servo->tick_jitter), format_time(servo->clock.lead));
  constexpr std::array<const char*, 4> kBackground{"", ", EEPROM reads", ", EEPROM writes", ", resets"};
  text += kBackground[static_cast<std::size_t>(background)];
  if (steal_every != 0) text += fmt::format(", one slot in {} taken", steal_every);
  return text + fmt::format(", {} cycles", cycles);
}

sim::SimOptions RunSetup::sim_options() const {
  // Both were drawn here or come from a parsed plan, so the text is good.
  sim::SimOptions options =
      sim::parse_sim_options(fmt::format("profile={},{},seed={}", profile, motion, seed + run))
          .value_or(sim::SimOptions{});
  options.encoder.boot_time = kBoot;
  options.port.start_jitter = start_jitter;
  options.port.jitter_margin = start_jitter;
  options.faults = plan;
  return options;
}

Time RunSetup::position_period() const noexcept {
  std::int64_t positions = 0;
  for (std::size_t k = 0; k < pattern.size(); ++k) positions += has_position(pattern.step(k).id) ? 1 : 0;
  return length_of(pattern) / std::max<std::int64_t>(positions, 1);
}

std::optional<EstimatorGains> RunSetup::gains() const {
  if (bandwidth == 0.0) return std::nullopt;
  const Time period = position_period();
  const auto design = design::solve_for_bandwidth({.order = 3, .period = period},
                                                  bandwidth * 1e9 / static_cast<double>(period.count()));
  return design ? std::optional(design->gains) : std::nullopt;
}

RunSetup draw_run(std::uint64_t seed, std::uint64_t run, std::uint64_t cycles,
                  const std::optional<sim::FaultPlan>& plan) {
  Dice dice(seed * 0x9E3779B97F4A7C15u + run);
  RunSetup setup;
  setup.seed = seed;
  setup.run = run;
  if (cycles != 0) setup.cycles = cycles;
  constexpr std::array<const char*, 5> kProfiles{"tm485_17", "tm485_23", "tformat_17", "tformat_23",
                                                 "tformat_17_battery"};
  setup.profile = kProfiles[static_cast<std::size_t>(dice.below(kProfiles.size()))];
  draw_pattern(dice, setup);
  draw_background(dice, setup);
  draw_port(dice, setup);
  setup.axis = dice.once_in(4);
  if (setup.axis) {
    setup.after_restart = static_cast<Continuity>(dice.below(3));
    setup.bandwidth = dice.once_in(2) ? 1.0 / 8.0 : 0.0;
    if (dice.once_in(3)) draw_servo(dice, setup);
  }
  setup.motion = draw_motion(dice);
  setup.shaft = setup.sim_options().motion;
  const Time length = length_of(setup);
  if (plan) {
    for (sim::FaultLine line : plan->lines()) {
      const std::uint64_t own = dice.seed();
      if (!line.seed) line.seed = own;
      (void)setup.plan.add(line);
    }
  } else {
    for (auto faults = dice.below(5); faults > 0; --faults) (void)setup.plan.add(draw_fault(dice, length));
  }
  return setup;
}

}  // namespace tm485::cli::campaign
