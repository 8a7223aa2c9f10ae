// Who may call what from where (docs/api-contexts.md), by trying it: three contexts on one core, the UART's interrupt, the
// owner of the bus and the control loop, one inside the other after every single instruction.
#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

#include "mcu/interrupt_bus.hpp"
#include "mcu/models/stm32_models.hpp"
#include "mcu/single_step.hpp"
#include "sync/checked.hpp"
#include "tm485/mcu/stm32_usart_v1.hpp"
#include "tm485/sync/four_slot.hpp"
#include "tm485/sync/triple_buffer.hpp"

namespace tm485::test {
namespace {

#if defined(TM485_TEST_SINGLE_STEP)

using Driver = mcu::Stm32UsartV1<ModelAccess<Stm32V1Model>>;
using World = InterruptBus<Stm32V1Model, Driver, PinDirection<Stm32V1Model>>;

const sim::MotionProfile kMotion = sim::MotionProfile::constant(kRpm);

class InterruptContexts : public testing::Test {
 protected:
  /// Latency 0: an interrupt comes at the first instruction at which it can.
  void make(Priorities priorities) {
    world_.emplace(Stm32Config{.clock_hz = 100'000'000, .interrupts = true, .engine = kJudged},
                   pin<Stm32V1Model>,
                   Setting{.clock_hz = 100'000'000, .latency = Time{0}, .priorities = priorities});
    world_->run(20);  // past the start-up
  }
  void TearDown() override { world_->expect_no_fault(); }

  /// The control loop's work: what it sees is one sample, and not older than the one before.
  void control() {
    const Sample& sample = world_->bus().latest();
    const std::int64_t position = sample.position();
    const std::uint32_t single_turn = sample.single_turn();
    const std::uint32_t sequence = sample.sequence();
    const Time latch = sample.latch_time();
    // 6.55 counts a us, and 400 between two samples; the instant of the latch is known to some us.
    const std::int64_t off = position - kMotion.counts(latch, 17);
    torn_ +=
        std::abs(off) > 100 || single_turn != (static_cast<std::uint32_t>(position) & 0x1FFFFU) ? 1U : 0U;
    backwards_ += sequence < sequence_ || latch < latch_ ? 1U : 0U;
    new_ += sequence != sequence_ ? 1U : 0U;
    sequence_ = sequence;
    latch_ = latch;
    ++looks_;
  }

  void expect_whole(std::uint32_t samples) {
    EXPECT_EQ(torn_, 0U);
    EXPECT_EQ(backwards_, 0U);
    EXPECT_GE(new_, samples);
    RecordProperty("looks", std::to_string(looks_));
  }

  std::optional<World> world_;
  std::uint32_t torn_ = 0, backwards_ = 0, new_ = 0, sequence_ = 0;
  std::uint64_t looks_ = 0;
  Time latch_{0};
};

TEST_F(InterruptContexts, ControlAboveTheBusSeesWholeSamples) {
  make(Priorities::same);
  const std::uint32_t begin = world_->bus().statistics().cycles;
  world_->around_poll = [this](const std::function<void()>& poll) {
    SingleStep::run(poll, [this] { control(); });
  };
  world_->run(begin + 3);
  expect_whole(3);
  EXPECT_GT(looks_, 1'000U);
}

TEST_F(InterruptContexts, ControlBelowTheBusSeesWholeSamples) {
  make(Priorities::same);
  for (int round = 0; round < 4; ++round) {
    // A whole cycle of the bus, a sample published, between each two instructions of the control loop.
    SingleStep::run([this] { control(); }, [this] { world_->run(world_->bus().statistics().cycles + 1); });
  }
  EXPECT_GT(world_->bus().statistics().cycles, 200U);
  expect_whole(4);
}

TEST_F(InterruptContexts, TheUartAboveTheBusMayInterruptItAnywhere) {
  make(Priorities::uart_higher);
  const std::uint32_t begin = world_->bus().statistics().cycles;
  const std::uint32_t before = world_->line().taken();
  std::uint64_t steps = 0;
  world_->around_poll = [&](const std::function<void()>& poll) {
    steps += SingleStep::run(poll, [this] {
      if (!ModelAtWork::any()) world_->line().take_due();
    });
    control();
  };
  world_->run(begin + 4);
  EXPECT_GT(steps, 1'000U);
  EXPECT_GE(world_->line().taken() - before, 4U * 12U) << "11 characters and a completion each";
  expect_whole(4);
}

/// The mechanisms of all cores, on whichever this runs: one with an exchange, one with loads and stores only.
template <class Latest>
void expect_whole_either_way() {
  Latest latest;
  Findings findings;
  std::uint64_t number = 0;
  const auto put = [&] {
    Checked& draft = latest.draft();
    draft.fill(++number);
    latest.publish();
  };
  put();
  for (int round = 0; round < 20; ++round) {
    SingleStep::run(put, [&] { findings.see(latest.get()); });
    SingleStep::run([&] { findings.see(latest.get()); }, put);
  }
  EXPECT_EQ(findings.torn, 0U);
  EXPECT_EQ(findings.backwards, 0U);
  EXPECT_GT(findings.last, 20U);
}

TEST(InterruptContextsOfValues, TripleBuffer) { expect_whole_either_way<TripleBuffer<Checked>>(); }
TEST(InterruptContextsOfValues, FourSlot) { expect_whole_either_way<FourSlot<Checked>>(); }

/// A value without a mechanism: the test must see that.
struct Naked {
  Checked value;
  Checked& draft() { return value; }
  void publish() {}
  const Checked& get() { return value; }
};

TEST(InterruptContextsOfValues, WithoutAMechanismValuesAreTorn) {
  Naked latest;
  Findings findings;
  SingleStep::run([&] { latest.draft().fill(1); }, [&] { findings.see(latest.get()); });
  EXPECT_GT(findings.torn, 0U);
}

#else

TEST(InterruptContexts, DISABLED_NeedsX86WithoutThreadSanitizer) {}

#endif

}  // namespace
}  // namespace tm485::test
