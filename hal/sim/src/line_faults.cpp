#include "tm485/sim/line_faults.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace tm485::sim {
namespace {

constexpr std::int64_t kBitsPerByte = 8;
constexpr Time kTalkersLead{500};
constexpr Time kTalkersTail{200};

/// CF of the replies that a host may wait for, written down by hand from section 2 of the specification.
constexpr std::array<std::uint8_t, 4> kReadCf{0x02, 0x8A, 0x92, 0x1A};

}  // namespace

FaultTrigger::FaultTrigger(double probability, Time every, Time from, std::uint64_t seed) noexcept
    : random_{seed},
      log_spared_{std::log1p(-probability)},
      always_{probability >= 1.0},
      every_{every},
      next_{from} {
  if (!always_) draw();
}

void FaultTrigger::draw() noexcept {
  constexpr double kNeverInPractice = 4e18;
  const double spared = log_spared_ < 0.0 ? std::log(random_.unit()) / log_spared_ : kNeverInPractice;
  left_ = static_cast<std::int64_t>(std::min(spared, kNeverInPractice));
}

bool BurstErrors::on_burst(Burst& burst) noexcept {
  if (!touches(side_, burst) || burst.count == 0) return false;
  const std::int64_t all = burst.count * kBitsPerByte;
  const std::int64_t run = std::min<std::int64_t>(bits_, all);
  const std::int64_t first = random_.below(all - run + 1);
  for (std::int64_t k = 0; k < run; ++k) {
    if (k != 0 && k != run - 1 && random_.below(2) == 0) continue;
    std::uint8_t& byte = burst.bytes[static_cast<std::size_t>((first + k) / kBitsPerByte)];
    byte = static_cast<std::uint8_t>(byte ^ (1u << ((first + k) % kBitsPerByte)));
  }
  return true;
}

bool StuckColumn::on_burst(Burst& burst) noexcept {
  if (!touches(side_, burst)) return false;
  bool altered = false;
  for (std::uint8_t k = 0; k < burst.count; ++k) {
    const auto stuck = static_cast<std::uint8_t>(value_ ? burst.bytes[k] | mask_ : burst.bytes[k] & ~mask_);
    altered = altered || stuck != burst.bytes[k];
    burst.bytes[k] = stuck;
  }
  return altered;
}

bool ExtraCharacters::on_burst(Burst& burst) noexcept {
  if (!touches(side_, burst) || burst.count == 0) return false;
  const Burst sent = burst;
  const Time length = burst.driver_off - burst.start;
  burst.count = 0;
  burst.framing_errors = 0;
  for (std::uint8_t k = 0; k <= sent.count; ++k) {
    if (burst.count < Burst::kCapacity && random_.unit() <= probability_)
      burst.bytes[burst.count++] = static_cast<std::uint8_t>(random_.below(256));
    if (k == sent.count || burst.count == Burst::kCapacity) break;
    if (((sent.framing_errors >> k) & 1u) != 0) burst.framing_errors |= std::uint32_t{1} << burst.count;
    burst.bytes[burst.count++] = sent.bytes[k];
  }
  if (burst.count == sent.count) return false;
  burst.driver_off = burst.start + length * burst.count / sent.count;
  return true;
}

bool LostRequests::on_burst(Burst& burst) noexcept {
  if (burst.talker != Talker::host || random_.unit() > probability_) return false;
  burst.count = 0;
  return true;
}

bool WrongCf::on_burst(Burst& burst) noexcept {
  if (burst.talker != Talker::encoder || burst.count < 2) return false;
  std::uint8_t other = burst.bytes[0];
  while (other == burst.bytes[0]) other = kReadCf[static_cast<std::size_t>(random_.below(kReadCf.size()))];
  // The CRC is the XOR of all other bytes, so it changes by the same bits.
  std::uint8_t& crc = burst.bytes[burst.count - 1u];
  crc = static_cast<std::uint8_t>(crc ^ burst.bytes[0] ^ other);
  burst.bytes[0] = other;
  return true;
}

void OtherT2::note_request(const Burst& burst) noexcept {
  if (burst.talker == Talker::host) request_end_ = burst.start + character_ * burst.count;
}

bool OtherT2::on_burst(Burst& burst) noexcept {
  if (burst.talker != Talker::encoder || request_end_ == kNever) return false;
  const Time by = request_end_ + gap_ - burst.start;
  burst.start += by;
  burst.driver_on += by;
  burst.driver_off += by;
  return by != Time{0};
}

bool LateRelease::on_burst(Burst& burst) noexcept {
  if (burst.talker == Talker::host) burst.driver_off += by_;
  return false;
}

bool BrokenReply::on_burst(Burst& burst) noexcept {
  if (burst.talker != Talker::encoder || burst.count < 2 || rest_.count != 0) return false;
  const auto kept = static_cast<std::uint8_t>(1 + random_.below(burst.count - 1));
  rest_ = burst;
  rest_.count = static_cast<std::uint8_t>(burst.count - kept);
  rest_.framing_errors = burst.framing_errors >> kept;
  std::copy_n(burst.bytes.begin() + kept, rest_.count, rest_.bytes.begin());
  rest_.start = burst.start + character_ * kept + pause_;
  rest_.driver_on = rest_.start - kTalkersLead;
  rest_.driver_off = burst.driver_off + pause_;
  burst.count = kept;
  burst.framing_errors &= (std::uint32_t{1} << kept) - 1;
  burst.driver_off = burst.start + character_ * kept + kTalkersTail;
  return true;
}

bool BrokenReply::on_own(Burst& burst) noexcept {
  burst = rest_;
  rest_.count = 0;
  return true;
}

OtherTalker::OtherTalker(unsigned characters, Time pause, Time character_time, Time from, Time until,
                         std::uint64_t seed) noexcept
    : random_{seed},
      characters_{characters},
      pause_{pause},
      character_{character_time},
      until_{until},
      next_{from} {
  if (pause > Time{0}) plan_next(from);
}

void OtherTalker::plan_next(Time end) noexcept {
  // From nothing to twice the mean. The times of a plan are bounded, so this fits.
  const double mean = static_cast<double>(pause_.count());
  next_ = end + Time{std::llround(2.0 * mean * random_.unit())};
  if (next_ >= until_) next_ = kNever;
}

bool OtherTalker::on_own(Burst& burst) noexcept {
  burst.talker = Talker::third;
  burst.start = next_;
  burst.count = static_cast<std::uint8_t>(characters_);
  burst.framing_errors = 0;
  for (unsigned k = 0; k < characters_; ++k) burst.bytes[k] = static_cast<std::uint8_t>(random_.below(256));
  const Time end = burst.start + character_ * characters_;
  burst.driver_on = burst.start - kTalkersLead;
  burst.driver_off = end + kTalkersTail;
  plan_next(end);
  return true;
}

}  // namespace tm485::sim
