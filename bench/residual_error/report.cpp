#include "report.hpp"

#include <algorithm>
#include <cinttypes>
#include <cstdio>

#include "judge.hpp"

namespace residual {
namespace {

Patterns draw(const Line& line, const Bytes& open, std::uint64_t draws, Random& random) {
  Patterns patterns;
  // A burst that passes is one of thousands: fewer of them, so that it takes no longer.
  patterns.drawn = line.burst_rate > 0 ? std::max<std::uint64_t>(draws / 200, 200) : draws;
  Undetected undetected(line, open, random);
  for (std::uint64_t i = 0; i < patterns.drawn; ++i) {
    const auto position = static_cast<std::int64_t>(random.next() >> (64 - kPositionBits));
    const Bytes wrong = undetected.draw();
    if (line.burst_rate > 0) patterns.bursts.push_back(wrong);
    Bytes frame = id3_frame(position);
    for (std::size_t k = 0; k < kBytes; ++k) frame[k] ^= wrong[k];
    patterns.dangerous += apart(read_position(frame), position) > kDangerous ? 1U : 0U;
  }
  if (line.burst_rate > 0) {
    const Interval share = clopper_pearson(patterns.drawn, undetected.tried(), 0.0125);
    patterns.weight =
        line.burst_rate * static_cast<double>(patterns.drawn) / static_cast<double>(undetected.tried());
    patterns.weight_low = line.burst_rate * share.low;
    patterns.weight_high = line.burst_rate * share.high;
  } else {
    patterns.weight = patterns.weight_low = patterns.weight_high =
        residual::undetected(line.bit_error_rate, open);
  }
  return patterns;
}

/// With a weight that was counted the two errors share the 5 %.
Interval weighted(const Patterns& patterns, std::uint64_t hits, std::uint64_t tries) {
  const bool counted = patterns.weight_low != patterns.weight_high;
  const Interval share = clopper_pearson(hits, tries, counted ? 0.0125 : 0.025);
  return {patterns.weight_low * share.low, patterns.weight_high * share.high};
}

double share(std::uint64_t part, std::uint64_t all) {
  return all == 0 ? 0 : static_cast<double>(part) / static_cast<double>(all);
}

void print_rate(const char* what, double rate, Interval bounds) {
  std::printf("  %-46s %9.2e  (%.2e to %.2e)\n", what, rate, bounds.low, bounds.high);
}

double better(const Result& result) {
  return result.patterns.strict.bounds().low /
         weighted(result.patterns.strict, result.steady.forced_dangerous, result.steady.forced).high;
}

}  // namespace

Interval Patterns::bounds() const { return weighted(*this, dangerous, drawn); }

BothPatterns count_patterns(const Line& line, std::uint64_t draws, std::uint64_t seed) {
  Random random(seed);
  return {draw(line, kAll, draws, random), draw(line, kOpen, draws, random)};
}

void print_table(const std::vector<Result>& results, const Counts& clean) {
  std::puts(
      "Undetected samples per frame, with 95 % bounds. Dangerous: off by more than 64 counts of 17 bits, "
      "0.18 degrees.");
  for (const Result& r : results) {
    const Patterns& strict = r.patterns.strict;
    std::printf("\n%s\n", r.line.name.data());
    const double frames = static_cast<double>(r.natural.frames);
    const auto counted = [&](std::uint64_t hits) { return static_cast<double>(hits) / frames; };
    print_rate("CRC alone, wrong: patterns", r.patterns.crc.weight,
               {r.patterns.crc.weight_low, r.patterns.crc.weight_high});
    print_rate("CRC alone, dangerous: patterns", r.patterns.crc.rate(), r.patterns.crc.bounds());
    print_rate("strict, wrong: patterns", strict.weight, {strict.weight_low, strict.weight_high});
    print_rate("strict, dangerous: patterns", strict.rate(), strict.bounds());
    const Counts& s = r.steady;
    print_rate("strict and gate, wrong: patterns put in", strict.weight * share(s.forced_wrong, s.forced),
               weighted(strict, s.forced_wrong, s.forced));
    print_rate("strict and gate, dangerous: patterns put in",
               strict.weight * share(s.forced_dangerous, s.forced),
               weighted(strict, s.forced_dangerous, s.forced));
    print_rate("the same within 16 frames of a restart",
               strict.weight * share(r.start_up.forced_dangerous, r.start_up.forced),
               weighted(strict, r.start_up.forced_dangerous, r.start_up.forced));
    std::printf("  dangerous, strict parsing against the gate: at least %.3g times fewer\n", better(r));
    const Counts& n = r.natural;
    std::printf(
        "  counted in %.3g frames: CRC %" PRIu64 " wrong (%.2e), %" PRIu64 " dangerous; strict %" PRIu64
        " wrong (%.2e), %" PRIu64 " dangerous; gate %" PRIu64 " wrong, %" PRIu64 " dangerous (below %.2e)\n",
        frames, n.crc_wrong, counted(n.crc_wrong), n.crc_dangerous, n.strict_wrong, counted(n.strict_wrong),
        n.strict_dangerous, n.gate_wrong, n.gate_dangerous, clopper_pearson(n.gate_dangerous, n.frames).high);
    std::printf("  fresh %.4f of the frames, largest error %" PRIu64 " counts, beyond the half-width %" PRIu64
                " (with more wrong readings than it counts: %" PRIu64 "), held back %" PRIu64
                ", start-ups %" PRIu64 ", discontinuities %" PRIu64 "; put in %" PRIu64 " and %" PRIu64 "\n",
                counted(n.fresh), n.largest, n.beyond + s.beyond + r.start_up.beyond,
                n.beyond_by_more + s.beyond_by_more + r.start_up.beyond_by_more, n.held_back, n.startups,
                n.discontinuities, s.forced, r.start_up.forced);
  }
  std::printf("\nclean line, one frame in ten missing, at the greatest speed and acceleration, %" PRIu64
              " frames: held back %" PRIu64 ", discontinuities %" PRIu64 "\n",
              clean.frames, clean.held_back, clean.discontinuities);
}

void print_json(const std::vector<Result>& results, const Counts& clean) {
  std::printf("{\n  \"lines\": [");
  for (std::size_t i = 0; i < results.size(); ++i) {
    const Result& r = results[i];
    const Patterns& strict = r.patterns.strict;
    const auto rate = [](const char* name, double value, Interval bounds) {
      std::printf("     \"%s\": {\"rate\": %.6g, \"low\": %.6g, \"high\": %.6g},\n", name, value, bounds.low,
                  bounds.high);
    };
    std::printf(
        "%s\n    {\"line\": \"%s\", \"bit_error_rate\": %g, \"burst_rate\": %g, \"burst_bits\": %" PRIu32
        ",\n",
        i == 0 ? "" : ",", r.line.name.data(), r.line.line.bit_error_rate, r.line.line.burst_rate,
        r.line.line.burst_bits);
    rate("crc_wrong", r.patterns.crc.weight, {r.patterns.crc.weight_low, r.patterns.crc.weight_high});
    rate("crc_dangerous", r.patterns.crc.rate(), r.patterns.crc.bounds());
    rate("strict_wrong", strict.weight, {strict.weight_low, strict.weight_high});
    rate("strict_dangerous", strict.rate(), strict.bounds());
    const auto put_in = [&](const char* name, std::uint64_t hits, std::uint64_t tries) {
      rate(name, strict.weight * share(hits, tries), weighted(strict, hits, tries));
    };
    put_in("gate_wrong", r.steady.forced_wrong, r.steady.forced);
    put_in("gate_dangerous", r.steady.forced_dangerous, r.steady.forced);
    put_in("gate_dangerous_start_up", r.start_up.forced_dangerous, r.start_up.forced);
    const Counts& n = r.natural;
    std::printf("     \"fewer_than_strict\": %.4g,\n     \"counted\": {", better(r));
    const auto count = [](const char* name, std::uint64_t value, const char* end = ", ") {
      std::printf("\"%s\": %" PRIu64 "%s", name, value, end);
    };
    count("frames", n.frames);
    count("changed", n.changed);
    count("fresh", n.fresh);
    count("crc_wrong", n.crc_wrong);
    count("crc_dangerous", n.crc_dangerous);
    count("strict_wrong", n.strict_wrong);
    count("strict_dangerous", n.strict_dangerous);
    count("gate_wrong", n.gate_wrong);
    count("gate_position_wrong", n.position_wrong);
    count("gate_dangerous", n.gate_dangerous);
    count("largest_error", n.largest);
    count("beyond_half_width", n.beyond + r.steady.beyond + r.start_up.beyond);
    count("beyond_by_more_wrong_readings",
          n.beyond_by_more + r.steady.beyond_by_more + r.start_up.beyond_by_more);
    count("held_back", n.held_back);
    count("startups", n.startups);
    count("discontinuities", n.discontinuities);
    count("put_in", r.steady.forced);
    count("put_in_dangerous", r.steady.forced_dangerous);
    count("put_in_start_up", r.start_up.forced);
    count("put_in_start_up_dangerous", r.start_up.forced_dangerous, "}}");
  }
  std::printf("\n  ],\n  \"clean\": {\"frames\": %" PRIu64 ", \"held_back\": %" PRIu64
              ", \"discontinuities\": %" PRIu64 "}\n}\n",
              clean.frames, clean.held_back, clean.discontinuities);
}

bool sound(const std::vector<Result>& results, const Counts& clean) {
  bool good = clean.held_back == 0 && clean.discontinuities == 0 && clean.beyond == 0;
  for (const Result& r : results) {
    for (const Counts* counts : {&r.natural, &r.steady, &r.start_up})
      good = good && counts->mismatch == 0 && counts->beyond == 0;
  }
  return good;
}

}  // namespace residual
