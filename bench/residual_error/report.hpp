// From counts to rates with their bounds, as a table or as JSON.
#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "judge.hpp"
#include "noise.hpp"
#include "run.hpp"
#include "statistics.hpp"

namespace residual {

struct NamedLine {
  std::string_view name;
  Line line;
};

/// Patterns that a check lets pass, without a bus.
struct Patterns {
  double weight = 0;      ///< how often the line makes one of them, per frame
  double weight_low = 0;  ///< 95 %; the same where it is computed
  double weight_high = 0;
  std::uint64_t drawn = 0;
  std::uint64_t dangerous = 0;  ///< of those drawn

  /// Per frame. Where the weight itself was counted, the bounds of both are multiplied.
  [[nodiscard]] double rate() const {
    return weight * static_cast<double>(dangerous) / static_cast<double>(drawn);
  }
  [[nodiscard]] Interval bounds() const;

  std::vector<Bytes> bursts;  ///< those drawn, of a line with bursts
};

struct BothPatterns {
  Patterns crc;
  Patterns strict;
};

struct Result {
  NamedLine line;
  BothPatterns patterns;
  Counts natural;
  Counts steady;
  Counts start_up;
};

/// Draws `draws` patterns for CRC alone and for strict parsing, and judges how wrong their position is.
[[nodiscard]] BothPatterns count_patterns(const Line& line, std::uint64_t draws, std::uint64_t seed);

void print_table(const std::vector<Result>& results, const Counts& clean);
void print_json(const std::vector<Result>& results, const Counts& clean);

/// False if the judge and core disagree, a sample was off by more than it said, or a good reading was refused.
[[nodiscard]] bool sound(const std::vector<Result>& results, const Counts& clean);

}  // namespace residual
