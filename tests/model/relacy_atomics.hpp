// The atomics policy of relacy, and weakened twins of it that a model must find.
#pragma once

// Every other header, those under test included, comes before this one: relacy makes macros of `delete` and of
// the names of the orders.
#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <iostream>
#include <map>
#include <ostream>
#include <span>
#include <sstream>
#include <stack>
#include <streambuf>
#include <string>
#include <type_traits>
#include <vector>

#include <relacy/relacy.hpp>

namespace tm485::model {

/// relacy's atomic with the language's signatures.
template <class T>
class CheckedAtomic {
 public:
  CheckedAtomic() = default;
  explicit CheckedAtomic(T value) : atomic_(value) {}
  T load(rl::memory_order order) const { return atomic_.load(order, $); }
  void store(T value, rl::memory_order order) { atomic_.store(value, order, $); }
  T exchange(T value, rl::memory_order order) { return atomic_.exchange(value, order, $); }

 private:
  rl::atomic<T> atomic_;
};

struct RelacyAtomics {
  template <class T>
  using Atomic = CheckedAtomic<T>;

  static constexpr auto kRelaxed = rl::mo_relaxed;
  static constexpr auto kAcquire = rl::mo_acquire;
  static constexpr auto kRelease = rl::mo_release;
  static constexpr auto kAcqRel = rl::mo_acq_rel;
  static constexpr auto kSeqCst = rl::mo_seq_cst;

  static constexpr std::size_t kCacheLine = alignof(void*);  // its allocator knows no larger alignment

  static void fence(rl::memory_order order) { rl::atomic_thread_fence(order, $); }
};

/// Twin: an exchange that orders nothing.
struct RelaxedExchange : RelacyAtomics {
  static constexpr auto kAcqRel = rl::mo_relaxed;
};

/// Twin: a store that publishes nothing.
struct RelaxedStore : RelacyAtomics {
  static constexpr auto kRelease = rl::mo_relaxed;
};

/// Twin: a load that receives nothing.
struct RelaxedLoad : RelacyAtomics {
  static constexpr auto kAcquire = rl::mo_relaxed;
};

/// Twin: announcements that the two sides may see in different orders.
struct WeakAnnouncements : RelacyAtomics {
  static constexpr auto kSeqCst = rl::mo_relaxed;
};

/// Twin: fences that do nothing.
struct NoFences : RelacyAtomics {
  static void fence(rl::memory_order) {}
};

/// Swallows relacy's reports. (A string stream would grow inside a simulation, on relacy's own heap.)
class Nowhere : public std::streambuf {
  int overflow(int character) override { return character; }
};

/// Runs a model; true if no execution of it went wrong. `full`: every interleaving, otherwise random ones.
template <class Model>
[[nodiscard]] bool holds(bool full, rl::iteration_t iterations) {
  Nowhere nowhere;
  std::ostream quiet(&nowhere);
  rl::test_params parameters;
  parameters.search_type = full ? rl::fair_full_search_scheduler_type : rl::random_scheduler_type;
  parameters.iteration_count = iterations;
  parameters.output_stream = &quiet;
  parameters.progress_stream = &quiet;
  return rl::simulate<Model>(parameters);
}

}  // namespace tm485::model
