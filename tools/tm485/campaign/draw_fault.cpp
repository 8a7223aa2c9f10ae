// The faults of a run: which, how strong, and when. docs/fault-plans.md has the table of the kinds.
#include <algorithm>
#include <array>
#include <cmath>

#include "campaign/run_setup.hpp"

namespace tm485::cli::campaign {

using sim::FaultKind;
using sim::FaultLine;

sim::FaultLine draw_fault(Dice& dice, Time length) {
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
    line.from = dice.span_us(Time{0}, length);
    line.until = line.from + std::max<Time>(dice.span_us(shortest, longest), std::chrono::microseconds(1));
  };
  const auto rarely = [&] {
    if (dice.once_in(8)) {
      line.every = dice.span_us(std::chrono::microseconds(500), std::chrono::milliseconds(50));
    } else {
      line.probability = dice.decade(-4.0, -1.5);
    }
  };
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
      if (dice.once_in(3)) {  // from a good rate to one that is off by some percent
        value[0] = static_cast<double>(dice.below(200'000) - 100'000) * 1e-6;
        value[2] = static_cast<double>(10'000 + dice.below(50'000)) * 1e-6;
        window(Time{0}, length);
      } else {
        value[1] = static_cast<double>(dice.below(120'000) - 60'000) * 1e-6;
        window(Time{0}, short_end);
      }
      break;
    case FaultKind::echo:
      window(Time{0}, short_end);
      break;
    case FaultKind::talker:
      value[0] = static_cast<double>(
          dice.span_us(std::chrono::microseconds(300), std::chrono::milliseconds(20)).count());
      value[1] = static_cast<double>(1 + dice.below(8));
      break;
    case FaultKind::babble:
      window(Time{0}, short_end);
      break;
    case FaultKind::restart:
      line.from = dice.span_us(std::chrono::milliseconds(1), length);
      value[0] = static_cast<double>(
          dice.span_us(std::chrono::microseconds(10), std::chrono::milliseconds(5)).count());
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

}  // namespace tm485::cli::campaign
