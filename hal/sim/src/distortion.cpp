#include "tm485/sim/distortion.hpp"

#include <algorithm>
#include <array>
#include <cmath>

namespace tm485::sim {
namespace {

constexpr int kDataBits = 8;
constexpr int kBitsPerCharacter = 10;
constexpr double kNsPerSecond = 1e9;

double bit_time(std::int64_t bits_per_second) noexcept {
  return kNsPerSecond / static_cast<double>(bits_per_second);
}

/// The level of a pair over time, as changes: times in ns from the burst's start, which may be negative.
class Wave {
 public:
  /// Mark from the beginning of time.
  Wave() noexcept = default;

  void set(double at, bool mark) noexcept {
    if (mark == last_mark() || count_ == edges_.size()) return;
    edges_[count_++] = {at, mark};
  }

  /// The first change to space at or after `from`; infinity if there is none.
  [[nodiscard]] double next_fall(double from) const noexcept { return next(from, false); }
  [[nodiscard]] double next_rise(double from) const noexcept { return next(from, true); }

  [[nodiscard]] bool mark_at(double time) const noexcept {
    bool mark = true;
    for (std::size_t i = 0; i < count_ && edges_[i].at <= time; ++i) mark = edges_[i].mark;
    return mark;
  }

 private:
  struct Edge {
    double at;
    bool mark;
  };

  [[nodiscard]] bool last_mark() const noexcept { return count_ == 0 || edges_[count_ - 1].mark; }
  [[nodiscard]] double next(double from, bool mark) const noexcept {
    for (std::size_t i = 0; i < count_; ++i)
      if (edges_[i].at >= from && edges_[i].mark == mark) return edges_[i].at;
    return HUGE_VAL;
  }

  // Every bit of a full burst, the driver's two ends and a glitch.
  std::array<Edge, Burst::kCapacity * kBitsPerCharacter + 8> edges_{};
  std::size_t count_ = 0;
};

struct Ear {
  double talker_bit;
  double listener_bit;
  bool inverted;
  double glitch_at = HUGE_VAL;  // before the start, one bit of the talker long
};

Wave wave_of(const Burst& burst, const Ear& ear) noexcept {
  Wave wave;
  const auto drive = [&](double at, bool mark) { wave.set(at, mark != ear.inverted); };
  if (ear.glitch_at != HUGE_VAL) {
    wave.set(ear.glitch_at, false);
    wave.set(ear.glitch_at + ear.talker_bit, true);
  }
  const auto driver_on = static_cast<double>((burst.driver_on - burst.start).count());
  const auto driver_off = static_cast<double>((burst.driver_off - burst.start).count());
  drive(std::min(driver_on, 0.0), true);
  double at = 0.0;
  for (std::size_t k = 0; k < burst.count; ++k) {
    drive(at, false);
    for (int bit = 0; bit < kDataBits; ++bit)
      drive(at + (1 + bit) * ear.talker_bit, ((burst.bytes[k] >> bit) & 1) != 0);
    drive(at + (1 + kDataBits) * ear.talker_bit, ((burst.framing_errors >> k) & 1u) == 0);
    at += kBitsPerCharacter * ear.talker_bit;
  }
  drive(at, true);
  wave.set(std::max(driver_off, at), true);
  return wave;
}

/// Replaces the burst's characters by what the listener makes of them: `most` at most.
void hear(Burst& burst, const Ear& ear, std::size_t most) noexcept {
  const Wave wave = wave_of(burst, ear);
  most = std::min(most, Burst::kCapacity);
  std::size_t heard = 0;
  std::uint32_t framing_errors = 0;
  double first = 0.0;
  for (double fall = wave.next_fall(-HUGE_VAL); fall != HUGE_VAL && heard < most;) {
    const auto sample = [&](double bits) { return wave.mark_at(fall + bits * ear.listener_bit); };
    if (sample(0.5)) {  // too short for a start bit
      fall = wave.next_fall(std::nextafter(fall, HUGE_VAL));
      continue;
    }
    unsigned byte = 0;
    for (int bit = 0; bit < kDataBits; ++bit) byte |= (sample(1.5 + bit) ? 1u : 0u) << bit;
    const bool stop = sample(1.5 + kDataBits);
    if (!stop) framing_errors |= std::uint32_t{1} << heard;
    if (heard == 0) first = fall;
    burst.bytes[heard++] = static_cast<std::uint8_t>(byte);
    const double after = fall + (1.5 + kDataBits) * ear.listener_bit;
    fall = wave.next_fall(stop ? after : wave.next_rise(after));
  }
  burst.count = static_cast<std::uint8_t>(heard);
  burst.framing_errors = framing_errors;
  // The host's own start is now, before which nothing can be heard any more.
  if (burst.talker == Talker::encoder || first > 0.0) burst.start += Time{std::llround(first)};
}

/// How many characters of `listener_bit` can begin within `count` characters of `talker_bit`; the last may end later.
std::size_t fitting(std::size_t count, double talker_bit, double listener_bit) noexcept {
  return static_cast<std::size_t>(static_cast<double>(count) * talker_bit / listener_bit) + 1;
}

}  // namespace

Distortion::Distortion(const DistortionConfig& config) noexcept : random_{config.seed} { configure(config); }

void Distortion::configure(const DistortionConfig& config) noexcept {
  config_ = config;
  distorts_ = config.host_bits_per_second != config.encoder_bits_per_second || config.swap != Swap::none ||
              config.glitches > 0.0;
}

void Distortion::host_at_encoder(Burst& burst) const noexcept {
  const double host = bit_time(config_.host_bits_per_second);
  hear(burst, {host, bit_time(config_.encoder_bits_per_second), config_.swap == Swap::pair},
       burst.count + std::size_t{1});
}

void Distortion::host_at_host(Burst& burst) const noexcept {
  const double host = bit_time(config_.host_bits_per_second);
  hear(burst, {host, host, config_.swap == Swap::receive}, fitting(burst.count, host, host));
}

void Distortion::encoder_at_host(Burst& burst) noexcept {
  const double encoder = bit_time(config_.encoder_bits_per_second);
  const double host = bit_time(config_.host_bits_per_second);
  Ear ear{encoder, host, config_.swap != Swap::none};
  const std::size_t most = fitting(burst.count, encoder, host);
  if (config_.glitches > 0.0 && burst.count > 0 && random_.unit() <= config_.glitches) {
    constexpr double kNearest = 2.5;  // over before the encoder's driver is on
    constexpr double kRange = 2.5;    // and not earlier than the request's end
    ear.glitch_at = -(kNearest + kRange * random_.unit()) * encoder;
    ++glitches_;
  }
  const Time tail =
      burst.driver_off - (burst.start + Time{std::llround(burst.count * kBitsPerCharacter * host)});
  burst.driver_off = burst.start + Time{std::llround(burst.count * kBitsPerCharacter * encoder)} + tail;
  hear(burst, ear, most);
}

}  // namespace tm485::sim
