// Wrong bits: independent ones or bursts, by a seed; and those patterns of them that CRC and strict parsing let pass, drawn by
// themselves for importance sampling.
#pragma once

#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <span>

#include "judge.hpp"

namespace residual {

/// xoshiro256**, seeded by splitmix64.
class Random {
 public:
  explicit Random(std::uint64_t seed) {
    for (std::uint64_t& word : state_) {
      seed += 0x9E3779B97F4A7C15;
      std::uint64_t z = seed;
      z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9;
      z = (z ^ (z >> 27)) * 0x94D049BB133111EB;
      word = z ^ (z >> 31);
    }
  }
  std::uint64_t next() {
    const std::uint64_t result = std::rotl(state_[1] * 5, 7) * 9;
    const std::uint64_t shifted = state_[1] << 17;
    state_[2] ^= state_[0];
    state_[3] ^= state_[1];
    state_[1] ^= state_[2];
    state_[0] ^= state_[3];
    state_[2] ^= shifted;
    state_[3] = std::rotl(state_[3], 45);
    return result;
  }
  /// 0 <= x < 1.
  double uniform() { return static_cast<double>(next() >> 11) * 0x1p-53; }
  /// 0 .. below - 1.
  std::uint32_t below(std::uint32_t below) {
    return static_cast<std::uint32_t>(((next() >> 32) * below) >> 32);
  }

 private:
  std::array<std::uint64_t, 4> state_{};
};

/// A line: each bit is wrong with `bit_error_rate`; or a burst begins in a frame with `burst_rate`, is up to `burst_bits` long,
/// and half of its bits are wrong.
struct Line {
  double bit_error_rate = 0;
  double burst_rate = 0;
  std::uint32_t burst_bits = 0;
};

/// What the line does to bytes as they come.
class Noise {
 public:
  Noise(const Line& line, Random& random) : line_(line), random_(random) {
    if (line.bit_error_rate > 0) per_log_ = 1 / std::log1p(-line.bit_error_rate);
    skip_ = gap();
  }

  /// Makes bits wrong. True if any is.
  bool disturb(std::span<std::uint8_t> bytes) {
    if (line_.burst_rate > 0) return random_.uniform() < line_.burst_rate && burst(bytes);
    const std::uint64_t bits = bytes.size() * 8;
    if (skip_ >= bits) {
      skip_ -= bits;
      return false;
    }
    for (; skip_ < bits; skip_ += 1 + gap()) bytes[skip_ / 8] ^= static_cast<std::uint8_t>(1U << skip_ % 8);
    skip_ -= bits;
    return true;
  }

  /// A burst that begins or ends within the bytes, or both.
  bool burst(std::span<std::uint8_t> bytes) {
    const auto bits = static_cast<std::uint32_t>(bytes.size() * 8);
    const std::uint32_t length = 2 + random_.below(line_.burst_bits - 1);
    const std::uint32_t end = 1 + random_.below(bits + length - 1);  // behind its last bit
    bool any = false;
    std::uint64_t coin = 0;
    for (std::uint32_t i = 0; i < length; ++i, coin >>= 1) {
      if (i % 64 == 0) coin = random_.next();
      if (end < i + 1 || end - i > bits || (coin & 1U) == 0) continue;
      const std::uint32_t at = end - i - 1;
      bytes[at / 8] ^= static_cast<std::uint8_t>(1U << at % 8);
      any = true;
    }
    return any;
  }

 private:
  std::uint64_t gap() {
    if (per_log_ == 0) return std::numeric_limits<std::uint64_t>::max() / 2;
    return static_cast<std::uint64_t>(std::log(1 - random_.uniform()) * per_log_);
  }

  Line line_;
  Random& random_;
  double per_log_ = 0;
  std::uint64_t skip_ = 0;
};

/// Patterns of wrong bits within `open` that the exclusive or lets pass, as often as the line makes each among these.
class Undetected {
 public:
  Undetected(const Line& line, const Bytes& open, Random& random)
      : line_(line), open_(open), random_(random), noise_(line, random) {
    const double p = line.bit_error_rate;
    for (unsigned column = 0; column < 8; ++column) {
      for (const std::uint8_t mask : open) rows_[column] += (mask >> column) & 1U;
      // All of its open bits right, of what leaves its parity even.
      const double m = rows_[column];
      clean_[column] = std::pow(1 - p, m) / ((1 + std::pow(1 - 2 * p, m)) / 2);
    }
    all_clean_[8] = 1;
    for (unsigned column = 8; column-- > 0;) all_clean_[column] = all_clean_[column + 1] * clean_[column];
  }

  Bytes draw() {
    Bytes wrong{};
    if (line_.burst_rate > 0) {
      do {
        wrong = {};
        ++tried_;
      } while (!noise_.burst(wrong) || !passes(wrong, open_));
      return wrong;
    }
    bool any = false;
    for (unsigned column = 0; column < 8; ++column) {
      const double chance = any ? 1 - clean_[column] : (1 - clean_[column]) / (1 - all_clean_[column]);
      if (random_.uniform() >= chance) continue;
      any = true;
      fill(wrong, column);
    }
    return wrong;
  }
  /// Bursts that were drawn until now.
  [[nodiscard]] std::uint64_t tried() const { return tried_; }

 private:
  /// Two wrong bits of a column, or four, or ...: each number as often as the line makes it.
  void fill(Bytes& wrong, unsigned column) {
    const double p = line_.bit_error_rate;
    const double odds = p / (1 - p) * (p / (1 - p));
    std::array<double, kBytes> weight{};
    double sum = 0;
    double ways = 1;  // m over n
    for (unsigned n = 1; n <= rows_[column]; ++n) {
      ways = ways * (rows_[column] - n + 1) / n;
      if (n % 2 == 0) sum += weight[n] = ways * std::pow(odds, n / 2 - 1.0);
    }
    double left = random_.uniform() * sum;
    unsigned want = 2;
    while (want + 2 <= rows_[column] && left >= weight[want]) {
      left -= weight[want];
      want += 2;
    }
    unsigned rows = rows_[column];
    for (std::size_t i = 0; i < kBytes; ++i) {
      if (((open_[i] >> column) & 1U) == 0) continue;
      if (random_.below(rows--) >= want) continue;
      wrong[i] ^= static_cast<std::uint8_t>(1U << column);
      --want;
    }
  }

  Line line_;
  Bytes open_;
  Random& random_;
  Noise noise_;
  std::uint64_t tried_ = 0;
  std::array<unsigned, 8> rows_{};
  std::array<double, 8> clean_{};
  std::array<double, 9> all_clean_{};
};

}  // namespace residual
