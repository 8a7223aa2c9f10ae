// What the figures between two threads share: a cheap clock, placement, percentiles, and a table whose rows have one
// value a round, so that a noisy machine shows its noise.
#pragma once

#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#if defined(__x86_64__)
#include <x86intrin.h>
#else
#include <ctime>
#endif

namespace tm485::figures {

/// One cache line, as big as a sample may be.
struct alignas(64) Item {
  std::array<std::uint64_t, 8> words{};

  void fill(std::uint64_t number) noexcept { words.fill(number); }
  [[nodiscard]] bool whole() const noexcept { return words.front() == words.back(); }
};

/// A counter that costs little to read. What is between two reads is complete at the second.
[[nodiscard]] inline std::uint64_t ticks() noexcept {
#if defined(__x86_64__)
  unsigned processor = 0;
  const std::uint64_t now = __rdtscp(&processor);
  _mm_lfence();
  return now;
#else
  timespec now{};
  clock_gettime(CLOCK_MONOTONIC, &now);
  return static_cast<std::uint64_t>(now.tv_sec) * 1'000'000'000U + static_cast<std::uint64_t>(now.tv_nsec);
#endif
}

/// Between two tries of a spinning loop: lets the other core have the line.
inline void pause() noexcept {
#if defined(__x86_64__)
  _mm_pause();
#elif defined(__aarch64__)
  asm volatile("isb");
#endif
}

/// Nanoseconds in one tick; measured at the first call.
[[nodiscard]] double ns_per_tick();

/// Runs `first` here on one core and `second` in a thread on another, at the same time; without two cores, unpinned.
class Pair {
 public:
  /// Finds the cores that the process may use. `fifo`: both threads at SCHED_FIFO 50 for the time of a run.
  explicit Pair(bool fifo);

  [[nodiscard]] bool pinned() const noexcept { return cores_.second >= 0; }
  [[nodiscard]] bool fifo() const noexcept { return fifo_; }
  [[nodiscard]] std::pair<int, int> cores() const noexcept { return cores_; }

  template <class First, class Second>
  void run(First first, Second second) const {
    std::atomic<int> ready{0};
    const auto meet = [&ready] {
      ready.fetch_add(1);
      while (ready.load() != 2) {
      }
    };
    std::thread other([&] {
      enter(cores_.second);
      meet();
      second();
    });
    std::thread one([&] {
      enter(cores_.first);
      meet();
      first();
    });
    one.join();
    other.join();
  }

 private:
  void enter(int core) const;

  std::pair<int, int> cores_{-1, -1};
  bool fifo_;
};

/// Times of single calls, in ticks.
class Times {
 public:
  explicit Times(std::size_t capacity) { values_.reserve(capacity); }
  void add(std::uint64_t ticks) {
    if (values_.size() < values_.capacity()) values_.push_back(ticks);
  }
  [[nodiscard]] std::size_t count() const noexcept { return values_.size(); }
  /// In nanoseconds; 0 to 1.
  [[nodiscard]] double percentile(double fraction);

 private:
  std::vector<std::uint64_t> values_;
};

/// Named values, one of each a round.
class Table {
 public:
  void add(const std::string& name, const std::string& unit, double value);
  /// One value `numerator` / `denominator` for each round of both; nothing if one of them is missing.
  void add_ratio(const std::string& name, const std::string& numerator, const std::string& denominator);

  /// Name, unit, median, smallest and largest round.
  [[nodiscard]] std::string text() const;
  /// {"name": {"unit": ..., "median": ..., "min": ..., "max": ..., "rounds": [...]}, ...}
  [[nodiscard]] std::string json() const;

 private:
  struct Row {
    std::string name;
    std::string unit;
    std::vector<double> rounds;
  };
  [[nodiscard]] const Row* find(const std::string& name) const;

  std::vector<Row> rows_;
};

void measure_latest(const Pair& pair, Table& table);
void measure_rings(const Pair& pair, Table& table);
void add_ring_ratios(Table& table);

}  // namespace tm485::figures
