#include "run.hpp"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <expected>
#include <span>
#include <stdexcept>

#include "judge.hpp"
#include "shaft.hpp"
#include "tm485/bus/bus.hpp"

namespace residual {
namespace {

using tm485::Bus;
using tm485::Errc;
using tm485::Time;

constexpr double kRpm = 6'000;  // the defaults of AxisConfig: what the gate believes of the shaft
constexpr double kRpmPerSecond = 1'000'000;
constexpr Time kCharacter{4'000};
constexpr Time kDelay{3'000};

/// The encoder on its noisy line.
class Encoder {
 public:
  explicit Encoder(const Plan& plan)
      : plan_(plan),
        jitter_(static_cast<double>(plan.uncertainty_ns) * 1e-9),
        random_(plan.seed),
        shaft_(kRpm, kRpmPerSecond, random_),
        noise_(plan.line, random_),
        undetected_(plan.line, kOpen, random_) {}

  [[nodiscard]] tm485::PortCapability capability() const noexcept { return {.wire_timestamps = true}; }
  [[nodiscard]] tm485::Transmission transmission(Time) const noexcept {
    return {.state = tm485::Transmission::State::sent};
  }
  std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    const Time latch = now + kCharacter;
    shaft_.advance(static_cast<double>((latch - latch_).count()) * 1e-9);
    latch_ = latch;
    is_id3_ = request[0] == 0x1A;
    if (is_id3_) {
      id3();
    } else {
      reply_ = {0x92, 0x20, 0x11, 0x92 ^ 0x20 ^ 0x11};
      length_ = 4;
      changed_ = noise_.disturb(std::span(reply_).first(length_));
    }
    reply_start_ = latch + kDelay;
    return now;
  }
  tm485::Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    if (length_ == 0 || now < reply_end()) return {};
    std::copy_n(reply_.begin(), length_, buffer.begin());
    const std::size_t count = length_;
    length_ = 0;
    return {.count = count, .first_start = reply_start_};
  }
  [[nodiscard]] Time reply_end() const noexcept {
    return length_ == 0 ? tm485::kNever : reply_start_ + kCharacter * static_cast<std::int64_t>(length_);
  }

  // What the judge knows of the last frame.
  [[nodiscard]] bool is_id3() const { return is_id3_; }
  [[nodiscard]] bool changed() const { return changed_; }
  [[nodiscard]] bool forced() const { return forced_; }
  [[nodiscard]] std::int64_t sent() const {
    return sent_;
  }  ///< where the shaft was as the encoder took its position
  [[nodiscard]] double truth() const {
    return shaft_.position();
  }  ///< and where at the latch time that the bus states
  [[nodiscard]] const Bytes& received() const { return reply_; }
  [[nodiscard]] std::uint64_t frames() const { return frames_; }
  [[nodiscard]] Random& random() { return random_; }
  /// So many ID3 frames later one more pattern is put in.
  void force_in(std::uint64_t frames) { force_at_ = frames_ + frames; }

 private:
  void id3() {
    sent_ = static_cast<std::int64_t>(std::floor(shaft_.position_at(jitter_ * (2 * random_.uniform() - 1))));
    reply_ = id3_frame(sent_);
    length_ = kBytes;
    ++frames_;
    forced_ = plan_.forced != Forced::none && frames_ == force_at_;
    if (forced_) {
      const auto kinds = static_cast<std::uint32_t>(plan_.pool.size());
      const Bytes wrong = kinds == 0 ? undetected_.draw() : plan_.pool[random_.below(kinds)];
      for (std::size_t i = 0; i < kBytes; ++i) reply_[i] ^= wrong[i];
      changed_ = true;
      return;
    }
    changed_ = noise_.disturb(reply_);
    // Missing ones come alone: the next is there.
    missing_ = plan_.missing > 0 && !missing_ && random_.uniform() < plan_.missing;
    if (missing_) length_ = 0;
  }

  Plan plan_;
  double jitter_;
  Random random_;
  Shaft shaft_;
  Noise noise_;
  Undetected undetected_;
  Bytes reply_{};
  std::size_t length_ = 0;
  Time latch_{0};
  Time reply_start_{0};
  std::int64_t sent_ = 0;
  std::uint64_t frames_ = 0;
  std::uint64_t force_at_ = 0;
  bool is_id3_ = false;
  bool changed_ = false;
  bool forced_ = false;
  bool missing_ = false;
};

constexpr tm485::CompiledProfile kProfile = *tm485::CompiledProfile::compile(tm485::Profile{});

/// What a frame with wrong bits is taken for without the gate.
void judge_bytes(const Encoder& encoder, Counts& counts) {
  ++counts.changed;
  const Bytes& frame = encoder.received();
  const bool strict = tm485::Reply::parse(frame, tm485::DataId::everything, kProfile).has_value();
  Bytes wrong = id3_frame(encoder.sent());
  for (std::size_t i = 0; i < kBytes; ++i) wrong[i] ^= frame[i];
  if (strict != passes(wrong, kOpen)) ++counts.mismatch;
  if (encoder.forced()) {
    ++counts.forced;
    return;
  }
  const bool dangerous = apart(read_position(frame), encoder.sent()) > kDangerous;
  if (xor_holds(frame)) {
    ++counts.crc_wrong;
    counts.crc_dangerous += dangerous ? 1U : 0U;
  }
  if (strict) {
    ++counts.strict_wrong;
    counts.strict_dangerous += dangerous ? 1U : 0U;
  }
}

/// The readings that a sample came of, as far as strict parsing let them pass.
class Readings {
 public:
  void add(const Encoder& encoder, Errc result) {
    if (result != Errc::ok && result != Errc::position_implausible) return;
    const bool wrong = apart(read_position(encoder.received()), encoder.sent()) != 0;
    wrong_ = wrong_ << 1 | (wrong ? 1U : 0U);
    if (result == Errc::ok) {
      behind_row_ = in_row_ ? 0 : std::min(behind_row_ + 1, kReach);
    }
    in_row_ = result != Errc::ok;
  }
  /// More of them are wrong than the half-width of the newest counts: one in each of three, or one of a row that had to agree
  /// before the first was believed again.
  [[nodiscard]] bool too_many_wrong() const {
    constexpr std::uint32_t kThreeAndOneMore = 0xF;
    constexpr std::uint32_t kRowAndTwoMore = 0x3F;
    return behind_row_ < kReach ? std::popcount(wrong_ & kRowAndTwoMore) > 1
                                : std::popcount(wrong_ & kThreeAndOneMore) > 3;
  }

