// Recorder: what a run looked like around one cycle, as a table to read and as a waveform (VCD) for GTKWave or sigrok.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "tm485/bus/bus.hpp"
#include "tm485/sim/fault_hook.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::cli::campaign {

/// Stands between the line and the fault plan while it records. One owner; allocates.
class Recorder final : public sim::FaultHook {
 public:
  /// Keeps what happens from `first_cycle` on, at most kMostEvents of it.
  explicit Recorder(std::uint64_t first_cycle) : first_cycle_(first_cycle) {}
  static constexpr std::size_t kMostEvents = 100'000;

  /// At the beginning of a run. `encoder` must outlive its use.
  void begin(sim::SimulatedEncoder& encoder);

  template <class B>
  void after_poll(B& bus, sim::SimulatedEncoder& encoder, std::uint64_t cycle, Time now) {
    cycle_ = cycle;
    if (cycle < first_cycle_ || bus.record_count() == records_) return;
    records_ = bus.record_count();
    note(bus.last_record(), bus.latest(), encoder, now);
  }

  bool on_burst(sim::Burst& burst) noexcept override;
  [[nodiscard]] Time next_own() const noexcept override { return inner_->next_own(); }
  bool on_own(sim::Burst& burst) noexcept override;

  /// A line for each exchange.
  [[nodiscard]] std::string table() const;
  /// Signals: line (level), de (the host's driver), de_encoder, request, reply (the byte under way), quality, valid,
  /// position, fault. Time unit 1 ns, from the first event on.
  [[nodiscard]] std::string vcd() const;

 private:
  struct Exchange {
    CycleRecord record;
    Sample sample;
    std::uint64_t cycle = 0;
    std::int64_t truth = 0;
    std::size_t bursts_before = 0;  // this exchange's bursts end here
    Time now{0};
    bool touched = false;
    bool changed = false;
  };

  void note(const CycleRecord& record, const Sample& sample, sim::SimulatedEncoder& encoder, Time now);
  void keep(const sim::Burst& burst);

  std::uint64_t first_cycle_;
  std::uint64_t cycle_ = 0;
  std::uint32_t records_ = 0;
  sim::FaultPlayer* inner_ = nullptr;
  Time character_{4'000};
  std::vector<sim::Burst> bursts_;  // as the line carries them
  std::vector<Exchange> exchanges_;
};

}  // namespace tm485::cli::campaign
