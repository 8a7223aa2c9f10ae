// Frame and Reply: the two steps from bytes to data that may be believed.
//
// A Frame exists only if its length, its CF and its CRC hold. A Reply exists only if, besides,
// everything that the profile fixes holds: ABS < 2^bits, the reserved ABM bits, ENID among the
// expected. Neither can be made in another way, and only a Reply can become a Sample.
//
// Success is one compare on raw words; the named cause of a refusal is found on a cold path.
// Specification: sections 2, 3 and 7.
#pragma once

#include <bit>
#include <cstdint>
#include <cstring>
#include <expected>
#include <span>

#include "tm485/errc.hpp"
#include "tm485/protocol/control_field.hpp"
#include "tm485/protocol/crc.hpp"
#include "tm485/protocol/layout.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/protocol/status.hpp"

namespace tm485 {

class Frame;
class Reply;

namespace detail {

/// A reply as words, little endian: bytes 0..3, 4..7 and 8..10, rest 0. Where registers have 64 bits the first two are one
/// word: stored in halves and copied in one piece, they would cost a store-forwarding stall. Elsewhere three words of 32
/// bits are shorter, and need no padding.
struct Words {
#if UINTPTR_MAX > UINT32_MAX
  std::uint64_t both = 0;
  std::uint32_t high = 0;

  constexpr Words() noexcept = default;
  constexpr Words(std::uint32_t first, std::uint32_t second, std::uint32_t third) noexcept
      : both(std::uint64_t{second} << 32 | first), high(third) {}
  constexpr Words(std::uint64_t low, std::uint32_t third) noexcept : both(low), high(third) {}
  [[nodiscard]] constexpr std::uint32_t first() const noexcept { return static_cast<std::uint32_t>(both); }
  [[nodiscard]] constexpr std::uint32_t second() const noexcept {
    return static_cast<std::uint32_t>(both >> 32);
  }
  [[nodiscard]] constexpr std::uint64_t low() const noexcept { return both; }
#else
  std::uint32_t low_half = 0;
  std::uint32_t high_half = 0;
  std::uint32_t high = 0;

  [[nodiscard]] constexpr std::uint32_t first() const noexcept { return low_half; }
  [[nodiscard]] constexpr std::uint32_t second() const noexcept { return high_half; }
  [[nodiscard]] constexpr std::uint64_t low() const noexcept {
    return std::uint64_t{high_half} << 32 | low_half;
  }
#endif
};

template <class Word>
[[nodiscard]] inline Word load(const std::uint8_t* bytes) noexcept {
#if defined(__ARM_ARCH) && !defined(__ARM_FEATURE_UNALIGNED) && UINTPTR_MAX <= UINT32_MAX
  // A word must be aligned to be loaded, and memcpy() of one is a call: so by bytes.
  std::uint32_t word = 0;
  for (std::size_t i = sizeof(Word); i-- != 0;) word = word << 8 | bytes[i];
  return static_cast<Word>(word);
#else
  Word word;
  std::memcpy(&word, bytes, sizeof word);
  return word;
#endif
}

/// `bytes` must have 4, 6 or 11 bytes: the lengths of kLayouts.
[[nodiscard]] constexpr Words load_words(std::span<const std::uint8_t> bytes) noexcept {
  if (std::is_constant_evaluated() || std::endian::native != std::endian::little) {
    std::uint32_t words[3]{};
    for (std::size_t i = 0; i < bytes.size(); ++i) words[i / 4] |= std::uint32_t{bytes[i]} << (8 * (i % 4));
    return {words[0], words[1], words[2]};
  }
  const std::uint8_t* const data = bytes.data();
#if UINTPTR_MAX > UINT32_MAX
  if (bytes.size() == kMaxReply) {  // the last word overlaps byte 7, which is shifted out
    const std::uint32_t high = load<std::uint32_t>(data + 7) >> 8;
    return {load<std::uint64_t>(data), high};
  }
  const std::uint32_t second = bytes.size() == 6 ? load<std::uint16_t>(data + 4) : std::uint32_t{0};
  return {load<std::uint32_t>(data), second, 0};
#else
  Words words;
  words.low_half = load<std::uint32_t>(data);
  if (bytes.size() == kMaxReply) {
    words.high_half = load<std::uint32_t>(data + 4);
    words.high = load<std::uint32_t>(data + 7) >> 8;
  } else if (bytes.size() == 6) {
    words.high_half = load<std::uint16_t>(data + 4);
  }
  return words;
#endif
}

[[nodiscard]] constexpr std::uint8_t crc(const Words& words) noexcept {
  return tm485::crc(words.first() ^ words.second() ^ words.high);
}

/// That a check has passed. Nobody but Frame and Reply can make one, so they alone make frames and replies, and make them
/// where they are wanted: an std::expected that is given one copies it twice.
class Proof {
  friend class tm485::Frame;
  friend class tm485::Reply;
  constexpr explicit Proof() noexcept = default;
};

}  // namespace detail

/// A reply whose length, CF and CRC hold. What its fields say has not been judged yet.
/// 12 or 16 bytes, trivially copyable. All accessors: any thread or interrupt, constant time.
class Frame {
  // First, because a constant expression needs the definition before the use.
  template <unsigned At>
  [[nodiscard]] constexpr std::uint8_t byte() const noexcept {
    const std::uint32_t word = At < 4 ? words_.first() : At < 8 ? words_.second() : words_.high;
    return static_cast<std::uint8_t>(word >> (8 * (At % 4)));
  }
  /// The three bytes behind SF: ABS, or ABM in a reply to ID1.
  [[nodiscard]] constexpr std::uint32_t three_bytes() const noexcept {
    return static_cast<std::uint32_t>(words_.low() >> 16) & 0xFFFFFFU;
  }

