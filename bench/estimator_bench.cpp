// Cost of one update, and of one question, of the estimators. The samples come from a ring, so that the compiler knows
// nothing about them. BM_EstimatorUpdate/3 in its steady state is the figure; BM_EstimatorUpdateAfterGap works out a gain each time.
#include <benchmark/benchmark.h>

#include <array>
#include <cstdint>

#include "tm485/motion/estimator.hpp"
#include "tm485/motion/estimator_fixed.hpp"

namespace tm485::bench {
namespace {

constexpr std::int64_t kPeriod = 62'500;

/// 1 kHz at 16 kHz, as tm485::design solves it.
EstimatorGains gains(std::int64_t order) {
  EstimatorGains g;
  g.period = Time{kPeriod};
  g.order = static_cast<std::uint8_t>(order);
  g.measurement_variance = 1.0F / 12.0F;
  if (order == 2) {
    g.gain = {0.424100041F, 0.115544081F, 0.0F};
    g.covariance = {.pp = 0.0353416689F, .pv = 0.00962867402F, .vv = 0.00612476654F};
    g.process_noise = 0.00193182216F;
  } else {
    g.gain = {0.37690419F, 0.0887343287F, 0.010445334F};
    g.covariance = {0.0314086825F,  0.00739452709F,  0.000870444521F,
                    0.00284363399F, 0.000465759396F, 0.000116663068F};
    g.process_noise = 1.45917911e-05F;
  }
  benchmark::DoNotOptimize(g);
  return g;
}

/// Positions and latch times of a shaft at 410 counts a sample (3000 rpm, 17 bits), with 100 ns of jitter.
class Samples {
 public:
  struct Sample {
    std::int64_t position;
    Time latch;
  };
  Samples() {
    for (std::size_t i = 0; i < ring_.size(); ++i) {
      const auto jitter = static_cast<std::int64_t>((i * 7919) % 201) - 100;
      ring_[i] = {static_cast<std::int64_t>(i) * 3280 / 8,
                  Time{static_cast<std::int64_t>(i) * kPeriod + jitter}};
    }
    benchmark::DoNotOptimize(ring_.data());
  }
  Sample next() noexcept {
    Sample sample = ring_[at_];
    sample.position += turn_ * (kRing * 3280 / 8);
    sample.latch += Time{turn_ * kRing * kPeriod};
    at_ = (at_ + 1) % ring_.size();
    if (at_ == 0) ++turn_;
    return sample;
  }

 private:
  static constexpr std::int64_t kRing = 1024;
  std::array<Sample, kRing> ring_{};
  std::size_t at_ = 0;
  std::int64_t turn_ = 0;
};

template <class E>
void update(benchmark::State& state, E& estimator, int each) {
  Samples samples;
  for (int i = 0; i < 200; ++i) {
    const auto sample = samples.next();
    estimator.update(sample.position, sample.latch);
  }
  for (auto _ : state) {
    for (int i = 1; i < each; ++i) samples.next();
    const auto sample = samples.next();
    benchmark::DoNotOptimize(estimator.update(sample.position, sample.latch));
  }
  if (estimator.state() != EstimatorState::tracking) state.SkipWithError("the estimator lost the shaft");
}

/// The samples alone: to be subtracted.
void BM_EstimatorSamplesOnly(benchmark::State& state) {
  Samples samples;
  for (auto _ : state) {
    const auto sample = samples.next();
    benchmark::DoNotOptimize(sample.position);
    benchmark::DoNotOptimize(sample.latch);
  }
}
BENCHMARK(BM_EstimatorSamplesOnly);

void BM_EstimatorUpdate(benchmark::State& state) {
  const EstimatorGains g = gains(state.range(0));
  Estimator estimator(g);
  update(state, estimator, 1);
}
BENCHMARK(BM_EstimatorUpdate)->Arg(2)->Arg(3);

void BM_EstimatorUpdateAfterGap(benchmark::State& state) {
  const EstimatorGains g = gains(state.range(0));
  Estimator estimator(g);
  update(state, estimator, 2);
}
BENCHMARK(BM_EstimatorUpdateAfterGap)->Arg(2)->Arg(3);

void BM_FixedEstimatorUpdate(benchmark::State& state) {
  const FixedGains g = *FixedGains::from(gains(state.range(0)));
  FixedEstimator estimator(g);
  update(state, estimator, 1);
}
BENCHMARK(BM_FixedEstimatorUpdate)->Arg(2)->Arg(3);

template <class E>
void ask(benchmark::State& state, E& estimator) {
  Samples samples;
  for (int i = 0; i < 100; ++i) {
    const auto sample = samples.next();
    estimator.update(sample.position, sample.latch);
  }
  Time time = estimator.latch_time();
  for (auto _ : state) {
    time += Time{1};
    if (time > estimator.latch_time() + Time{kPeriod}) time = estimator.latch_time();
    benchmark::DoNotOptimize(estimator.at(time));
  }
}

void BM_EstimatorAt(benchmark::State& state) {
  const EstimatorGains g = gains(state.range(0));
  Estimator estimator(g);
  ask(state, estimator);
}
BENCHMARK(BM_EstimatorAt)->Arg(2)->Arg(3);

void BM_FixedEstimatorAt(benchmark::State& state) {
  const FixedGains g = *FixedGains::from(gains(state.range(0)));
  FixedEstimator estimator(g);
  ask(state, estimator);
}
BENCHMARK(BM_FixedEstimatorAt)->Arg(2)->Arg(3);

}  // namespace
}  // namespace tm485::bench
