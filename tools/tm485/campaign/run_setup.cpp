#include "campaign/run_setup.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "quantity.hpp"
#include "tm485/sim/random.hpp"

namespace tm485::cli::campaign {
namespace {

using sim::FaultKind;
using sim::FaultLine;

/// The encoder of every run boots as long as its profiles promise at least; a shorter silence would be no restart.
constexpr Time kBoot = std::chrono::milliseconds(55);

class Dice {
 public:
  explicit Dice(std::uint64_t seed) : random_(seed) {}
  std::int64_t below(std::int64_t limit) { return random_.below(limit); }
  bool once_in(std::int64_t n) { return below(n) == 0; }
  double between(double low, double high) { return low + (high - low) * random_.unit(); }
  /// 10 to a power between the two.
  double decade(double low, double high) { return std::pow(10.0, between(low, high)); }
  Time span(Time low, Time high) {
    return low + Time{std::llround(between(0.0, 1.0) * static_cast<double>((high - low).count()))};
  }
  std::uint64_t seed() { return random_.next() >> 40; }

 private:
  sim::Random random_;
};

std::string draw_motion(Dice& dice) {
  const double start = std::round(dice.between(-5.0, 5.0) * 1e3) * 1e-3;
  const auto rpm = std::llround(dice.between(-5'500.0, 5'500.0));
  switch (dice.below(4)) {
    case 0:
      return fmt::format("motion=constant:{},start={}", rpm, start);
    case 1: {
      // Its top speed is 2 pi times amplitude and frequency; kept below 5000 rpm.
      const auto hz = std::llround(dice.between(1.0, 40.0));
      const double amplitude = std::round(dice.between(0.01, 13.0 / static_cast<double>(hz)) * 1e4) * 1e-4;
      return fmt::format("motion=sine:{}:{},start={}", amplitude, hz, start);
    }
    case 2:
      return fmt::format("motion=trapezoid:{}:{}:{},start={}", rpm, std::llround(dice.decade(3.0, 6.0)), 0.05,
                         start);
    default:
      return fmt::format("motion=constant:0,start={}", start);
  }
}

/// Times of a plan in whole microseconds: a plan is to be read.
Time in_us(Time time) { return Time{time.count() / 1'000 * 1'000}; }

FaultLine draw_fault(Dice& dice, Time length) {
  constexpr std::array<FaultKind, 22> kOften{
      FaultKind::bits,    FaultKind::bits,     FaultKind::bits,    FaultKind::burst,        FaultKind::burst,
      FaultKind::stuck,   FaultKind::lose,     FaultKind::lose,    FaultKind::extra,        FaultKind::late,
      FaultKind::t2,      FaultKind::wrong_cf, FaultKind::overrun, FaultKind::late_release, FaultKind::noise,
      FaultKind::swapped, FaultKind::baud,     FaultKind::echo,    FaultKind::talker,       FaultKind::babble,
      FaultKind::restart, FaultKind::alarm};
  FaultLine line;
  line.kind = kOften[static_cast<std::size_t>(dice.below(kOften.size()))];
  if (dice.once_in(25)) line.kind = FaultKind::frozen;
  line.seed = dice.seed();
  const Time short_end = std::min<Time>(length, std::chrono::milliseconds(8));
  const auto window = [&](Time shortest, Time longest) {
    line.from = in_us(dice.span(Time{0}, length));
    line.until =
        line.from + std::max<Time>(in_us(dice.span(shortest, longest)), std::chrono::microseconds(1));
  };
  const auto rarely = [&] { line.probability = dice.decade(-4.0, -1.5); };
  auto& value = line.values;
  for (std::size_t k = 0; k < value.size(); ++k) value[k] = sim::info_of(line.kind).parameters[k].otherwise;
  switch (line.kind) {
    case FaultKind::bits:
      value[0] = dice.once_in(2) ? dice.decade(-6.0, -3.0) : 0.0;
      value[1] = dice.decade(-6.0, -2.5);
      if (dice.once_in(2)) window(Time{0}, length);
      break;
    case FaultKind::burst:
      value[0] = static_cast<double>(1 + dice.below(40));
      value[1] = static_cast<double>(dice.below(3));
      rarely();
      break;
    case FaultKind::stuck:
      value[0] = static_cast<double>(dice.below(8));
      value[1] = static_cast<double>(dice.below(2));
      window(Time{0}, short_end);
      break;
    case FaultKind::lose:
      value[0] = dice.once_in(3) ? 1.0 : dice.decade(-4.0, -1.0);
      if (dice.once_in(2)) value[1] = dice.decade(-5.0, -2.0);
      if (dice.once_in(4)) value[2] = dice.decade(-5.0, -2.0);
      if (value[0] == 1.0) window(Time{0}, dice.once_in(8) ? std::chrono::milliseconds(70) : short_end);
      break;
    case FaultKind::extra:
      value[0] = dice.decade(-5.0, -2.0);
      value[1] = static_cast<double>(dice.below(3));
      break;
    case FaultKind::late:
      value[0] = static_cast<double>(100 * (1 + dice.below(400)));
      rarely();
      break;
    case FaultKind::t2:
      value[0] = static_cast<double>(100 * dice.below(200));
      rarely();
      break;
    case FaultKind::late_release:
      value[0] = static_cast<double>(100 * (1 + dice.below(150)));
      rarely();
      break;
    case FaultKind::wrong_cf:
    case FaultKind::overrun:
      rarely();
      break;
    case FaultKind::noise:
      value[0] = dice.decade(-3.0, 0.0);
      window(Time{0}, short_end);
      break;
    case FaultKind::swapped:
      value[0] = static_cast<double>(dice.below(2));
      window(Time{0}, short_end);
      break;
    case FaultKind::baud:
      value[1] = static_cast<double>(dice.below(120'000) - 60'000) * 1e-6;
      window(Time{0}, short_end);
      break;
    case FaultKind::echo:
      window(Time{0}, short_end);
      break;
    case FaultKind::talker:
      value[0] = static_cast<double>(
          in_us(dice.span(std::chrono::microseconds(300), std::chrono::milliseconds(20))).count());
      value[1] = static_cast<double>(1 + dice.below(8));
      break;
    case FaultKind::babble:
      window(Time{0}, short_end);
      break;
    case FaultKind::restart:
      line.from = in_us(dice.span(std::chrono::milliseconds(1), length));
      value[0] = static_cast<double>(
          in_us(dice.span(std::chrono::microseconds(10), std::chrono::milliseconds(5))).count());
      break;
    case FaultKind::alarm:
      value[0] = static_cast<double>(dice.below(256));
      window(Time{0}, length);
      break;
    case FaultKind::frozen:
      window(Time{0}, short_end);
      break;
  }
  return line;
}

Time period_of(const RunSetup& setup) {
  if (setup.period > Time{0}) return setup.period;
  return setup.id == DataId::everything ? Time{62'500} : Time{40'000};
}

}  // namespace

std::string RunSetup::text() const {
  return fmt::format("profile={}, ID{}, period {}, start jitter {}, {}, {}{} cycles", profile,
                     id == DataId::everything ? 3 : 0, format_time(period_of(*this)),
                     format_time(start_jitter), motion, eeprom ? "EEPROM reads, " : "", cycles);
}

sim::SimOptions RunSetup::sim_options() const {
  // Both were drawn here or come from a parsed plan, so the text is good.
  sim::SimOptions options =
      sim::parse_sim_options(fmt::format("profile={},{},seed={}", profile, motion, seed + run))
          .value_or(sim::SimOptions{});
  options.encoder.boot_time = kBoot;
  options.port.start_jitter = start_jitter;
  options.port.jitter_margin = start_jitter;
  options.faults = plan;
  return options;
}

RunSetup draw_run(std::uint64_t seed, std::uint64_t run, std::uint64_t cycles,
                  const std::optional<sim::FaultPlan>& plan) {
  Dice dice(seed * 0x9E3779B97F4A7C15u + run);
  RunSetup setup;
  setup.seed = seed;
  setup.run = run;
  if (cycles != 0) setup.cycles = cycles;
  constexpr std::array<const char*, 5> kProfiles{"tm485_17", "tm485_23", "tformat_17", "tformat_23",
                                                 "tformat_17_battery"};
  setup.profile = kProfiles[static_cast<std::size_t>(dice.below(kProfiles.size()))];
  setup.id = dice.once_in(3) ? DataId::single_turn : DataId::everything;
  if (dice.once_in(2))
    setup.period = in_us(dice.span(std::chrono::microseconds(63), std::chrono::microseconds(250)));
  if (dice.once_in(3)) setup.start_jitter = Time{dice.below(3'000)};
  // Where the EEPROM lets the cycle go on, and the period has room for another exchange.
  setup.eeprom = setup.profile.starts_with("tformat") && dice.once_in(3);
  if (setup.eeprom)
    setup.period = in_us(dice.span(std::chrono::microseconds(120), std::chrono::microseconds(250)));
  setup.motion = draw_motion(dice);
  setup.shaft = setup.sim_options().motion;
  const Time length = period_of(setup) * static_cast<std::int64_t>(setup.cycles);
  if (plan) {
    for (FaultLine line : plan->lines()) {
      const std::uint64_t own = dice.seed();
      if (!line.seed) line.seed = own;
      (void)setup.plan.add(line);
    }
  } else {
    for (auto faults = dice.below(5); faults > 0; --faults) (void)setup.plan.add(draw_fault(dice, length));
  }
  return setup;
}

}  // namespace tm485::cli::campaign
