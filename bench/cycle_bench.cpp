// One whole master cycle: schedule, exchange, decode, track, publish.
//
// BM_MasterCycleId3 runs against a port that answers at once; BM_SimulatedCycleId3 against the line
// and the encoder model in virtual time, that is, everything the simulator does for one cycle.
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cstdint>
#include <expected>
#include <span>

#include "frames.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::bench {
namespace {

const CompiledProfile kProfile = *CompiledProfile::compile(Profile{});

/// Answers every request with the next of a ring of valid frames, 3 µs after the request.
class InstantPort {
 public:
  [[nodiscard]] PortCapability capability() const noexcept { return {.wire_timestamps = true}; }

  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    const bool identify = request[0] == control_field(DataId::encoder_id);
    answer_ = identify ? id2_[0] : id3_[0];
    reply_start_ = now + Time{7'000};
    return now;
  }
  Transmission transmission(Time) noexcept { return {.state = Transmission::State::sent}; }
  Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    if (answer_.empty() || now < reply_start_) return {};
    const std::size_t count = std::min(buffer.size(), answer_.size());
    std::copy_n(answer_.begin(), count, buffer.begin());
    answer_ = {};
    return {.count = count, .first_start = reply_start_};
  }

 private:
  Frames id2_{DataId::encoder_id};
  Frames id3_{DataId::everything};
  std::span<const std::uint8_t> answer_;
  Time reply_start_{0};
};

void BM_MasterCycleId3(benchmark::State& state) {
  InstantPort port;
  Bus<InstantPort> bus(port, kProfile, BusConfig{});
  Time now{0};
  if (!bus.start(now)) return state.SkipWithError("the cycle was refused");
  while (bus.state() != BusState::running && now < std::chrono::seconds(10)) {
    now = std::max(now + Time{1'000}, bus.poll(now));
  }
  const std::uint32_t good = bus.statistics().good;
  Time due = bus.poll(now);
  for (auto _ : state) {
    now = due;  // the slot: the request goes out
    bus.poll(now);
    due = bus.poll(now + Time{51'000});  // its reply is there: a sample is published
  }
  const std::uint32_t cycles = bus.statistics().good - good;
  if (cycles + 2 < state.iterations()) state.SkipWithError("cycles were lost");
  benchmark::DoNotOptimize(bus.latest());
}
BENCHMARK(BM_MasterCycleId3);

void BM_SimulatedCycleId3(benchmark::State& state) {
  sim::SimulatedEncoder encoder;
  Bus<sim::SimPort> bus(encoder.port(), kProfile, BusConfig{});
  Time now{0};
  if (!bus.start(now)) return state.SkipWithError("the cycle was refused");
  const auto step = [&] {
    const Time due = bus.poll(now);
    now = std::max(now, std::min(due, encoder.line().next_event()));
  };
  while (bus.state() != BusState::running && now < std::chrono::seconds(10)) step();
  const std::uint32_t good = bus.statistics().good;
  std::uint32_t target = good;
  for (auto _ : state) {
    ++target;
    while (bus.statistics().good != target) step();
  }
  state.counters["T1_violations"] = static_cast<double>(encoder.model().t1().violations());
  state.counters["times_real_time"] =
      benchmark::Counter(62.5e-6 * static_cast<double>(state.iterations()), benchmark::Counter::kIsRate);
}
BENCHMARK(BM_SimulatedCycleId3);

}  // namespace
}  // namespace tm485::bench
