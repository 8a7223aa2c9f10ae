// One run of the campaign: a bus, or an axis with its servo loop, on the simulated port in virtual time, every cycle judged.
//
// `Wrap` puts something between the bus and the port, and `adjust` changes the profile that the bus is told: so the tests
// aim the same run at builds that are broken on purpose, and with a Discipline that leaves something out. The command
// uses none of these.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <optional>
#include <type_traits>

#include "campaign/eeprom_tasks.hpp"
#include "campaign/judge.hpp"
#include "campaign/loop_reader.hpp"
#include "campaign/recorder.hpp"
#include "campaign/reset_tasks.hpp"
#include "campaign/run_setup.hpp"
#include "campaign/slow_port.hpp"
#include "tm485/bus/axis.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::cli::campaign {

struct RunResult {
  Totals totals;
  std::optional<Violation> violation;
  bool stopped = false;  ///< from outside
};

struct RunOptions {
  const std::atomic<bool>* stop = nullptr;
  Recorder* recorder = nullptr;              ///< sees the run; it is slower then
  std::uint64_t (*allocations)() = nullptr;  ///< of this thread, so far; none: not judged
};

struct AsItIs {
  sim::SimPort& operator()(sim::SimPort& port) const noexcept { return port; }
  void operator()(Profile&) const noexcept {}
};

template <Port P>
[[nodiscard]] Bus<P>& bus_of(Bus<P>& bus) noexcept {
  return bus;
}
template <Port P>
[[nodiscard]] Bus<P>& bus_of(Axis<P>& axis) noexcept {
  return axis.bus();
}

/// What a run has around its bus. After the constructor nothing allocates.
template <class Discipline>
struct Company {
  Company(const RunSetup& setup, sim::SimulatedEncoder& encoder, const CompiledProfile& profile,
          Time max_hold) {
    const std::uint64_t seed = setup.seed + setup.run;
    if (setup.axis) loop.emplace(setup, encoder, max_hold);
    switch (setup.background) {
      case Background::none:
        break;
      case Background::eeprom_reads:
      case Background::eeprom_writes:
        eeprom.emplace(profile, encoder, seed, setup.background == Background::eeprom_writes);
        break;
      case Background::resets:
        resets.emplace(setup, profile, encoder);
        break;
    }
  }

  /// After each poll. Answers when to poll and call again at the latest.
  template <class Stack>
  [[nodiscard]] Time drive(Stack& stack, Judge& judge, Time now, bool& ok) {
    Time due = kNever;
    if (eeprom) {
      due = eeprom->drive(bus_of(stack), judge, now);
      ok = ok && eeprom->ok();
    }
    if (resets) {
      due = resets->drive(bus_of(stack), judge, now);
      ok = ok && resets->ok();
    }
    if constexpr (requires { stack.client(); }) {
      // What is to be polled again at once has something to hand over yet.
      if (loop && ok && now >= loop->due() && due > now) ok = loop->on_tick(stack, judge, now);
      if (loop) due = std::min(due, loop->due());
    }
    return due;
  }
  [[nodiscard]] bool any() const noexcept { return eeprom || resets || loop; }

  std::optional<EepromTasks<Discipline>> eeprom;
  std::optional<ResetTasks> resets;
  std::optional<LoopReader> loop;
};

