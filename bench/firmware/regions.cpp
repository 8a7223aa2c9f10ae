// What is counted in the emulator, region by region: from the first instruction of region_begin() to the first of
// region_end(), less that of an empty region. Prints a region's name each time that it runs; the emulator's plugin
// counts. The answer of run() is 0 if everything that ran also did its work.
#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>

#include "rig.hpp"
#include "start.hpp"
#include "tm485/bus/eeprom.hpp"
#include "tm485/motion/estimator.hpp"
#include "tm485/motion/estimator_fixed.hpp"
#include "tm485/sync/latest_value.hpp"

extern "C" {
// noipa: the compiler assumes nothing of them, so nothing moves in or out of a region.
[[gnu::noipa]] void region_begin();
[[gnu::noipa]] void region_end();
void region_begin() { asm volatile("" ::: "memory"); }
void region_end() { asm volatile("" ::: "memory"); }
}

namespace tm485::cost {
namespace {

constexpr unsigned kRuns = 16;

bool all_good = true;
void require(bool held) {
  if (!held) all_good = false;
}

/// Both are called through pointers; the region's call counts as part of it.
using Step = void (*)();
[[gnu::noipa]] void nothing() {}
[[gnu::noipa]] void count(const char* name, Step prepare, Step region) {
  for (unsigned i = 0; i < kRuns; ++i) {
    say(name);
    prepare();
    region_begin();
    region();
    region_end();
  }
}

void count_empty() {
  for (unsigned i = 0; i < kRuns; ++i) {
    say("empty\n");
    region_begin();
    region_end();
  }
}

// --- The codec ---

// Volatile: what a bus knows only when it runs is no constant here either.
const CompiledProfile* volatile profile = &kProfile;
volatile DataId asked = DataId::everything;
Id3Frame bytes;
std::uint32_t shaft = 0;

/// As functions of their own, called directly.
[[gnu::noipa]] std::expected<Reply, Errc> decode(std::span<const std::uint8_t> from) {
  return Reply::parse(from, asked, *profile);
}
[[gnu::noipa]] std::expected<Frame, Errc> decode_frame(std::span<const std::uint8_t> from) {
  return Frame::parse(from, asked);
}

void next_frame() {
  shaft = (shaft + 0x1235) & 0x1FFFFU;
  bytes = id3_frame(shaft);
}

void count_codec() {
  for (unsigned i = 0; i < kRuns; ++i) {
    say("decode_id3\n");
    next_frame();
    region_begin();
    const auto good = decode(bytes);
    region_end();
    require(good && good->frame().abs() == shaft);
  }
  for (unsigned i = 0; i < kRuns; ++i) {
    say("frame_id3\n");
    next_frame();
    region_begin();
    const auto good = decode_frame(bytes);
    region_end();
    require(good && good->abs() == shaft);
  }
}

// --- The bus ---

Rig timed(true, Time{0});
Rig untimed(false, Time{0});
Rig spacious(true, Time{200'000});
const Sample* newest = nullptr;

template <Rig& rig>
void count_cycle(const char* whole, const char* request, const char* verdict) {
  require(rig.start());
  const auto to_slot = [] { rig.to_slot(); };
  const auto behind_request = [] {
    rig.to_slot();
    rig.request();
  };
  const std::uint32_t before = rig.bus().statistics().good;
  count(whole, to_slot, [] {
    rig.request();
    rig.reply();
  });
  count(request, to_slot, [] { rig.request(); });
  count(verdict, behind_request, [] { rig.reply(); });
  rig.to_slot();
  require(rig.bus().statistics().good >= before + 3 * kRuns && rig.bus().statistics().failed == 0);
  require(rig.bus().latest().quality() == Quality::fresh);
}

void count_bus() {
  count_cycle<timed>("cycle\n", "cycle_request\n", "cycle_reply\n");
  count_cycle<untimed>("cycle_untimed\n", "cycle_request_untimed\n", "cycle_reply_untimed\n");
  const auto new_sample = [] {
    timed.to_slot();
    timed.request();
    timed.reply();
  };
  count("latest_new\n", new_sample, [] { newest = &timed.bus().latest(); });
  count("latest_same\n", nothing, [] { newest = &timed.bus().latest(); });
  require(newest->quality() == Quality::fresh);
}

// --- EEPROM ---

EepromManager manager(kProfile);
std::array<std::uint8_t, 64> contents;

/// To the instant at which a byte of the EEPROM has come.
void to_completion() {
  const std::uint32_t before = spacious.bus().statistics().background;
  while (spacious.bus().statistics().background == before) spacious.run_to_request();
}

void count_eeprom() {
  require(spacious.start());
  require(manager.start_read(0, contents).has_value());
  const auto step = [] { drive(manager, spacious.bus(), spacious.now()); };
  step();
  for (int look = 0; look < 2; ++look) {  // the page register first
    to_completion();
    step();
  }
  count("eeprom_step\n", to_completion, step);
  for (std::size_t i = 0; i < kRuns; ++i) require(contents[i] == i);
  require(manager.progress().retries == 0 && manager.progress().done == kRuns);
}

// --- Crossing contexts ---

LatestValue<Sample> crossing;

void count_crossing() {
  static Sample sample;
  sample = *newest;
  count("latest_value_put\n", nothing, [] { crossing.put(sample); });
  count("latest_value_get\n", [] { crossing.put(sample); }, [] { newest = &crossing.get(); });
  require(newest->sequence() == sample.sequence());
}

// --- The estimators ---

/// 1 kHz at 16 kHz, as tm485::design solves it.
constexpr EstimatorGains kTwo{.period = Time{62'500},
                              .order = 2,
                              .gain = {0.424100041F, 0.115544081F, 0.0F},
                              .covariance = {.pp = 0.0353416689F, .pv = 0.00962867402F, .vv = 0.00612476654F},
                              .process_noise = 0.00193182216F,
                              .measurement_variance = 1.0F / 12.0F};
constexpr EstimatorGains kThree{.period = Time{62'500},
                                .order = 3,
                                .gain = {0.37690419F, 0.0887343287F, 0.010445334F},
                                .covariance = {0.0314086825F, 0.00739452709F, 0.000870444521F, 0.00284363399F,
                                               0.000465759396F, 0.000116663068F},
                                .process_noise = 1.45917911e-05F,
                                .measurement_variance = 1.0F / 12.0F};
constexpr FixedGains kFixedTwo = *FixedGains::from(kTwo);
constexpr FixedGains kFixedThree = *FixedGains::from(kThree);

std::int64_t position = 0;
Time latch{0};

void next_position() {
  position += 410;
  latch += Time{62'500};
}

template <class E>
void settle(E& estimator) {
  for (unsigned i = 0; i < 200; ++i) {
    next_position();
    estimator.update(position, latch);
  }
}

template <class E, E& estimator, class Answer, Answer& answer>
void count_estimator(const char* update, const char* ask) {
  settle(estimator);
  count(update, next_position, [] { estimator.update(position, latch); });
  count(ask, next_position, [] { answer = estimator.at(latch + Time{31'000}); });
  require(estimator.state() == EstimatorState::tracking && answer.valid());
}

Estimator two(kTwo);
Estimator three(kThree);
Estimate answer;
FixedEstimator fixed_two(kFixedTwo);
FixedEstimator fixed_three(kFixedThree);
FixedEstimate fixed_answer;

void count_estimators() {
#if defined(__ARM_FP)
  count_estimator<Estimator, two, Estimate, answer>("estimator_update_2\n", "estimator_at_2\n");
  count_estimator<Estimator, three, Estimate, answer>("estimator_update_3\n", "estimator_at_3\n");
#endif
  count_estimator<FixedEstimator, fixed_two, FixedEstimate, fixed_answer>("fixed_update_2\n", "fixed_at_2\n");
  count_estimator<FixedEstimator, fixed_three, FixedEstimate, fixed_answer>("fixed_update_3\n",
                                                                            "fixed_at_3\n");
}

}  // namespace

int run() {
  count_empty();
  count_codec();
  count_bus();
  count_eeprom();
  count_crossing();
  count_estimators();
  return all_good ? 0 : 1;
}

}  // namespace tm485::cost