 public:
  /// Any reply of the family. Errors: length_error, cf_sync_error, cf_parity_error, unknown_id, crc_error.
  [[nodiscard]] static constexpr std::expected<Frame, Errc> parse(
      std::span<const std::uint8_t> bytes) noexcept {
    if (bytes.empty()) return std::unexpected(Errc::length_error);
    const auto id = parse_control_field(bytes[0]);
    if (!id) return std::unexpected(id.error());
    return parse(bytes, *id);
  }

  /// The reply to a request of `id`. Errors: as above, and cf_mismatch for the reply to another ID.
  [[nodiscard]] static constexpr std::expected<Frame, Errc> parse(std::span<const std::uint8_t> bytes,
                                                                  DataId id) noexcept {
    if (bytes.size() != layout(id).reply_length) return std::unexpected(Errc::length_error);
    if (bytes[0] != control_field(id)) {
      const auto other = parse_control_field(bytes[0]);
      return std::unexpected(other ? Errc::cf_mismatch : other.error());
    }
    const detail::Words words = detail::load_words(bytes);
    if (detail::crc(words) != 0) return std::unexpected(Errc::crc_error);
    return std::expected<Frame, Errc>(std::in_place, detail::Proof{}, words);
  }

  /// Only parse() can, who has the proof.
#if UINTPTR_MAX > UINT32_MAX
  constexpr Frame(detail::Proof, const detail::Words& words) noexcept : words_(words) {}
#else  // one by one: as a whole GCC keeps them in memory on the way
  constexpr Frame(detail::Proof, const detail::Words& words) noexcept
      : words_{words.low_half, words.high_half, words.high} {}
#endif

  [[nodiscard]] constexpr std::uint8_t cf() const noexcept { return byte<0>(); }
  [[nodiscard]] constexpr DataId id() const noexcept { return static_cast<DataId>((byte<0>() >> 3) & 0xFU); }
  [[nodiscard]] constexpr const Layout& fields() const noexcept { return layout(id()); }

  // The fields. Each means something only if fields() has it; they are raw bytes of the reply otherwise.
  // No look-up: where an ID has a field, its place follows from the ID alone.
  [[nodiscard]] constexpr std::uint8_t sf() const noexcept { return byte<1>(); }
  [[nodiscard]] constexpr std::uint8_t enid() const noexcept {
    return id() == DataId::encoder_id ? byte<2>() : byte<5>();
  }
  /// 0 where there is none.
  [[nodiscard]] constexpr std::uint8_t almc() const noexcept { return byte<9>(); }
  [[nodiscard]] constexpr StatusSet status() const noexcept { return {sf(), almc()}; }
  [[nodiscard]] constexpr std::uint8_t adf() const noexcept { return byte<1>(); }
  /// EEPROM address 0..127, without the busy bit.
  [[nodiscard]] constexpr std::uint8_t address() const noexcept { return adf() & 0x7FU; }
  /// ADF bit 7: the EEPROM is busy and EDF is void.
  [[nodiscard]] constexpr bool eeprom_busy() const noexcept { return (adf() & 0x80U) != 0; }
  [[nodiscard]] constexpr std::uint8_t edf() const noexcept { return byte<2>(); }
  /// 24 bits as sent.
  [[nodiscard]] constexpr std::uint32_t abs() const noexcept { return three_bytes(); }
  /// 24 bits as sent; see turns() for the signed count.
  [[nodiscard]] constexpr std::uint32_t abm() const noexcept {
    if (id() == DataId::multi_turn) return three_bytes();
    return words_.second() >> 16 | (words_.high & 0xFFU) << 16;
  }
  /// The turn count: ABM sign-extended from `multi_turn_bits` (8..24; 0: an encoder without, always 0).
  [[nodiscard]] constexpr std::int32_t turns(unsigned multi_turn_bits) const noexcept {
    return multi_turn_bits == 0 ? 0 : sign_extend(abm(), multi_turn_bits);
  }
  [[nodiscard]] constexpr std::uint8_t crc() const noexcept {
    const unsigned length = fields().reply_length;
    return length == kMaxReply ? byte<10>() : length == 6 ? byte<5>() : byte<3>();
  }

