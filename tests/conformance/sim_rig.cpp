// SimPort under the contract: the far end is the simulated line itself.
#include "tm485/sim/sim_port.hpp"

#include <algorithm>

#include "conformance/rigs.hpp"
#include "tm485/sim/fault_hook.hpp"
#include "tm485/sim/line.hpp"

namespace tm485::test {
namespace {

/// Sees what the host puts on the line, and can take a stop bit away from what the encoder sends.
struct Ear : sim::FaultHook {
  bool on_burst(sim::Burst& burst) noexcept override {
    if (burst.talker == sim::Talker::host) {
      for (std::uint8_t k = 0; k < burst.count; ++k) {
        const Time start = burst.start + character * k;
        bytes.push_back({burst.bytes[k], start, start + character});
      }
      driver_off = std::max(driver_off, burst.driver_off);
      return false;
    }
    if (break_next) burst.framing_errors = 1;
    return std::exchange(break_next, false);
  }
  Time character{0};
  std::vector<HeardByte> bytes;
  Time driver_off{0};
  bool break_next = false;
};

class SimRig : public Rig {
 public:
  explicit SimRig(const sim::SimPortConfig& config) : port_(line_, config) {
    ear_.character = line_.character_time();
    line_.set_fault_hook(&ear_);
  }

  PortCapability capability() override { return port_.capability(); }
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request) override {
    return port_.try_send(request, now_);
  }
  Transmission transmission() override { return port_.transmission(now_); }
  Reception try_receive(std::span<std::uint8_t> buffer) override { return port_.try_receive(buffer, now_); }

  Time now() override { return now_; }
  void pass(Time span) override { now_ += span; }
  [[nodiscard]] Time grain() const override { return Time{300}; }
  [[nodiscard]] Time patience() const override { return std::chrono::milliseconds(1); }

  std::vector<HeardByte> heard() override {
    const auto later =
        std::ranges::find_if(ear_.bytes, [this](const HeardByte& byte) { return byte.end > now_; });
    std::vector<HeardByte> past(ear_.bytes.begin(), later);
    ear_.bytes.erase(ear_.bytes.begin(), later);
    return past;
  }
  void answer(std::span<const std::uint8_t> bytes, Time after) override {
    const Time start = now_ + after;
    const Time end = start + line_.character_time() * static_cast<std::int64_t>(bytes.size());
    EXPECT_TRUE(line_.transmit(sim::Talker::encoder, start, bytes, start, end));
  }
  bool answer_broken(std::uint8_t byte) override {
    ear_.break_next = true;
    answer(std::array{byte}, Time{3'000});
    return true;
  }

  [[nodiscard]] bool wire_time() const override { return true; }
  bool line_idle() override { return now_ >= ear_.driver_off; }

 private:
  Ear ear_;
  sim::Line line_{nullptr};
  sim::SimPort port_;
  Time now_{0};
};

std::unique_ptr<Rig> late() {
  return std::make_unique<SimRig>(sim::SimPortConfig{.release = Time{1'500}, .start_jitter = Time{2'000}});
}

INSTANTIATE_TEST_SUITE_P(Sim, PortConformance,
                         conformance_of({{"SimPort", make_sim_rig}, {"SimPortWithJitter", late}}),
                         conformance_name);

}  // namespace

std::unique_ptr<Rig> make_sim_rig() { return std::make_unique<SimRig>(sim::SimPortConfig{}); }

}  // namespace tm485::test
