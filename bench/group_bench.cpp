// Many simulated buses from one context: what one slot costs, and how many buses fit into one core's time.
//
// A slot is one request and one reply of one bus: group, bus, port, line and encoder model, in virtual time. Groups
// of n and of one take turns in short stretches, so that `ratio` compares what the machine did in the same moments;
// every figure is a median over the stretches.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <vector>

#include "tm485/bus/bus.hpp"
#include "tm485/bus/bus_group.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::bench {
namespace {

constexpr std::size_t kMost = 512;
constexpr Time kPeriod{62'500};

const CompiledProfile& profile(std::size_t i) {
  static const CompiledProfile kProfiles[] = {*CompiledProfile::compile(*find_profile("tm485_17")),
                                              *CompiledProfile::compile(*find_profile("tm485_23"))};
  return kProfiles[i % 2];
}

/// Every bus has another profile, phase, speed, seed and rate of bit errors than its neighbour.
sim::SimOptions encoder_options(std::size_t i) {
  sim::SimOptions options;
  options.encoder.single_turn_bits = profile(i).profile().single_turn_bits;
  options.encoder.enid = i % 2 == 0 ? 0x11 : 0x17;
  options.encoder.seed = i + 1;
  options.motion = sim::MotionProfile::constant(static_cast<double>(i % 60) * 100 - 3'000, 0.1);
  options.reply_bit_errors = 1e-7 * static_cast<double>(1 + i % 8);
  options.request_bit_errors = options.reply_bit_errors;
  options.seed = 1'000 + i;
  return options;
}

BusConfig bus_config(std::size_t i, std::size_t n) {
  BusConfig config;
  config.cycle = Cycle{DataId::everything, kPeriod};
  config.phase = Phase::at(stagger(i, n, kPeriod));
  return config;
}

/// The simulated line knows when a reply is complete, as a port that raises an interrupt does.
class TellingMember {
 public:
  TellingMember(std::size_t i, std::size_t n)
      : encoder_(encoder_options(i)), bus_(encoder_.port(), profile(i), bus_config(i, n)) {}

  Time poll(Time now) noexcept {
    const Time due = bus_.poll(now);
    const Time event = encoder_.line().next_event();
    return event > now ? std::min(due, event) : due;
  }
  Bus<sim::SimPort>& bus() noexcept { return bus_; }
  const Bus<sim::SimPort>& bus() const noexcept { return bus_; }
  std::uint64_t t1_violations() { return encoder_.model().t1().violations(); }

 private:
  sim::SimulatedEncoder encoder_;
  Bus<sim::SimPort> bus_;
};

/// Nobody tells: the group looks again and again.
class SilentMember : public TellingMember {
 public:
  using TellingMember::TellingMember;
  Time poll(Time now) noexcept { return bus().poll(now); }
  Time reply_expected() const noexcept { return bus().reply_expected(); }
};

template <class M>
class World {
 public:
  World(std::size_t n, const GroupConfig& config) : group_(std::make_unique<BusGroup<M, kMost>>(config)) {
    for (std::size_t i = 0; i < n; ++i) {
      M& member = members_.emplace_back(i, n);
      ready_ = member.bus().start(Time{0}).has_value() && group_->add(member).has_value() && ready_;
    }
    run_until(std::chrono::seconds(1));
    for (M& member : members_) ready_ = ready_ && member.bus().state() == BusState::running;
  }

  void run_until(Time end) {
    while (now_ < end) now_ = std::max(now_, group_->poll(now_));
  }
  /// ns for each slot.
  double stretch(Time span) {
    const auto slots = static_cast<double>(span / kPeriod) * static_cast<double>(members_.size());
    const Time end = now_ + span;
    const auto begin = std::chrono::steady_clock::now();
    run_until(end);
    const std::chrono::duration<double, std::nano> taken = std::chrono::steady_clock::now() - begin;
    return taken.count() / slots;
  }

  bool ready() const { return ready_; }
  std::uint64_t cycles() {
    std::uint64_t sum = 0;
    for (M& member : members_) sum += member.bus().statistics().cycles;
    return sum;
  }
  std::uint64_t missed() {
    std::uint64_t sum = 0;
    for (M& member : members_) sum += member.bus().statistics().skipped + member.t1_violations();
    return sum;
  }
  std::uint64_t failed() {
    std::uint64_t sum = 0;
    for (M& member : members_) sum += member.bus().statistics().failed;
    return sum;
  }

 private:
  std::deque<M> members_;
  std::unique_ptr<BusGroup<M, kMost>> group_;
  Time now_{0};
  bool ready_ = true;
};

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

template <class M>
void group_slots(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0));
  World<M> one(1, {});
  World<M> many(n, {});
  if (!one.ready() || !many.ready()) return state.SkipWithError("a bus did not start");
  const Time span = kPeriod * static_cast<std::int64_t>(std::max<std::size_t>(4, 4096 / n));
  const Time span_of_one = kPeriod * 4096;
  std::vector<double> of_one;
  std::vector<double> of_many;
  std::vector<double> ratios;
  for (auto _ : state) {
    of_one.push_back(one.stretch(span_of_one));
    of_many.push_back(many.stretch(span));
    ratios.push_back(of_many.back() / of_one.back());
    state.SetIterationTime(of_many.back() * 1e-9);
  }
  if (many.missed() != 0) state.SkipWithError("a slot was missed or T1 undercut");
  const double slot = median(of_many);
  state.counters["slot_ns"] = slot;
  state.counters["slot_ns_of_one"] = median(of_one);
  state.counters["ratio"] = median(ratios);
  state.counters["buses_a_core"] = static_cast<double>(kPeriod.count()) / slot;
  state.counters["failed_ppm"] =
      1e6 * static_cast<double>(many.failed()) / static_cast<double>(many.cycles());
}
/// Two polls a slot, as a bus wants them, and nothing else: what is left is the group's own cost.
class Ticker {
 public:
  Ticker(std::size_t i, std::size_t n) : slot_(stagger(i, n, kPeriod)), random_(i) {}