  /// Sign-extends the lowest `bits` (1..32) of a value.
  [[nodiscard]] static constexpr std::int32_t sign_extend(std::uint32_t value, unsigned bits) noexcept {
    return static_cast<std::int32_t>(value << (32 - bits)) >> (32 - bits);
  }

 private:
  friend class Reply;
  detail::Words words_;
};

/// A frame that also holds everything the profile fixes. The only source of a Sample.
class Reply {
 public:
  /// Bytes to reply in one step. Errors: those of Frame::parse(bytes, id), and abs_out_of_range,
  /// abm_reserved_bits, enid_unexpected. Any thread or interrupt; constant time.
  [[nodiscard]] static constexpr std::expected<Reply, Errc> parse(std::span<const std::uint8_t> bytes,
                                                                  DataId id,
                                                                  const CompiledProfile& profile) noexcept {
    const ReplyRule& rule = profile.rule(id);
    if (bytes.size() != rule.length) [[unlikely]]
      return std::unexpected(Errc::length_error);
    const detail::Words words = detail::load_words(bytes);
    if (!holds(words, rule, profile)) [[unlikely]]
      return std::unexpected(explain(bytes, id, profile));
    return std::expected<Reply, Errc>(std::in_place, detail::Proof{}, words);
  }

  /// The second step alone, for a frame that was already parsed.
  [[nodiscard]] static constexpr std::expected<Reply, Errc> from(const Frame& frame,
                                                                 const CompiledProfile& profile) noexcept {
    if (!holds(frame.words_, profile.rule(frame.id()), profile))
      return std::unexpected(explain(frame, profile));
    return std::expected<Reply, Errc>(std::in_place, detail::Proof{}, frame.words_);
  }

  /// Only parse() and from() can, who have the proof.
  constexpr Reply(detail::Proof proof, const detail::Words& words) noexcept : frame_(proof, words) {}

  [[nodiscard]] constexpr const Frame& frame() const noexcept { return frame_; }

 private:
  [[nodiscard]] static constexpr bool holds(const detail::Words& words, const ReplyRule& rule,
                                            const CompiledProfile& profile) noexcept {
    const std::uint64_t wrong = ((words.low() & rule.low_mask) ^ rule.low_expected) |
                                ((words.high & rule.high_mask) ^ rule.high_expected) | detail::crc(words);
    if (wrong != 0) [[unlikely]]
      return false;
    return !rule.enid_listed || profile.profile().enids.accepts(Frame(detail::Proof{}, words).enid());
  }

  /// The named cause of a refusal; cold.
  [[nodiscard]] static constexpr Errc explain(const Frame& frame, const CompiledProfile& profile) noexcept {
    const Profile& p = profile.profile();
    if (frame.fields().abs_at != 0 && (frame.abs() >> p.single_turn_bits) != 0) return Errc::abs_out_of_range;
    if (frame.fields().abm_at != 0 && (frame.abm() & p.abm_reserved) != 0) return Errc::abm_reserved_bits;
    return Errc::enid_unexpected;
  }
  [[nodiscard, gnu::cold]] static constexpr Errc explain(std::span<const std::uint8_t> bytes, DataId id,
                                                         const CompiledProfile& profile) noexcept {
    const auto frame = Frame::parse(bytes, id);
    return frame ? explain(*frame, profile) : frame.error();
  }

  Frame frame_;
};

static_assert(sizeof(Reply) <= 16);

// The accessors of Frame know the places by heart; this ties them to the table.
static_assert([] {
  for (const Layout& row : kLayouts) {
    const bool all = row.id == DataId::everything;
    if (row.sf_at > 1 || (row.adf_at != 0 && (row.adf_at != 1 || row.edf_at != 2))) return false;
    if (row.abs_at != 0 && row.abs_at != 2) return false;
    if (row.abm_at != 0 && row.abm_at != (all ? 6 : 2)) return false;
    if (row.enid_at != 0 && row.enid_at != (all ? 5 : 2)) return false;
    if (row.almc_at != 0 && (!all || row.almc_at != 9)) return false;
  }
  return true;
}());

}  // namespace tm485
