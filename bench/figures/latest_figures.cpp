// TripleBuffer (which is LatestValue here) and SharedLatest between two cores.
#include <memory>

#include "harness.hpp"
#include "tm485/sync/shared_latest.hpp"
#include "tm485/sync/triple_buffer.hpp"

namespace tm485::figures {
namespace {

constexpr std::size_t kReads = 2'000'000;
constexpr std::size_t kAlone = 1'000'000;

/// The same three calls for both types.
struct Triple {
  static constexpr const char* kName = "LatestValue";
  TripleBuffer<Item> buffer;
  void put(const Item& item) noexcept { buffer.put(item); }
  bool get(Item& item) noexcept {
    item = buffer.get();
    return true;
  }
};
struct Shared {
  static constexpr const char* kName = "SharedLatest";
  SharedLatest<Item> buffer;
  void put(const Item& item) noexcept { buffer.put(item); }
  bool get(Item& item) noexcept { return buffer.try_get(item); }
};

template <class T>
void keep(T& value) {
  asm volatile("" : : "r"(&value) : "memory");
}

double mean_ns(std::uint64_t begin, std::uint64_t end, std::size_t calls) {
  return static_cast<double>(end - begin) * ns_per_tick() / static_cast<double>(calls);
}

/// A loop of calls between two looks at the clock.
template <class Buffer>
void alone(const Pair& pair, Table& table) {
  const std::string name = Buffer::kName;
  pair.run(
      [&] {
        const auto buffer = std::make_unique<Buffer>();
        Item item;
        const std::uint64_t begin = ticks();
        for (std::size_t i = 0; i < kAlone; ++i) {
          item.words[0] = i;
          keep(item);
          buffer->put(item);
        }
        const std::uint64_t middle = ticks();
        for (std::size_t i = 0; i < kAlone; ++i) {
          buffer->get(item);
          keep(item);
        }
        const std::uint64_t end = ticks();
        table.add(name + " put, alone", "ns", mean_ns(begin, middle, kAlone));
        table.add(name + " get, alone", "ns", mean_ns(middle, end, kAlone));
      },
      [] {});
}

struct Reader {
  Times all{kReads};
  Times fresh{kReads};
  std::uint64_t failed = 0;
  std::uint64_t wrong = 0;
  std::uint64_t seen = 0;
  std::uint64_t begin = 0;
  std::uint64_t end = 0;

  template <class Buffer>
  void read(Buffer& buffer) {
    std::uint64_t last = 0;
    Item item;
    begin = ticks();
    for (std::size_t i = 0; i < kReads; ++i) {
      const std::uint64_t before = ticks();
      const bool got = buffer.get(item);
      keep(item);
      const std::uint64_t after = ticks();
      all.add(after - before);
      if (!got) {
        ++failed;
        continue;
      }
      wrong += item.whole() && item.words[0] >= last ? 0U : 1U;
      if (item.words[0] != last) {
        fresh.add(after - before);
        ++seen;
      }
      last = item.words[0];
    }
    end = ticks();
  }
};

/// A reader that never rests beside a writer that puts every `period` ns, or without rest for 0.
template <class Buffer>
void together(const Pair& pair, Table& table, double period, const std::string& writer_name) {
  const std::string name = std::string(Buffer::kName) + " get, " + writer_name;
  const auto buffer = std::make_unique<Buffer>();
  const auto reader = std::make_unique<Reader>();
  std::atomic<bool> done{false};
  const auto step = static_cast<std::uint64_t>(period / ns_per_tick());
  pair.run(
      [&] {
        reader->read(*buffer);
        done.store(true);
      },
      [&] {
        Item item;
        std::uint64_t due = ticks();
        for (std::uint64_t number = 1; !done.load(std::memory_order_relaxed); ++number) {
          item.fill(number);
          buffer->put(item);
          for (due += step; step != 0 && ticks() < due;) {
          }
        }
      });
  table.add(name + ": p50", "ns", reader->all.percentile(0.5));
  table.add(name + ": p99", "ns", reader->all.percentile(0.99));
  table.add(name + ": p99.9", "ns", reader->all.percentile(0.999));
  table.add(name + ": p99.99", "ns", reader->all.percentile(0.9999));
  table.add(name + ": new value, p50", "ns", reader->fresh.percentile(0.5));
  table.add(name + ": new value, p99", "ns", reader->fresh.percentile(0.99));
  if (period == 0.0) {
    const double seconds = static_cast<double>(reader->end - reader->begin) * ns_per_tick() / 1e9;
    table.add(name + ": values read", "M/s", static_cast<double>(kReads - reader->failed) / seconds / 1e6);
    table.add(name + ": new values read", "M/s", static_cast<double>(reader->seen) / seconds / 1e6);
  }
  table.add(name + ": gets that failed", "%",
            100.0 * static_cast<double>(reader->failed) / static_cast<double>(kReads));
  table.add(name + ": torn or older", "", static_cast<double>(reader->wrong));
}

template <class Buffer>
void measure(const Pair& pair, Table& table) {
  alone<Buffer>(pair, table);
  together<Buffer>(pair, table, 40'000.0, "writer every 40 us");
  together<Buffer>(pair, table, 0.0, "saturating writer");
}

}  // namespace

void measure_latest(const Pair& pair, Table& table) {
  Times nothing(kAlone);
  pair.run(
      [&] {
        for (std::size_t i = 0; i < kAlone; ++i) {
          const std::uint64_t before = ticks();
          nothing.add(ticks() - before);
        }
      },
      [] {});
  table.add("clock: two reads, p50 (in every percentile below)", "ns", nothing.percentile(0.5));
  table.add("clock: two reads, p99.99", "ns", nothing.percentile(0.9999));
  measure<Triple>(pair, table);
  measure<Shared>(pair, table);
}

}  // namespace tm485::figures
