#include "tm485/sim/encoder_model.hpp"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>
#include <cstring>

namespace tm485::sim {
namespace {

/// How long the encoder's driver holds the line before its first start bit and after its last stop bit.
constexpr Time kDriverLead{500};
constexpr Time kDriverTail{200};

constexpr std::uint8_t kParityFlag = 0x40;
constexpr std::uint8_t kDelimiterFlag = 0x80;
constexpr std::uint8_t kResetsNeeded = 10;

constexpr std::uint8_t kBusyFlag = 0x80;  // of ADF
constexpr std::uint8_t kEepromWrite = 0x6;
constexpr std::uint8_t kEepromRead = 0xD;

/// The counting error in SF and ALMC.
constexpr std::uint8_t kCountingErrorSf = 0x10;
constexpr std::uint8_t kCountingErrorAlmc = 0x04;

/// Over this span the speed is taken that decides whether ID8 finds the shaft at rest.
constexpr Time kSpeedWindow = std::chrono::milliseconds{1};
constexpr double kWindowsPerMinute = 60'000.0;

/// The requests, written down by hand from section 2 of the specification.
struct RequestKind {
  std::uint8_t cf;
  std::uint8_t id;
  std::uint8_t request_bytes;
  std::uint8_t reply_bytes;
  bool is_reset;
  Time t1;  // to the start of whatever comes next
};
constexpr Time kShortT1{40'000};
constexpr Time kLongT1{62'500};
constexpr std::array<RequestKind, 9> kRequests{{
    {0x02, 0x0, 1, 6, false, kShortT1},
    {0x8A, 0x1, 1, 6, false, kShortT1},
    {0x92, 0x2, 1, 4, false, kShortT1},
    {0x1A, 0x3, 1, 11, false, kLongT1},
    {0x32, 0x6, 4, 4, false, kShortT1},
    {0xBA, 0x7, 1, 6, true, kLongT1},
    {0xC2, 0x8, 1, 6, true, kLongT1},
    {0x62, 0xC, 1, 6, true, kLongT1},
    {0xEA, 0xD, 3, 4, false, kShortT1},
}};

constexpr std::uint8_t kNoKind = 0xFF;
constexpr auto kKindOfByte = [] {
  std::array<std::uint8_t, 256> kinds{};
  kinds.fill(kNoKind);
  std::uint8_t kind = 0;
  for (const auto& request : kRequests) kinds[request.cf] = kind++;
  return kinds;
}();

/// The sync code is right, but the number of ones in bits 3..7 is odd.
constexpr bool has_parity_error(std::uint8_t cf) noexcept {
  unsigned ones = 0;
  for (unsigned bit = 3; bit < 8; ++bit) ones += (cf >> bit) & 1u;
  return (cf & 0x07) == 0x02 && ones % 2 != 0;
}

constexpr std::uint64_t word_of(std::uint64_t value, unsigned byte) noexcept { return value << (8 * byte); }

/// Byte k of `word` to `to[k]`. A single move where the machine's byte order allows it: assembled from bytes
/// it would cost as much as the rest of the reply.
void store_word(std::uint8_t* to, std::uint64_t word) noexcept {
  if constexpr (std::endian::native == std::endian::little) {
    std::memcpy(to, &word, sizeof word);
  } else {
    for (unsigned k = 0; k < sizeof word; ++k) to[k] = static_cast<std::uint8_t>((word >> (8 * k)) & 0xFF);
  }
}

/// XOR of the eight bytes: the CRC X^8 + 1 of a frame is the XOR of its bytes.
constexpr std::uint8_t sum_of_bytes(std::uint64_t word) noexcept {
  word ^= word >> 32;
  word ^= word >> 16;
  word ^= word >> 8;
  return static_cast<std::uint8_t>(word & 0xFF);
}

/// What the flavours do differently with their EEPROM, where the configuration does not say.
EncoderConfig completed(EncoderConfig config) noexcept {
  const bool t_format = config.flavour == Flavour::t_format;
  if (!config.eeprom.page_time && t_format) config.eeprom.page_time = Time{0};
  if (!config.eeprom.write_reply_busy) config.eeprom.write_reply_busy = t_format;
  return config;
}

}  // namespace

EncoderModel::EncoderModel(const EncoderConfig& config, const MotionProfile& motion) noexcept
    : config_{completed(config)},
      motion_{motion},
      t2_choices_{(config.t2_max - config.t2_min).count() + 1},
      abs_mask_{(std::uint32_t{1} << config.single_turn_bits) - 1},
      random_{config.seed},
      eeprom_{config_.eeprom} {
  assert(config.single_turn_bits >= 1 && config.single_turn_bits <= 24);
  assert(config.t2_min <= config.t2_max);
  set_alarms(config.sf, config.almc);
  turn_base_ = config.start_turn;  // with a battery the count goes on from here
  power_up(Time{0});
  schedule_changes();
}

bool EncoderModel::on_character(std::uint8_t byte, Time start, Time end, bool framing_ok, Judged judged,
                                Burst& reply) noexcept {
  if (end >= next_change_) [[unlikely]]
    apply_changes(end);
  if (power_ != Power::on) [[unlikely]]
    return false;

  const bool after_gap = start - last_end_ >= config_.request_gap;
  last_end_ = end;
  if (after_gap) return begin_request(byte, start, end, framing_ok, judged, reply);
  if (phase_ == Phase::collecting) return collect(byte, end, framing_ok, reply);
  return false;
}

inline bool EncoderModel::begin_request(std::uint8_t byte, Time start, Time end, bool framing_ok,
                                        Judged judged, Burst& reply) noexcept {
  if (phase_ == Phase::collecting) [[unlikely]]
    refuse_request(statistics_.bad_requests, 0);  // the one before was cut short

  kind_ = framing_ok ? kKindOfByte[byte] : kNoKind;
  const bool known = kind_ != kNoKind;
  if (judged == Judged::yes) {
    // Of a request that cannot be read only the least T1 of all is known to be due.
    t1_.on_request(start, known ? kRequests[kind_].t1 : kShortT1);
  } else {
    t1_.disarm();
  }
  if (start < deaf_until_) [[unlikely]] {
    const bool only_eeprom = only_eeprom_is_deaf(start);
    if (!only_eeprom || !known || kRequests[kind_].request_bytes == 1) {
      ++(only_eeprom ? statistics_.busy_silences : statistics_.deaf_requests);
      phase_ = Phase::ignoring;
      return false;
    }
  }
  if (!known) [[unlikely]] {
    if (!framing_ok) {
      refuse_request(statistics_.bad_requests, kDelimiterFlag);
    } else {
      refuse_request(statistics_.unknown_cf, has_parity_error(byte) ? kParityFlag : std::uint8_t{0});
    }
    return false;
  }
  request_[0] = byte;
  received_ = 1;
  request_start_ = start;
  character_time_ = end - start;
  if (kRequests[kind_].request_bytes == 1) [[likely]]
    return answer(end, reply);
  phase_ = Phase::collecting;
  return false;
}

bool EncoderModel::collect(std::uint8_t byte, Time end, bool framing_ok, Burst& reply) noexcept {
  if (!framing_ok) {
    refuse_request(statistics_.bad_requests, kDelimiterFlag);
    return false;
  }
  request_[received_++] = byte;
  const std::uint8_t expected = kRequests[kind_].request_bytes;
  if (received_ < expected) return false;

  std::uint8_t sum = 0;
  for (std::uint8_t k = 0; k < expected; ++k) sum = static_cast<std::uint8_t>(sum ^ request_[k]);
  const bool address_ok = (request_[1] & kBusyFlag) == 0;
  if (sum != 0 || !address_ok) {
    refuse_request(statistics_.bad_requests, 0);
    return false;
  }
  return answer(end, reply);
}

/// A bad request: silence until the next gap; a reset run is broken.
void EncoderModel::refuse_request(std::uint64_t& counter, std::uint8_t t_format_flag) noexcept {
  ++counter;
  phase_ = Phase::ignoring;
  reset_count_ = 0;
  if (config_.flavour == Flavour::t_format) {
    request_flags_ = static_cast<std::uint8_t>(request_flags_ | t_format_flag);
  }
}

inline bool EncoderModel::answer(Time end, Burst& reply) noexcept {
  const RequestKind& kind = kRequests[kind_];
  phase_ = Phase::ignoring;
  ++statistics_.requests[kind.id];
  take_position(end);

  // The reply as two words: byte k is bits 8k..8k+7 of `front`, byte 8 + k those of `back`.
  std::uint64_t front = kind.cf | word_of(sf_now_, 1);
  std::uint64_t back = 0;
  switch (kind.id) {
    case 0x3:  // CF SF ABS0 ABS1 ABS2 ENID ABM0 ABM1 | ABM2 ALMC
      front |= word_of(request_flags_, 1) | word_of(latch_.abs, 2) | word_of(config_.enid, 5) |
               word_of(latch_.abm, 6);
      back = word_of(almc_now_, 1);
      request_flags_ = 0;
      break;
    case 0x0:  // CF SF ABS0 ABS1 ABS2
      front |= word_of(latch_.abs, 2);
      break;
    case 0x1:  // CF SF ABM0 ABM1 ABM2
      front |= word_of(latch_.abm, 2);
      break;
    case 0x2:  // CF SF ENID
      front |= word_of(config_.enid, 2);
      break;
    case kEepromWrite:
    case kEepromRead:
      return answer_eeprom(end, reply);
    default:  // the resets: CF SF ABS0 ABS1 ABS2
      front |= word_of(latch_.abs, 2);
      note_reset(kind.id);
      break;
  }
  if (!kind.is_reset) reset_count_ = 0;
  return send(front, back, end, reply);
}

/// CF ADF EDF, of a write the echo. While the EEPROM is busy ADF.7 is set, EDF is 0, and a write is not stored.
bool EncoderModel::answer_eeprom(Time end, Burst& reply) noexcept {
  reset_count_ = 0;
  const RequestKind& kind = kRequests[kind_];
  const bool writes = kind.id == kEepromWrite;
  std::uint8_t edf = writes ? request_[2] : eeprom_.read(request_[1]);
  bool busy_flag = false;
  if (writes ? !eeprom_.write(request_[1], edf, request_start_) : eeprom_.busy(request_start_)) {
    ++(writes ? statistics_.busy_writes : statistics_.busy_reads);
    busy_flag = true;
    edf = 0;
  } else if (writes && *config_.eeprom.write_reply_busy) {
    busy_flag = eeprom_.busy(request_start_);
  }
  const std::uint64_t adf = request_[1] | (busy_flag ? kBusyFlag : 0u);
  const bool answered = send(kind.cf | word_of(adf, 1) | word_of(edf, 2), 0, end, reply);
  if (config_.eeprom.deaf_while_busy) {
    speaking_until_ = deaf_until_;
    deaf_until_ = std::max(deaf_until_, eeprom_.busy_until());
  }
  return answered;
}

/// Deaf for the EEPROM's sake alone: for everything but its own requests. A later reply would have moved deaf_until_.
bool EncoderModel::only_eeprom_is_deaf(Time start) const noexcept {
  return config_.eeprom.deaf_while_busy && deaf_until_ == eeprom_.busy_until() && start >= speaking_until_;
}

/// Puts CRC and timing to the reply in `front` and `back`. False if the supply fails before its first character ends.
inline bool EncoderModel::send(std::uint64_t front, std::uint64_t back, Time end, Burst& reply) noexcept {
  const RequestKind& kind = kRequests[kind_];
  const unsigned crc_at = kind.reply_bytes - 1u;
  const std::uint64_t crc = sum_of_bytes(front ^ back);
  (crc_at < 8 ? front : back) |= word_of(crc, crc_at % 8);
  store_word(reply.bytes.data(), front);
  store_word(reply.bytes.data() + 8, back);

  reply.talker = Talker::encoder;
  reply.count = kind.reply_bytes;
  reply.framing_errors = 0;
  reply.start = end + config_.t2_min;
  if (t2_choices_ > 1) reply.start += Time{random_.below(t2_choices_)};
  reply.driver_on = reply.start - kDriverLead;
  reply.driver_off = reply.start + character_time_ * kind.reply_bytes + kDriverTail;
  if (reply.driver_off > next_change_) [[unlikely]]
    cut_by_power_off(reply);
  deaf_until_ = reply.driver_off;
  if (reply.count == 0) return false;
  ++statistics_.replies;
  return true;
}

inline void EncoderModel::take_position(Time end) noexcept {
  latch_.time = end + config_.latch_offset;
  const std::int64_t shaft = motion_.counts(latch_.time, config_.single_turn_bits) - zero_offset_;
  latch_.abs = static_cast<std::uint32_t>(shaft) & abs_mask_;
  latch_.turns = (shaft >> config_.single_turn_bits) + turn_base_;
  latch_.abm = config_.multi_turn ? static_cast<std::uint16_t>(latch_.turns) : std::uint16_t{0};
  // A shift of a negative number of turns is the multiplication that is meant (C++20).
  latch_.counts = ((latch_.turns - config_.start_turn) << config_.single_turn_bits) + latch_.abs;
}

bool EncoderModel::shaft_moves(Time at) const noexcept {
  const MotionProfile& shaft = stale_ ? unseen_motion_ : motion_;
  const double moved = shaft.revolutions(at) - shaft.revolutions(at - kSpeedWindow);
  return std::abs(moved) * kWindowsPerMinute > config_.standstill_rpm;
}

void EncoderModel::note_reset(std::uint8_t id) noexcept {
  const bool goes_on =
      reset_count_ != 0 && reset_id_ == id && request_start_ - reset_start_ >= config_.reset_spacing;
  reset_count_ = goes_on ? static_cast<std::uint8_t>(reset_count_ + 1) : std::uint8_t{1};
  reset_id_ = id;
  reset_start_ = request_start_;
  if (reset_count_ < kResetsNeeded) return;

  reset_count_ = 0;
  if (id == 0x8 && shaft_moves(latch_.time)) {
    ++statistics_.zero_refused;
    latch_alarms(kCountingErrorSf, kCountingErrorAlmc);
    return;
  }
  ++statistics_.resets_done;
  if (id == 0x8) {
    zero_counts_ = latch_.abs;
    zero_at_ = latch_.time + config_.zero_settle;
    schedule_changes();
    return;
  }
  clear_alarms();
  if (id == 0xC) turn_base_ += config_.start_turn - latch_.turns;
}

/// The latched alarms go, except the one of a sensor that is still stale.
void EncoderModel::clear_alarms() noexcept {
  latched_sf_ = 0;
  latched_almc_ = 0;
  if (stale_ && stale_noticed_) {
    latch_alarms(kCountingErrorSf, kCountingErrorAlmc);
  } else {
    set_alarms(config_.sf, config_.almc);
  }
}

void EncoderModel::sample_stale(Time since, bool noticed) noexcept {
  if (!stale_) unseen_motion_ = motion_;
  stale_ = true;
  stale_noticed_ = noticed;
  motion_ = MotionProfile::constant(0.0, unseen_motion_.revolutions(since));
  if (noticed) latch_alarms(kCountingErrorSf, kCountingErrorAlmc);
}

void EncoderModel::sample_fresh() noexcept {
  if (stale_) motion_ = unseen_motion_;
  stale_ = false;
}

void EncoderModel::set_alarms(std::uint8_t sf, std::uint8_t almc) noexcept {
  config_.sf = sf;
  config_.almc = almc;
  sf_now_ = static_cast<std::uint8_t>(sf | latched_sf_);
  almc_now_ = static_cast<std::uint8_t>(almc | latched_almc_);
}

void EncoderModel::latch_alarms(std::uint8_t sf, std::uint8_t almc) noexcept {
  latched_sf_ = static_cast<std::uint8_t>(latched_sf_ | sf);
  latched_almc_ = static_cast<std::uint8_t>(latched_almc_ | almc);
  set_alarms(config_.sf, config_.almc);
}

}  // namespace tm485::sim
