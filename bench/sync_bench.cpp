// The lock-free types in one thread, without contention: what a call costs. Between two threads, and beside other
// people's queues: tm485_sync_figures.
#include <benchmark/benchmark.h>

#include <array>
#include <cstdint>
#include <memory>
#include <span>

#include "tm485/sync/four_slot.hpp"
#include "tm485/sync/shared_latest.hpp"
#include "tm485/sync/spsc_ring.hpp"
#include "tm485/sync/triple_buffer.hpp"

namespace tm485::bench {
namespace {

/// As big as a sample may be.
struct Sample64 {
  std::array<std::uint64_t, 8> words{};
};

template <class Buffer>
void BM_LatestPut(benchmark::State& state) {
  const auto buffer = std::make_unique<Buffer>();
  Sample64 sample;
  for (auto _ : state) {
    ++sample.words[0];
    benchmark::DoNotOptimize(sample);
    buffer->put(sample);
    benchmark::ClobberMemory();
  }
}
BENCHMARK(BM_LatestPut<TripleBuffer<Sample64>>)->Name("BM_TripleBufferPut");
BENCHMARK(BM_LatestPut<FourSlot<Sample64>>)->Name("BM_FourSlotPut");
BENCHMARK(BM_LatestPut<SharedLatest<Sample64>>)->Name("BM_SharedLatestPut");

/// With a copy out, and nothing new to take.
template <class Buffer>
void BM_LatestGet(benchmark::State& state) {
  const auto buffer = std::make_unique<Buffer>();
  buffer->put({});
  for (auto _ : state) {
    Sample64 sample = buffer->get();
    benchmark::DoNotOptimize(sample);
  }
}
BENCHMARK(BM_LatestGet<TripleBuffer<Sample64>>)->Name("BM_TripleBufferGet");
BENCHMARK(BM_LatestGet<FourSlot<Sample64>>)->Name("BM_FourSlotGet");

/// Every get() takes a new value.
template <class Buffer>
void BM_LatestPutGet(benchmark::State& state) {
  const auto buffer = std::make_unique<Buffer>();
  Sample64 in;
  for (auto _ : state) {
    ++in.words[0];
    benchmark::DoNotOptimize(in);
    buffer->put(in);
    Sample64 out = buffer->get();
    benchmark::DoNotOptimize(out);
  }
}
BENCHMARK(BM_LatestPutGet<TripleBuffer<Sample64>>)->Name("BM_TripleBufferPutGet");
BENCHMARK(BM_LatestPutGet<FourSlot<Sample64>>)->Name("BM_FourSlotPutGet");

void BM_SharedLatestGet(benchmark::State& state) {
  const auto shared = std::make_unique<SharedLatest<Sample64>>();
  Sample64 out;
  std::uint64_t failed = 0;
  for (auto _ : state) {
    failed += shared->try_get(out) ? 0U : 1U;
    benchmark::DoNotOptimize(out);
  }
  if (failed != 0) state.SkipWithError("nobody writes, and a get failed");
}
BENCHMARK(BM_SharedLatestGet);

void BM_SpscRingPushPop(benchmark::State& state) {
  using Ring = SpscRing<Sample64, 1024>;
  const auto ring = std::make_unique<Ring>();
  Ring::Producer producer(*ring);
  Ring::Consumer consumer(*ring);
  Sample64 item;
  std::uint64_t failed = 0;
  for (auto _ : state) {
    ++item.words[0];
    benchmark::DoNotOptimize(item);
    failed += producer.try_push(item) ? 0U : 1U;
    failed += consumer.try_pop(item) ? 0U : 1U;
    benchmark::DoNotOptimize(item);
  }
  if (failed != 0) state.SkipWithError("an item was refused");
}
BENCHMARK(BM_SpscRingPushPop);

void BM_SpscRingBatch32(benchmark::State& state) {
  using Ring = SpscRing<Sample64, 1024>;
  const auto ring = std::make_unique<Ring>();
  Ring::Producer producer(*ring);
  Ring::Consumer consumer(*ring);
  std::array<Sample64, 32> items{};
  for (auto _ : state) {
    benchmark::DoNotOptimize(items);
    const std::size_t pushed = producer.try_push(std::span<const Sample64>(items));
    if (consumer.try_pop(std::span<Sample64>(items)) != pushed)
      return state.SkipWithError("an item was lost");
  }
  state.SetItemsProcessed(state.iterations() * 32);
}
BENCHMARK(BM_SpscRingBatch32);

}  // namespace
}  // namespace tm485::bench
