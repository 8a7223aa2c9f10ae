// Cyclictest: runs rt-tests' cyclictest, the wake-up measure that everybody knows, and reads its histogram.
#pragma once

#include <cstdint>
#include <expected>
#include <string>
#include <string_view>
#include <vector>

#include "problem.hpp"
#include "tm485/time.hpp"

namespace tm485::cli {

struct CyclictestOptions {
  Time period{1'000'000};  ///< whole microseconds count
  Time duration{2'000'000'000};
  int priority = 80;  ///< 0: without real-time scheduling
  int cpu = -1;       ///< -1: any
};

/// Latencies in whole microseconds, as cyclictest has them.
class CyclictestResult {
 public:
  /// Adds `count` wake-ups that were `us` late.
  void add(std::uint64_t us, std::uint64_t count);
  void set_maximum(std::uint64_t us) noexcept { maximum_ = us; }
  void set_overflows(std::uint64_t count) noexcept { overflows_ = count; }

  [[nodiscard]] std::uint64_t count() const noexcept { return count_ + overflows_; }
  [[nodiscard]] Time minimum() const noexcept;
  [[nodiscard]] Time maximum() const noexcept { return Time{static_cast<std::int64_t>(maximum_) * 1'000}; }
  /// The bin in which the fraction 0..1 lies; the maximum for what lies beyond the histogram.
  [[nodiscard]] Time percentile(double fraction) const noexcept;

 private:
  struct Bin {
    std::uint64_t us, count;
  };
  std::vector<Bin> bins_;
  std::uint64_t count_ = 0;
  std::uint64_t overflows_ = 0;
  std::uint64_t maximum_ = 0;
};

/// What `cyclictest -q -h N` has printed. An error if that is no histogram.
[[nodiscard]] std::expected<CyclictestResult, Problem> parse_cyclictest(std::string_view text);

/// Full path of cyclictest in PATH, or empty.
[[nodiscard]] std::string find_cyclictest();

/// Runs it to its end; kills it when it takes ten seconds longer than it should, or when the user stops the command.
[[nodiscard]] std::expected<CyclictestResult, Problem> run_cyclictest(const std::string& path,
                                                                      const CyclictestOptions& options);

}  // namespace tm485::cli
