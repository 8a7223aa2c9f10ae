// Model checks of core/sync under the language's weak memory, on the very headers: relacy explores
// interleavings and every value that a load may see. Each type has twins with a weakened order that
// must be found, so a check that finds nothing cannot pass for one that works.
#include "tm485/sync/four_slot.hpp"
#include "tm485/sync/shared_latest.hpp"
#include "tm485/sync/spsc_ring.hpp"
#include "tm485/sync/triple_buffer.hpp"

#include "relacy_atomics.hpp"

namespace tm485::model {
namespace {

/// Two words that belong together; relacy reports any access to them that races.
struct Pair {
  rl::var<int> a;
  rl::var<int> b;

  Pair() { set(0); }
  Pair(const Pair& other) { *this = other; }
  Pair& operator=(const Pair& other) {
    a($) = int{other.a($)};
    b($) = int{other.b($)};
    return *this;
  }
  void set(int value) {
    a($) = value;
    b($) = value;
  }
};

/// One writer puts 1, 2, 3; the reader must see whole values that never go back, and at last the newest.
template <class Buffer>
struct LatestModel : rl::test_suite<LatestModel<Buffer>, 2> {
  Buffer buffer;
  static constexpr int kPuts = 3;

  void thread(unsigned index) {
    if (index == 0) {
      for (int i = 1; i <= kPuts; ++i) {
        buffer.draft().set(i);
        buffer.publish();
      }
      return;
    }
    int last = 0;
    for (int i = 0; i < 3; ++i) last = check(last);
  }
  void after() { RL_ASSERT(check(0) == kPuts); }

  int check(int last) {
    const Pair& seen = buffer.get();
    const int a = seen.a($);
    RL_ASSERT(a == int{seen.b($)});
    RL_ASSERT(a >= last);
    return a;
  }
};

/// Items pass through a ring of two, pushed one by one or in batches (which then cross its seam) and popped in
/// batches; none is lost, doubled or out of order.
template <class Atomics, std::size_t kBatch = 1>
struct RingModel : rl::test_suite<RingModel<Atomics, kBatch>, 2> {
  using Ring = SpscRing<Pair, 2, Atomics>;
  Ring ring;
  static constexpr int kItems = 4;

  void thread(unsigned index) {
    if (index == 0) {
      typename Ring::Producer producer(ring);
      rl::linear_backoff wait;
      for (int next = 1; next <= kItems;) {
        std::array<Pair, kBatch> items;
        for (std::size_t i = 0; i < kBatch; ++i) items[i].set(next + static_cast<int>(i));
        const auto left = std::min<std::size_t>(kBatch, static_cast<std::size_t>(kItems + 1 - next));
        const std::size_t count = kBatch == 1 ? producer.try_push(items[0])
                                              : producer.try_push(std::span<const Pair>(items).first(left));
        if (count != 0) {
          next += static_cast<int>(count);
        } else {
          wait.yield($);
        }
      }
      return;
    }
    typename Ring::Consumer consumer(ring);
    rl::linear_backoff wait;
    for (int wanted = 1; wanted <= kItems;) {
      std::array<Pair, 2> items;
      const std::size_t count = consumer.try_pop(std::span<Pair>(items));
      for (std::size_t i = 0; i < count; ++i, ++wanted) {
        RL_ASSERT(int{items[i].a($)} == wanted);
        RL_ASSERT(int{items[i].b($)} == wanted);
      }
      if (count == 0) wait.yield($);
    }
  }
};

struct Plain {
  std::uint32_t a;
  std::uint32_t b;
};

/// Two readers; each value they get is whole and never goes back.
template <class Atomics>
struct SharedModel : rl::test_suite<SharedModel<Atomics>, 3> {
  SharedLatest<Plain, Atomics> shared;

  void before() { shared.put({0, 0}); }
  void thread(unsigned index) {
    if (index == 0) {
      for (std::uint32_t i = 1; i <= 2; ++i) shared.put({i, i});
      return;
    }
    std::uint32_t last = 0;
    for (int i = 0; i < 2; ++i) {
      Plain seen{};
      if (!shared.try_get(seen, 2)) continue;
      RL_ASSERT(seen.a == seen.b);
      RL_ASSERT(seen.a >= last);
      last = seen.a;
    }
  }
};

int failures = 0;

void expect(const char* what, bool found, bool wanted) {
  const bool good = found == wanted;
  if (!good) ++failures;
  std::cout << (good ? "  ok    " : "  WRONG ") << what << (found ? ": holds" : ": a counterexample exists")
            << '\n';
}

constexpr rl::iteration_t kRandom = 200'000;

template <class Model>
void must_hold(const char* what, bool full = true) {
  expect(what, holds<Model>(false, kRandom) && (!full || holds<Model>(true, 0)), true);
}

template <class Twin>
void must_fail(const char* what) {
  expect(what, holds<Twin>(false, kRandom), false);
}

}  // namespace
}  // namespace tm485::model

int main() {
  using namespace tm485;
  using namespace tm485::model;
  must_hold<LatestModel<TripleBuffer<Pair, RelacyAtomics>>>("TripleBuffer");
  must_fail<LatestModel<TripleBuffer<Pair, RelaxedExchange>>>("  twin with a relaxed exchange");
  must_hold<LatestModel<FourSlot<Pair, RelacyAtomics>>>("FourSlot");
  must_fail<LatestModel<FourSlot<Pair, WeakAnnouncements>>>("  twin with relaxed announcements");
  must_hold<RingModel<RelacyAtomics>>("SpscRing", false);
  must_hold<RingModel<RelacyAtomics, 2>>("SpscRing, batches", false);
  must_fail<RingModel<RelaxedStore>>("  twin with relaxed stores");
  must_fail<RingModel<RelaxedLoad>>("  twin with relaxed loads");
  must_hold<SharedModel<RelacyAtomics>>("SharedLatest", false);
  must_fail<SharedModel<NoFences>>("  twin without fences");
  std::cout << (failures == 0 ? "every model as it should be\n" : "MODELS FAILED\n");
  return failures == 0 ? 0 : 1;
}
