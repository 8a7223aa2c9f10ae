// The kinds of faults.
#include <utility>

#include "tm485/sim/fault_plan.hpp"

namespace tm485::sim {
namespace {

constexpr double kMostGap = 1e6;    // ns: 1 ms
constexpr double kMostSpan = 1e10;  // ns: 10 s
constexpr double kMostRatio = 0.2;

constexpr FaultParameter probability(std::string_view name) {
  return {name, FaultUnit::probability, 0.0, 1.0, 0.0, false};
}
constexpr FaultParameter gap(std::string_view name) {
  return {name, FaultUnit::time, 0.0, kMostGap, 0.0, true};
}
constexpr FaultParameter direction(double otherwise) {
  return {"on", FaultUnit::direction, 0.0, 2.0, otherwise, false};
}
constexpr double kReplies = 1.0;

constexpr std::array<FaultInfo, kFaultKinds> kTable{{
    {FaultKind::bits,
     "bits",
     {{probability("requests"), probability("replies")}},
     false,
     false,
     true,
     true,
     "Bits are wrong, each with this probability"},
    {FaultKind::burst,
     "burst",
     {{{"bits", FaultUnit::count, 1, 256, 0, true}, direction(kReplies)}},
     true,
     true,
     true,
     true,
     "So many bits in a row: the first and the last are wrong, those between them by chance"},
    {FaultKind::stuck,
     "stuck",
     {{{"column", FaultUnit::count, 0, 7, 0, true},
       {"value", FaultUnit::count, 0, 1, 0, true},
       direction(kReplies)}},
     true,
     false,
     true,
     true,
     "One bit column of every byte has this value"},
    {FaultKind::lose,
     "lose",
     {{probability("replies"), probability("characters"), probability("requests")}},
     false,
     false,
     true,
     true,
     "Whole replies, single characters (those behind them close up) or whole requests are lost"},
    {FaultKind::extra,
     "extra",
     {{probability("characters"), direction(kReplies)}},
     false,
     false,
     true,
     true,
     "Before each character, or at the end, there is a random one more with this probability"},
    {FaultKind::late,
     "late",
     {{gap("bytes")}},
     true,
     false,
     false,
     false,
     "A reply pauses for so long in its middle"},
    {FaultKind::t2,
     "t2",
     {{gap("gap")}},
     true,
     true,
     true,
     false,
     "The reply starts so long after the request, whatever the encoder's T2"},
    {FaultKind::wrong_cf,
     "wrong-cf",
     {},
     true,
     false,
     true,
     true,
     "The reply has the CF of another data ID, and the CRC that goes with it"},
    {FaultKind::overrun,
     "overrun",
     {},
     true,
     false,
     false,
     true,
     "The host's receiver loses a character of a reply and says so"},
    {FaultKind::late_release,
     "late-release",
     {{gap("time")}},
     true,
     true,
     false,
     true,
     "The host's driver stays on the line for so much longer, into the reply"},
    {FaultKind::noise,
     "noise-before-reply",
     {{probability("p")}},
     false,
     false,
     false,
     true,
     "The floating line falls for one bit before a reply: a false start bit"},
    {FaultKind::swapped,
     "swapped",
     {{{"wires", FaultUnit::pair, 0.0, 1.0, 0.0, false}}},
     false,
     true,
     false,
     true,
     "A and B are swapped: for both ends, or for what the host receives"},
    {FaultKind::baud,
     "baud",
     {{{"drift", FaultUnit::ratio_rate, -kMostRatio, kMostRatio, 0.0, false},
       {"offset", FaultUnit::ratio, -kMostRatio, kMostRatio, 0.0, false},
       {"max", FaultUnit::ratio, 0.0, kMostRatio, kMostRatio, false}}},
     false,
     false,
     false,
     true,
     "The encoder's bit rate is off by the offset, and drifts away from there up to max"},
    {FaultKind::echo, "echo", {}, false, false, true, false, "The host hears its own requests"},
    {FaultKind::talker,
     "talker",
     {{{"every", FaultUnit::time, 1e3, kMostSpan, 0.0, true},
       {"characters", FaultUnit::count, 1, 32, 1, false}}},
     false,
     false,
     false,
     true,
     "Somebody else sends random characters, after random times of this mean"},
    {FaultKind::babble,
     "babble",
     {},
     false,
     false,
     false,
     true,
     "Somebody else sends random characters without a pause"},
    {FaultKind::restart,
     "restart",
     {{{"off", FaultUnit::time, 1e3, kMostSpan, 1e6, false},
       {"every", FaultUnit::time, 1e6, kMostSpan, 0.0, false}}},
     false,
     false,
     true,
     false,
     "The encoder's supply fails at= for so long; again and again if every= is given"},
    {FaultKind::alarm,
     "alarm",
     {{{"almc", FaultUnit::byte, 0, 255, 0, true}}},
     false,
     true,
     true,
     false,
     "The encoder reports these bits of ALMC, and SF as follows from them"},
    {FaultKind::frozen,
     "frozen",
     {},
     false,
     false,
     true,
     false,
     "The encoder goes on to answer, with the position of the moment when it froze, and without an alarm"},
}};

constexpr bool in_order() {
  for (std::size_t k = 0; k < kTable.size(); ++k)
    if (std::to_underlying(kTable[k].kind) != k) return false;
  return true;
}
static_assert(in_order());

}  // namespace

std::span<const FaultInfo, kFaultKinds> fault_kinds() noexcept { return kTable; }
const FaultInfo& info_of(FaultKind kind) noexcept { return kTable[std::to_underlying(kind)]; }

}  // namespace tm485::sim