 private:
  static constexpr int kReach = 3;
  std::uint32_t wrong_ = 0;  ///< the newest in bit 0
  int behind_row_ = kReach;
  bool in_row_ = false;
};

void judge_sample(const Encoder& encoder, const tm485::Sample& sample, const Readings& readings,
                  Counts& counts) {
  ++counts.fresh;
  const std::int64_t off = apart(sample.position(), encoder.sent());
  // The shaft was somewhere within a count.
  const auto truth = static_cast<std::int64_t>(std::floor(encoder.truth()));
  if (apart(sample.position(), truth) > std::int64_t{sample.half_width()} + 1)
    ++(readings.too_many_wrong() ? counts.beyond_by_more : counts.beyond);
  const bool dangerous = off > kDangerous;
  if (encoder.forced()) {
    ++counts.forced_wrong;
    counts.forced_dangerous += dangerous ? 1U : 0U;
    return;
  }
  counts.largest = std::max(counts.largest, static_cast<std::uint64_t>(off));
  counts.gate_wrong += encoder.changed() ? 1U : 0U;
  counts.position_wrong += off != 0 ? 1U : 0U;
  counts.gate_dangerous += dangerous ? 1U : 0U;
}

}  // namespace

void Counts::add(const Counts& other) {
  for (auto member :
       {&Counts::frames, &Counts::changed, &Counts::fresh, &Counts::crc_wrong, &Counts::crc_dangerous,
        &Counts::strict_wrong, &Counts::strict_dangerous, &Counts::gate_wrong, &Counts::gate_dangerous,
        &Counts::position_wrong, &Counts::beyond, &Counts::beyond_by_more, &Counts::forced,
        &Counts::forced_wrong, &Counts::forced_dangerous, &Counts::mismatch, &Counts::held_back,
        &Counts::discontinuities, &Counts::startups})
    this->*member += other.*member;
  largest = std::max(largest, other.largest);
}

Counts run(const Plan& plan) {
  Encoder encoder(plan);
  tm485::BusConfig config;
  config.cycle = tm485::Cycle{.period = Time{plan.period_ns}};
  config.axis.reference_turn = 0;
  tm485::Profile stated;
  stated.latch_uncertainty = Time{plan.uncertainty_ns};
  const auto profile = tm485::CompiledProfile::compile(stated);
  if (!profile) throw std::runtime_error("the profile is refused");
  Bus<Encoder> bus(encoder, *profile, config);
  Counts counts;
  Time now{0};
  if (!bus.start(now)) throw std::runtime_error("the bus refuses the cycle");
  constexpr std::uint32_t kApart = 48;
  constexpr std::uint32_t kAfterRestart = 16;
  std::uint64_t restart_at = 0;
  Readings readings;
  encoder.force_in(kApart);
  std::uint32_t records = bus.record_count();
  while (encoder.frames() < plan.frames) {
    const Time due = bus.poll(now);
    if (bus.record_count() != records) {
      records = bus.record_count();
      const auto& record = bus.last_record();
      if (encoder.is_id3()) {
        ++counts.frames;
        if (encoder.changed()) [[unlikely]]
          judge_bytes(encoder, counts);
        readings.add(encoder, record.result);
        if (record.kind == tm485::CycleRecord::Kind::cyclic && record.result == Errc::ok)
          judge_sample(encoder, bus.latest(), readings, counts);
        if (record.result == Errc::position_implausible) ++counts.held_back;
        if (encoder.forced() && plan.forced == Forced::steady)
          encoder.force_in(kApart + encoder.random().below(32));
        if (plan.forced == Forced::start_up && encoder.frames() >= restart_at) {
          bus.on_restart(now);
          restart_at = encoder.frames() + 2 * kAfterRestart;
          encoder.force_in(1 + encoder.random().below(kAfterRestart));
          continue;
        }
      }
    }
    const Time next = std::min(due, encoder.reply_end());
    now = std::max(now, next == now ? now : next);
  }
  counts.discontinuities = bus.statistics().discontinuities;
  counts.startups = bus.statistics().startups;
  return counts;
}

}  // namespace residual