/// Polls a stack that has started until the run is over, or a rule is broken.
template <class Discipline, class Stack, class P>
[[nodiscard]] bool keep_polling(const RunSetup& setup, const RunOptions& options,
                                sim::SimulatedEncoder& encoder, Stack& stack, const P& port,
                                Company<Discipline>& company, Judge& judge, RunResult& result) {
  auto& bus = bus_of(stack);
  Time now{0};
  // All that lasts longer than its cycles: the encoder is off, or boots, or a write has the line.
  const Time limit =
      setup.cycle_time() * static_cast<std::int64_t>(setup.cycles) * 2 + std::chrono::seconds(1);
  const std::uint64_t allocated = options.allocations == nullptr ? 0 : options.allocations();
  constexpr std::uint64_t kLookAtStop = 4'096;
  constexpr Time kLongestSleep = std::chrono::milliseconds(1);
  const bool has_company = company.any();
  bool ok = true;
  for (std::uint64_t polls = 0; judge.totals().cycles < setup.cycles && now < limit; ++polls) {
    Time due = stack.poll(now);
    ok = judge.after_poll(bus, now);
    if (has_company && ok) due = std::min(due, company.drive(stack, judge, now, ok));
    if (options.recorder != nullptr) [[unlikely]]
      options.recorder->after_poll(bus, encoder, judge.totals().cycles, now);
    if (!ok) [[unlikely]]
      return false;
    if (options.stop != nullptr && polls % kLookAtStop == 0 &&
        options.stop->load(std::memory_order_relaxed)) {
      result.stopped = true;
      break;
    }
    Time next = due;
    if (bus.reply_expected() != kNever) {
      if (const Time event = encoder.line().next_event() + port.late(); event > now)
        next = std::min(due, event);
    }
    // A reader may look at any time, and so does the judge: also at a bus that wants to be left alone for an hour.
    now = std::max(now, std::min(next, now + kLongestSleep));
  }
  if (options.allocations != nullptr && options.allocations() != allocated)
    return judge.fail(Rule::heap, now, static_cast<std::int64_t>(options.allocations() - allocated), 0);
  if (!judge.at_end(bus.statistics(), now)) return false;
  if constexpr (requires { stack.client(); }) {
    stack.stop(now);
    return company.loop->at_end(stack, judge, now);
  }
  return true;
}

template <class Discipline = EepromDiscipline, class Wrap = AsItIs, class Adjust = AsItIs>
[[nodiscard]] RunResult run(const RunSetup& setup, const RunOptions& options = {}, const Wrap& wrap = {},
                            const Adjust& adjust = {}) {
  RunResult result;
  sim::SimulatedEncoder encoder(setup.sim_options());
  encoder.faults().keep_replies(true);
  Profile plain = find_profile(setup.profile).value_or(Profile{});
  adjust(plain);
  const auto compiled = CompiledProfile::compile(plain);
  const CompiledProfile profile = compiled.value_or(*CompiledProfile::compile(Profile{}));
  auto&& wrapped = wrap(encoder.port());
  SlowPort<std::remove_cvref_t<decltype(wrapped)>> port(wrapped, setup.latency, setup.seed + setup.run);
  AxisSetup what;
  what.bus.cycle = setup.pattern;
  what.bus.steal_every = setup.steal_every;
  what.bus.eeprom_may_hold = true;
  what.bus.axis.after_restart = setup.after_restart;
  if (setup.servo) what.bus.phase = Phase::locked_to(setup.servo->clock);
  const auto gains = setup.gains();
  what.gains = gains ? &*gains : nullptr;
  Judge judge(setup, encoder, profile);
  Company<Discipline> company(setup, encoder, profile, what.bus.max_hold);
  if (company.loop) what.on_invalid = {LoopReader::torque_off, &*company.loop};

  const auto play = [&](auto& stack) {
    if (!compiled || !stack.start(Time{0})) return judge.fail(Rule::refused, Time{0}, 0, 0);
    if (options.recorder != nullptr) options.recorder->begin(encoder);
    return keep_polling(setup, options, encoder, stack, port, company, judge, result);
  };
  bool ok = false;
  if (setup.axis) {
    Axis<decltype(port)> axis(port, profile, what);
    ok = play(axis);
  } else {
    Bus<decltype(port)> bus(port, profile, what.bus);
    ok = play(bus);
  }
  if (!ok) result.violation = judge.violation();
  result.totals = judge.totals();
  result.totals.runs = 1;
  result.totals.axis_runs = setup.axis ? 1 : 0;
  result.totals.mixed_runs = setup.pattern.size() > 1 ? 1 : 0;
  result.totals.slow_runs = setup.latency > Time{0} ? 1 : 0;
  return result;
}

}  // namespace tm485::cli::campaign
