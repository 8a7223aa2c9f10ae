// SpscRing beside moodycamel::ReaderWriterQueue and boost::lockfree::spsc_queue, where they are installed: items of
// 64 bytes, capacity 1024, the same loops for all.
#include <memory>

#include "harness.hpp"
#include "tm485/sync/spsc_ring.hpp"

#if defined(TM485_WITH_READERWRITERQUEUE)
#include <readerwriterqueue/readerwriterqueue.h>
#endif
#if defined(TM485_WITH_BOOST_LOCKFREE)
#include <boost/lockfree/spsc_queue.hpp>
#endif

namespace tm485::figures {
namespace {

constexpr std::uint32_t kCapacity = 1024;
constexpr std::uint64_t kItems = 1'000'000;
constexpr std::uint64_t kRounds = 50'000;
constexpr const char* kOurs = "SpscRing";
constexpr const char* kMoodycamel = "moodycamel::ReaderWriterQueue";
constexpr const char* kBoost = "boost::lockfree::spsc_queue";

struct Ours {
  static constexpr const char* kName = kOurs;
  using Ring = SpscRing<Item, kCapacity>;
  Ring ring;
  Ring::Producer producer{ring};
  Ring::Consumer consumer{ring};
  bool push(const Item& item) noexcept { return producer.try_push(item); }
  bool pop(Item& item) noexcept { return consumer.try_pop(item); }
};

#if defined(TM485_WITH_READERWRITERQUEUE)
struct Moodycamel {
  static constexpr const char* kName = kMoodycamel;
  moodycamel::ReaderWriterQueue<Item> queue{kCapacity};
  bool push(const Item& item) { return queue.try_enqueue(item); }
  bool pop(Item& item) { return queue.try_dequeue(item); }
};
#endif

#if defined(TM485_WITH_BOOST_LOCKFREE)
struct Boost {
  static constexpr const char* kName = kBoost;
  boost::lockfree::spsc_queue<Item, boost::lockfree::capacity<kCapacity>> queue;
  bool push(const Item& item) { return queue.push(item); }
  bool pop(Item& item) { return queue.pop(item); }
};
#endif

template <class Queue>
void throughput(const Pair& pair, Table& table) {
  const auto queue = std::make_unique<Queue>();
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
  std::uint64_t wrong = 0;
  pair.run(
      [&] {
        Item item;
        for (std::uint64_t expected = 1; expected <= kItems; ++expected) {
          while (!queue->pop(item)) pause();
          wrong += item.words[0] == expected && item.whole() ? 0U : 1U;
        }
        end = ticks();
      },
      [&] {
        Item item;
        begin = ticks();
        for (std::uint64_t number = 1; number <= kItems; ++number) {
          item.fill(number);
          while (!queue->push(item)) pause();
        }
      });
  const std::string name = Queue::kName;
  table.add(name + " throughput", "M/s",
            static_cast<double>(kItems) / (static_cast<double>(end - begin) * ns_per_tick()) * 1e3);
  table.add(name + " lost, doubled, out of order, torn", "", static_cast<double>(wrong));
}

template <class Queue>
void round_trip(const Pair& pair, Table& table) {
  const auto there = std::make_unique<Queue>();
  const auto back = std::make_unique<Queue>();
  Times times(kRounds);
  pair.run(
      [&] {
        Item item;
        for (std::uint64_t i = 0; i < kRounds; ++i) {
          const std::uint64_t before = ticks();
          while (!there->push(item)) pause();
          while (!back->pop(item)) pause();
          times.add(ticks() - before);
        }
      },
      [&] {
        Item item;
        for (std::uint64_t i = 0; i < kRounds; ++i) {
          while (!there->pop(item)) pause();
          while (!back->push(item)) pause();
        }
      });
  const std::string name = Queue::kName;
  table.add(name + " round trip, p50", "ns", times.percentile(0.5));
  table.add(name + " round trip, p99", "ns", times.percentile(0.99));
}

template <class Queue>
void measure(const Pair& pair, Table& table) {
  throughput<Queue>(pair, table);
  round_trip<Queue>(pair, table);
}

/// Our ring in batches of 32, which the others do not have in this form.
void batches(const Pair& pair, Table& table) {
  constexpr std::size_t kBatch = 32;
  const auto queue = std::make_unique<Ours>();
  std::uint64_t begin = 0;
  std::uint64_t end = 0;
  pair.run(
      [&] {
        std::array<Item, kBatch> items;
        for (std::uint64_t got = 0; got < kItems;) got += queue->consumer.try_pop(std::span<Item>(items));
        end = ticks();
      },
      [&] {
        std::array<Item, kBatch> items;
        begin = ticks();
        for (std::uint64_t sent = 0; sent < kItems;) {
          for (std::size_t i = 0; i < kBatch; ++i) items[i].fill(sent + i);
          for (std::size_t done = 0; done < kBatch;)
            done += queue->producer.try_push(std::span<const Item>(items).subspan(done));
          sent += kBatch;
        }
      });
  table.add(std::string(kOurs) + " throughput, batches of 32", "M/s",
            static_cast<double>(kItems) / (static_cast<double>(end - begin) * ns_per_tick()) * 1e3);
}
static_assert(kItems % 32 == 0);

}  // namespace

void measure_rings(const Pair& pair, Table& table) {
  measure<Ours>(pair, table);
#if defined(TM485_WITH_READERWRITERQUEUE)
  measure<Moodycamel>(pair, table);
#endif
#if defined(TM485_WITH_BOOST_LOCKFREE)
  measure<Boost>(pair, table);
#endif
  batches(pair, table);
}

void add_ring_ratios(Table& table) {
  const std::string ours = kOurs;
  for (const std::string theirs : {kMoodycamel, kBoost}) {
    table.add_ratio("throughput, ours / " + theirs, ours + " throughput", theirs + " throughput");
    table.add_ratio("round trip p50, ours / " + theirs, ours + " round trip, p50",
                    theirs + " round trip, p50");
    table.add_ratio("round trip p99, ours / " + theirs, ours + " round trip, p99",
                    theirs + " round trip, p99");
  }
}

}  // namespace tm485::figures
