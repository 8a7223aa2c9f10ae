// Samples and statistics.
#include "tm485/c/sample.h"

#include <algorithm>
#include <cstddef>
#include <type_traits>

#include "convert.hpp"
#include "tm485/bus/statistics.hpp"
#include "tm485/motion/sample.hpp"

namespace tm485::c {
namespace {

static_assert(std::has_unique_object_representations_v<tm485_sample> &&
              std::has_unique_object_representations_v<tm485_statistics>);
static_assert(kErrcCount <= TM485_ERRC_ROOM);
static_assert(Histogram::kBins == TM485_BINS);
static_assert(value(Quality::invalid) == TM485_QUALITY_INVALID &&
              value(Quality::held) == TM485_QUALITY_HELD &&
              value(Quality::extrapolated) == TM485_QUALITY_EXTRAPOLATED &&
              value(Quality::fresh) == TM485_QUALITY_FRESH);
static_assert(value(AlarmLevel::none) == TM485_ALARM_NONE &&
              value(AlarmLevel::warning) == TM485_ALARM_WARNING &&
              value(AlarmLevel::fault) == TM485_ALARM_FAULT);

void copy(const TimeStatistic& from, tm485_time_statistic& to) noexcept {
  to.minimum = from.minimum().count();
  to.mean = from.mean().count();
  to.maximum = from.maximum().count();
  to.origin = from.histogram().origin.count();
  std::ranges::copy(from.histogram().bins, to.bins);
  to.count = from.count();
  to.shift = from.histogram().shift;
}

}  // namespace

void to_c(const Sample& sample, tm485_sample& to) noexcept {
  to.position = sample.position();
  to.latch_time = sample.latch_time().count();
  to.sequence = sample.sequence();
  to.single_turn = sample.single_turn();
  to.turns = sample.turns();
  to.electrical_angle = sample.electrical_angle();
  to.latch_uncertainty_ns = static_cast<std::uint32_t>(sample.latch_uncertainty().count());
  to.announced_hold_ns = static_cast<std::uint32_t>(sample.announced_hold().count());
  to.half_width = sample.half_width();
  to.discontinuities = sample.discontinuities();
  to.status = sample.status().bits();
  to.enid = sample.enid();
  to.id = value(sample.id());
  to.quality = value(sample.quality());
  to.alarm = value(sample.alarm());
  to.referenced = flag(sample.referenced());
  to.has_position = flag(sample.has_position());
}

void to_c(const Statistics& from, tm485_statistics& to) noexcept {
  to.cycles = from.cycles;
  to.good = from.good;
  to.failed = from.failed;
  to.slips = from.slips;
  to.skipped = from.skipped;
  to.background = from.background;
  to.stolen = from.stolen;
  to.displaced = from.displaced;
  to.starved = from.starved;
  to.longest_wait = from.longest_wait;
  to.startups = from.startups;
  to.startup_failures = from.startup_failures;
  to.lost = from.lost;
  to.restarts = from.restarts;
  to.invalidated = from.invalidated;
  to.discontinuities = from.discontinuities;
  to.stray_bytes = from.stray_bytes;
  to.reserved_status = from.reserved_status;
  to.warnings = from.warnings;
  to.faults = from.faults;
  to.servo_ticks = from.servo_ticks;
  to.servo_locks = from.servo_locks;
  std::ranges::fill(std::ranges::copy(from.errors, to.errors).out, std::ranges::end(to.errors), 0U);
  copy(from.t1, to.t1);
  copy(from.reply_delay, to.reply_delay);
  copy(from.servo_phase, to.servo_phase);
}

}  // namespace tm485::c
