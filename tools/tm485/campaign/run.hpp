// One run of the campaign: a bus on the simulated port in virtual time, every cycle judged.
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

#include "campaign/eeprom_reader.hpp"
#include "campaign/judge.hpp"
#include "campaign/recorder.hpp"
#include "campaign/run_setup.hpp"
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

template <class Discipline = EepromDiscipline, class Wrap = AsItIs, class Adjust = AsItIs>
[[nodiscard]] RunResult run(const RunSetup& setup, const RunOptions& options = {}, const Wrap& wrap = {},
                            const Adjust& adjust = {}) {
  RunResult result;
  sim::SimulatedEncoder encoder(setup.sim_options());
  encoder.faults().keep_replies(true);
  Profile plain = find_profile(setup.profile).value_or(Profile{});
  const Time t1 = plain.t1[index_of(setup.id)];
  adjust(plain);
  const auto profile = CompiledProfile::compile(plain);
  BusConfig config;
  config.cycle = Cycle{setup.id, setup.period};
  auto&& port = wrap(encoder.port());
  std::optional<Bus<std::remove_cvref_t<decltype(port)>>> bus;
  if (profile) bus.emplace(port, *profile, config);
  Time now{0};
  // A late start moves a grid of the shortest period, so there a cycle takes as much longer.
  const Time cycle_time = std::max(setup.period, t1) + setup.start_jitter;
  Judge judge(setup, encoder, profile.value_or(*CompiledProfile::compile(Profile{})), cycle_time);
  if (!bus || !bus->start(now)) {
    (void)judge.fail(Rule::refused, now, 0, 0);
    result.violation = judge.violation();
    return result;
  }
  if (options.recorder != nullptr) options.recorder->begin(encoder);
  std::optional<EepromReader<Discipline>> reader;
  if (setup.eeprom) reader.emplace(*profile, encoder, setup.seed + setup.run);

  // All that lasts longer than its cycles: the encoder is off, or boots.
  const Time limit = cycle_time * static_cast<std::int64_t>(setup.cycles) * 2 + std::chrono::seconds(1);
  const std::uint64_t allocated = options.allocations == nullptr ? 0 : options.allocations();
  constexpr std::uint64_t kLookAtStop = 4'096;
  constexpr Time kLongestSleep = std::chrono::milliseconds(1);
  bool ok = true;
  for (std::uint64_t polls = 0; judge.totals().cycles < setup.cycles && now < limit; ++polls) {
    Time due = bus->poll(now);
    ok = judge.after_poll(*bus, now);
    if (reader && ok) [[unlikely]] {
      due = std::min(due, reader->drive(*bus, judge, now));
      ok = reader->ok();
    }
    if (options.recorder != nullptr) [[unlikely]]
      options.recorder->after_poll(*bus, encoder, judge.totals().cycles, now);
    if (!ok) [[unlikely]]
      break;
    if (options.stop != nullptr && polls % kLookAtStop == 0 &&
        options.stop->load(std::memory_order_relaxed)) {
      result.stopped = true;
      break;
    }
    Time next = due;
    if (bus->reply_expected() != kNever) {
      if (const Time event = encoder.line().next_event(); event > now) next = std::min(due, event);
    }
    // A reader may look at any time, and so does the judge: also at a bus that wants to be left alone for an hour.
    now = std::max(now, std::min(next, now + kLongestSleep));
  }
  if (ok && options.allocations != nullptr && options.allocations() != allocated)
    ok = judge.fail(Rule::heap, now, static_cast<std::int64_t>(options.allocations() - allocated), 0);
  ok = ok && judge.at_end(bus->statistics(), now);
  if (!ok) result.violation = judge.violation();
  result.totals = judge.totals();
  result.totals.runs = 1;
  return result;
}

}  // namespace tm485::cli::campaign
