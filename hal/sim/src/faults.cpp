#include "tm485/sim/faults.hpp"

#include <cmath>

namespace tm485::sim {
namespace {

constexpr std::int64_t kBitsPerByte = 8;
constexpr std::int64_t kNeverInPractice = std::int64_t{1} << 62;

}  // namespace

BitErrors::BitErrors(double on_requests, double on_replies, std::uint64_t seed) noexcept : random_{seed} {
  requests_.log_good = std::log1p(-on_requests);
  replies_.log_good = std::log1p(-on_replies);
  draw(requests_);
  draw(replies_);
}

void BitErrors::draw(Channel& channel) noexcept {
  // Geometric distribution; a probability of 1 gives log_good = -infinity and so 0.
  const double good = channel.log_good < 0.0 ? std::log(random_.unit()) / channel.log_good
                                             : static_cast<double>(kNeverInPractice);
  channel.good_bits_left =
      good < static_cast<double>(kNeverInPractice) ? static_cast<std::int64_t>(good) : kNeverInPractice;
}

bool BitErrors::on_burst(Burst& burst) noexcept {
  Channel& channel = burst.talker == Talker::host ? requests_ : replies_;
  const std::int64_t bits = burst.count * kBitsPerByte;
  std::int64_t at = channel.good_bits_left;
  if (at >= bits) {
    channel.good_bits_left -= bits;
    return false;
  }
  while (at < bits) {
    auto& byte = burst.bytes[static_cast<std::size_t>(at / kBitsPerByte)];
    byte = static_cast<std::uint8_t>(byte ^ (1u << (at % kBitsPerByte)));
    ++bits_flipped_;
    draw(channel);
    at += 1 + channel.good_bits_left;
  }
  channel.good_bits_left = at - bits;
  return true;
}

bool LostCharacters::on_burst(Burst& burst) noexcept {
  if (burst.talker == Talker::encoder && whole_reply_ > 0.0 && random_.unit() <= whole_reply_) {
    ++replies_lost_;
    burst.count = 0;
    return true;
  }
  if (character_ <= 0.0) return false;
  std::uint8_t kept = 0;
  for (std::uint8_t k = 0; k < burst.count; ++k) {
    if (random_.unit() > character_) burst.bytes[kept++] = burst.bytes[k];
  }
  const bool altered = kept != burst.count;
  characters_lost_ += static_cast<std::uint64_t>(burst.count - kept);
  burst.count = kept;
  return altered;
}

bool FaultChain::add(FaultHook& fault) noexcept {
  if (count_ == kCapacity) return false;
  faults_[count_++] = &fault;
  return true;
}

bool FaultChain::on_burst(Burst& burst) noexcept {
  bool altered = false;
  for (std::size_t k = 0; k < count_; ++k) altered = faults_[k]->on_burst(burst) || altered;
  return altered;
}

}  // namespace tm485::sim
