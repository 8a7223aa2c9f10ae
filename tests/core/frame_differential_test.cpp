// A million byte strings, random and mutated: Reply::parse and the slow decoder agree on verdict and fields.
#include <gtest/gtest.h>

#include <map>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "support/slow_decoder.hpp"
#include "tm485/protocol/frame.hpp"

namespace tm485 {
namespace {

using test::Bytes;
using test::kKinds;
using test::Rng;

/// A valid reply, hit or cut in one of the ways that a line has.
Bytes mutated(Rng& rng, const test::Kind& asked) {
  const auto& kind = test::random_below(rng, 16) == 0 ? kKinds[test::random_below(rng, 9)] : asked;
  const unsigned bits = test::random_below(rng, 4) == 0 ? 24 : test::random_below(rng, 2) == 0 ? 23 : 17;
  constexpr std::uint8_t kEnids[] = {0x00, 0x11, 0x17, 0x10};
  Bytes bytes = test::random_reply(rng, kind, bits, kEnids[test::random_below(rng, 4)]);
  const auto at = [&] { return test::random_below(rng, bytes.size()); };
  switch (test::random_below(rng, 10)) {
    case 0:
    case 1:
    case 2:
      return bytes;
    case 3:
      bytes[at()] ^= static_cast<std::uint8_t>(1 << test::random_below(rng, 8));
      return bytes;
    case 4: {  // two flips in one column
      const auto bit = static_cast<std::uint8_t>(1 << test::random_below(rng, 8));
      bytes[at()] ^= bit;
      bytes[at()] ^= bit;
      return bytes;
    }
    case 5:
      std::swap(bytes[at()], bytes[at()]);
      return bytes;
    case 6:
      bytes.resize(test::random_below(rng, 16));
      return bytes;
    case 7:
      bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(at()), 0);
      return bytes;
    case 8:
      bytes[0] = test::random_byte(rng);
      bytes.pop_back();
      return test::sealed(bytes);
    default:
      bytes[at()] = test::random_byte(rng);
      bytes.pop_back();
      return test::sealed(bytes);
  }
}

Bytes noise(Rng& rng, const test::Kind& asked) {
  Bytes bytes(test::random_below(rng, 2) == 0 ? asked.back : test::random_below(rng, 20));
  for (auto& byte : bytes) byte = test::random_byte(rng);
  return bytes;
}

TEST(FrameDifferential, AMillionStringsAreJudgedAlike) {
  std::vector<CompiledProfile> profiles;
  for (const auto& slow : test::kSlowProfiles) profiles.push_back(test::compiled(slow.name));
  ASSERT_EQ(profiles.size(), profile_presets().size());
  Rng rng(30);
  std::map<std::string_view, std::size_t> verdicts;
  for (int round = 0; round < 1'000'000; ++round) {
    const auto& asked = kKinds[test::random_below(rng, 9)];
    const std::size_t which = test::random_below(rng, profiles.size());
    const Bytes bytes = round % 4 == 0 ? noise(rng, asked) : mutated(rng, asked);
    const auto slow = test::slow_parse(bytes, asked.id, test::kSlowProfiles[which]);
    const auto reply = Reply::parse(bytes, static_cast<DataId>(asked.id), profiles[which]);
    ASSERT_EQ(name(test::error_of(reply)), slow.error)
        << "ID " << asked.id << " " << test::kSlowProfiles[which].name << " "
        << testing::PrintToString(bytes);
    ++verdicts[slow.error];
    if (!reply) continue;
    const Frame& frame = reply->frame();
    ASSERT_EQ(number(frame.id()), slow.id);
    // A field means something only where the reply has it.
    for (const char letter : test::shape_of(asked.id)) {
      switch (letter) {
        case 's':
          ASSERT_EQ(frame.sf(), slow.sf);
          break;
        case 'a':
          ASSERT_EQ(frame.abs(), slow.abs);
          break;
        case 'e':
          ASSERT_EQ(frame.enid(), slow.enid);
          break;
        case 'm':
          ASSERT_EQ(frame.abm(), slow.abm);
          break;
        case 'd':
          ASSERT_EQ(frame.adf(), slow.adf);
          break;
        case 'D':
          ASSERT_EQ(frame.edf(), slow.edf);
          break;
        default:
          break;
      }
    }
    ASSERT_EQ(frame.almc(), slow.almc) << "0 where there is none";
  }
  // Every verdict was reached, and often: the strings were not all refused at the first check.
  for (const char* verdict :
       {"ok", "length_error", "cf_sync_error", "cf_parity_error", "unknown_id", "cf_mismatch", "crc_error",
        "abs_out_of_range", "abm_reserved_bits", "enid_unexpected"})
    EXPECT_GT(verdicts[verdict], 1'000U) << verdict;
}

}  // namespace
}  // namespace tm485