  Time poll(Time) noexcept {
    const Time reply = slot_ + Time{50'900 + random_.below(200)};
    waiting_ = !waiting_;
    slot_ += kPeriod * (waiting_ ? 0 : 1);  // no branch: what comes next of so many is anyone's guess
    return waiting_ ? reply : slot_;
  }

 private:
  Time slot_;
  sim::Random random_;
  bool waiting_ = false;
};

void BM_GroupAlone(benchmark::State& state) {
  const auto n = static_cast<std::size_t>(state.range(0));
  std::deque<Ticker> members;
  const auto group = std::make_unique<BusGroup<Ticker, kMost>>();
  for (std::size_t i = 0; i < n; ++i) {
    if (!group->add(members.emplace_back(i, n))) return state.SkipWithError("the group is full");
  }
  Time now{0};
  for (auto _ : state) {
    const Time end = now + kPeriod;
    while (now < end) now = std::max(now, group->poll(now));
  }
  state.counters["slot"] = benchmark::Counter(
      static_cast<double>(n), benchmark::Counter::kIsIterationInvariantRate | benchmark::Counter::kInvert);
}

void BM_GroupSlot(benchmark::State& state) { group_slots<TellingMember>(state); }
void BM_GroupSlotPolledPort(benchmark::State& state) { group_slots<SilentMember>(state); }
BENCHMARK(BM_GroupAlone)->Arg(1)->Arg(2)->Arg(8)->Arg(32)->Arg(128)->Arg(512);
BENCHMARK(BM_GroupSlot)
    ->Arg(1)
    ->Arg(2)
    ->Arg(8)
    ->Arg(32)
    ->Arg(128)
    ->Arg(512)
    ->UseManualTime()
    ->Iterations(500);
BENCHMARK(BM_GroupSlotPolledPort)->Arg(1)->Arg(32)->Arg(512)->UseManualTime()->Iterations(200);

}  // namespace
}  // namespace tm485::bench
