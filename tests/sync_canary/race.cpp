// Canary of the thread sanitizer: each of these programs has a data race that it must report. A check that is blind,
// switched off or suppressed fails here first. Not a test by itself: tools/check.sh tsan runs it.
//
//   race plain            a struct that two threads share without synchronisation
//   race triple_buffer    TripleBuffer whose exchange orders nothing
//   race four_slot        FourSlot whose announcements order nothing
//   race ring             SpscRing whose loads and stores order nothing
#include <atomic>
#include <cstdint>
#include <cstdio>
#include <string_view>
#include <thread>

#include "sync/checked.hpp"
#include "tm485/sync/four_slot.hpp"
#include "tm485/sync/spsc_ring.hpp"
#include "tm485/sync/triple_buffer.hpp"

namespace {

using namespace tm485;
using test::Checked;
using test::on_heap;

constexpr std::uint64_t kRounds = 20'000;

/// Seeded bug: every order is relaxed.
struct NoOrder : StdAtomics {
  static constexpr auto kAcquire = std::memory_order_relaxed;
  static constexpr auto kRelease = std::memory_order_relaxed;
  static constexpr auto kAcqRel = std::memory_order_relaxed;
  static constexpr auto kSeqCst = std::memory_order_relaxed;
};

/// Both run at the same time until the writer has done its rounds.
template <class Write, class Read>
void race(Write write, Read read) {
  std::atomic<bool> reading{false};
  std::atomic<bool> done{false};
  std::thread writer([&] {
    while (!reading.load(std::memory_order_relaxed)) std::this_thread::yield();
    for (std::uint64_t number = 1; number <= kRounds; ++number) {
      write(number);
      if (number % 64 == 0) std::this_thread::yield();
    }
    done.store(true, std::memory_order_relaxed);
  });
  reading.store(true, std::memory_order_relaxed);
  while (!done.load(std::memory_order_relaxed)) read();
  writer.join();
}

template <class Buffer>
std::uint64_t race_latest() {
  const auto buffer = on_heap<Buffer>();
  std::uint64_t sum = 0;
  race([&](std::uint64_t number) { buffer->put(Checked::of(number)); },
       [&] { sum += buffer->get().number(); });
  return sum;
}

std::uint64_t race_plain() {
  const auto shared = on_heap<Checked>();
  std::uint64_t sum = 0;
  race([&](std::uint64_t number) { shared->fill(number); }, [&] { sum += shared->whole() ? 1U : 0U; });
  return sum;
}

std::uint64_t race_ring() {
  using Ring = SpscRing<Checked, 16, NoOrder>;
  const auto ring = on_heap<Ring>();
  Ring::Producer producer(*ring);
  Ring::Consumer consumer(*ring);
  std::uint64_t sum = 0;
  race([&](std::uint64_t number) { (void)producer.try_push(Checked::of(number)); },
       [&] {
         Checked item;
         if (consumer.try_pop(item)) sum += item.number();
       });
  return sum;
}

}  // namespace

int main(int argc, char** argv) {
  const std::string_view which = argc == 2 ? argv[1] : "";
  std::uint64_t sum = 0;
  if (which == "plain") {
    sum = race_plain();
  } else if (which == "triple_buffer") {
    sum = race_latest<TripleBuffer<Checked, NoOrder>>();
  } else if (which == "four_slot") {
    sum = race_latest<FourSlot<Checked, NoOrder>>();
  } else if (which == "ring") {
    sum = race_ring();
  } else {
    std::fputs("usage: race plain|triple_buffer|four_slot|ring\n", stderr);
    return 2;
  }
  std::printf("no race was reported (%llu)\n", static_cast<unsigned long long>(sum));
  return 0;
}
