// Reply::parse with profiles of any widths, masks and encoder IDs, against the slow decoder and rules written out here.
#include <vector>

#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "support/frames.hpp"
#include "support/slow_decoder.hpp"
#include "tm485/protocol/frame.hpp"

namespace tm485::fuzz {
namespace {

constexpr test::SlowProfile kAny{"any", 24, false, 0, {}};

/// What the specification says of a profile, byte by byte.
std::string_view judge(const test::SlowReply& reply, const Profile& profile) {
  if (reply.error != "ok") return reply.error;
  bool has_enid = false;
  for (const char letter : test::shape_of(reply.id)) has_enid = has_enid || letter == 'e';
  for (unsigned bit = 0; bit < 24; ++bit)
    if (bit >= profile.single_turn_bits && (reply.abs >> bit) % 2 != 0) return "abs_out_of_range";
  for (unsigned bit = 0; bit < 24; ++bit)
    if ((profile.abm_reserved >> bit) % 2 != 0 && (reply.abm >> bit) % 2 != 0) return "abm_reserved_bits";
  if (!has_enid || profile.enids.count == 0) return "ok";
  for (std::size_t i = 0; i < profile.enids.count; ++i)
    if (profile.enids.values[i] == reply.enid) return "ok";
  return "enid_unexpected";
}

}  // namespace

/// The profile, the ID that is asked for, whether the CRC is put right, then the bytes.
int fuzz_reply(std::span<const std::uint8_t> bytes) {
  Input input(bytes);
  Profile profile;
  profile.single_turn_bits = static_cast<std::uint8_t>(6 + input.below(21));
  profile.multi_turn_bits = static_cast<std::uint8_t>(input.below(27));
  profile.abm_reserved = input.u32() & 0x1FFFFFF;
  profile.enids.count = static_cast<std::uint8_t>(input.below(6));
  for (auto& enid : profile.enids.values) enid = input.u8();
  const test::Kind& asked = test::kKinds[input.below(9)];
  const bool seal = input.flag();
  std::vector<std::uint8_t> frame(input.rest().begin(), input.rest().end());
  if (seal && !frame.empty()) {
    frame.pop_back();
    frame = test::sealed(frame);
  }
  const auto compiled = CompiledProfile::compile(profile);
  const unsigned turn_bits = profile.multi_turn_bits;
  std::uint32_t counted = 0;
  for (unsigned bit = 0; bit < turn_bits && bit < 24; ++bit) counted += std::uint32_t{1} << bit;
  const bool sound = profile.single_turn_bits >= 8 && profile.single_turn_bits <= 24 &&
                     (turn_bits == 0 || (turn_bits >= 8 && turn_bits <= 24)) && profile.enids.count <= 4 &&
                     profile.abm_reserved < 0x1000000 && (profile.abm_reserved & counted) == 0;
  require(compiled.has_value() == sound,
          "a profile is refused for what is wrong with it, and for nothing else");
  if (!compiled) return 0;

  const auto id = static_cast<DataId>(asked.id);
  const test::SlowReply slow = test::slow_parse(frame, asked.id, kAny);
  const std::string_view verdict = judge(slow, profile);
  const auto reply = Reply::parse(frame, id, *compiled);
  require((reply ? name(Errc::ok) : name(reply.error())) == verdict, "verdict");
  if (const auto parsed = Frame::parse(frame, id)) {
    const auto in_two_steps = Reply::from(*parsed, *compiled);
    require((in_two_steps ? name(Errc::ok) : name(in_two_steps.error())) == verdict, "verdict in two steps");
  } else {
    require(!reply, "no reply without a frame");
  }
  return 0;
}

}  // namespace tm485::fuzz
