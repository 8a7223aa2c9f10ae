// Frame and Reply: fields, their limits, and that neither can be made in another way.
#include "tm485/protocol/frame.hpp"

#include <gtest/gtest.h>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"
#include "tm485/motion/position_tracker.hpp"
#include "tm485/motion/sample.hpp"

namespace tm485 {
namespace {

using test::Bytes;
using test::compiled;
using test::error_of;
using test::kKinds;

// A Frame comes from Frame::parse, a Reply from a profile's judgement, a fresh Sample from a tracker. Nothing else.
static_assert(!std::is_default_constructible_v<Frame>);
static_assert(!std::is_constructible_v<Frame, std::span<const std::uint8_t>>);
static_assert(!std::is_constructible_v<Frame, detail::Words>);
static_assert(!std::is_constructible_v<Frame, std::uint64_t, std::uint32_t>);
static_assert(!std::is_aggregate_v<Frame>);
static_assert(!std::is_default_constructible_v<Reply>);
static_assert(!std::is_constructible_v<Reply, Frame>);
static_assert(!std::is_constructible_v<Reply, Frame, CompiledProfile>);
static_assert(!std::is_convertible_v<Frame, Reply>);
static_assert(!std::is_assignable_v<Reply&, Frame>);
static_assert(!std::is_aggregate_v<Reply>);
static_assert(!std::is_aggregate_v<Sample>);
static_assert(!std::is_constructible_v<Sample, Reply>);
static_assert(!std::is_constructible_v<Sample, Frame>);
static_assert(!std::is_constructible_v<Sample, Quality>);
template <class Source>
concept BecomesASample =
    requires(PositionTracker& tracker, const Source& source) { tracker.update(source, Time{0}); };
static_assert(BecomesASample<Reply> && !BecomesASample<Frame> && !BecomesASample<test::Bytes>);
static_assert(!std::is_default_constructible_v<CompiledProfile>);
static_assert(!std::is_constructible_v<CompiledProfile, Profile>);
static_assert(std::is_trivially_copyable_v<Frame> && sizeof(Frame) <= 16);
static_assert(std::is_trivially_copyable_v<Reply> && sizeof(Reply) <= 16);
static_assert(std::is_trivially_copyable_v<Sample> && sizeof(Sample) <= 64);

// Decoding works at compile time and gives the same.
constexpr std::uint8_t kId3[] = {0x1A, 0x30, 0x34, 0x12, 0x00, 0x11, 0x02, 0x00, 0x00, 0xC4, 0xDB};
static_assert(Frame::parse(kId3)->abs() == 0x1234 && Frame::parse(kId3)->abm() == 2 &&
              Frame::parse(kId3)->almc() == 0xC4);
static_assert(Reply::parse(kId3, DataId::everything, *CompiledProfile::compile(Profile{}))->frame().enid() ==
              0x11);

TEST(Frame, EveryFieldOfEveryReplyIsWhereTheTableSays) {
  test::Rng rng(10);
  for (int round = 0; round < 500; ++round) {
    for (const auto& kind : kKinds) {
      const Bytes bytes = test::random_reply(rng, kind, 24, test::random_byte(rng));
      const auto frame = Frame::parse(bytes);
      ASSERT_TRUE(frame) << kind.id;
      ASSERT_EQ(number(frame->id()), kind.id);
      ASSERT_EQ(frame->cf(), kind.cf);
      ASSERT_EQ(frame->crc(), bytes.back());
      const auto u24 = [&](std::size_t at) {
        return bytes[at] + 256U * bytes[at + 1] + 65536U * bytes[at + 2];
      };
      const bool eeprom = kind.id == 6 || kind.id == 13;
      const bool has_abs = kind.id == 0 || kind.id == 3 || kind.id == 7 || kind.id == 8 || kind.id == 12;
      const bool has_abm = kind.id == 1 || kind.id == 3;
      if (has_abs) {
        ASSERT_EQ(frame->abs(), u24(2));
      }
      if (has_abm) {
        ASSERT_EQ(frame->abm(), u24(kind.id == 1 ? 2 : 6));
      }
      if (kind.id == 2 || kind.id == 3) {
        ASSERT_EQ(frame->enid(), bytes[kind.id == 2 ? 2 : 5]);
      }
      if (eeprom) {
        ASSERT_EQ(frame->adf(), bytes[1]);
        ASSERT_EQ(frame->address(), bytes[1] & 0x7F);
        ASSERT_EQ(frame->eeprom_busy(), bytes[1] >= 0x80);
        ASSERT_EQ(frame->edf(), bytes[2]);
        continue;
      }
      ASSERT_EQ(frame->sf(), bytes[1]);
      ASSERT_EQ(frame->almc(), kind.id == 3 ? bytes[9] : 0) << "0 where there is none";
      ASSERT_EQ(frame->status(), StatusSet(frame->sf(), frame->almc()));
    }
  }
}

TEST(Frame, EveryByteOfAnId3ReplyCarriesAllItsValues) {
  for (std::size_t at = 1; at < 10; ++at) {
    for (unsigned value = 0; value < 256; ++value) {
      Bytes bytes{0x1A, 0, 0, 0, 0, 0, 0, 0, 0, 0};
      bytes[at] = static_cast<std::uint8_t>(value);
      const auto frame = Frame::parse(test::sealed(bytes));
      ASSERT_TRUE(frame);
      ASSERT_EQ(frame->sf(), at == 1 ? value : 0);
      ASSERT_EQ(frame->abs(), at >= 2 && at <= 4 ? value << (8 * (at - 2)) : 0U);
      ASSERT_EQ(frame->enid(), at == 5 ? value : 0);
      ASSERT_EQ(frame->abm(), at >= 6 && at <= 8 ? value << (8 * (at - 6)) : 0U);
      ASSERT_EQ(frame->almc(), at == 9 ? value : 0);
    }
  }
}

TEST(Frame, TurnsAreSignExtendedFromTheAbmWidth) {
  const struct {
    std::uint32_t abm;
    unsigned bits;
    std::int32_t turns;
  } kCases[] = {{0, 16, 0},       {1, 16, 1},         {0x7FFF, 16, 32767},      {0x8000, 16, -32768},
                {0xFFFF, 16, -1}, {0x1FFFF, 16, -1},  {0x10001, 16, 1},         {0xFF, 8, -1},
                {0x7F, 8, 127},   {0xFFFFFF, 24, -1}, {0x800000, 24, -8388608}, {0x7FFFFF, 24, 8388607}};
  for (const auto& c : kCases) {
    EXPECT_EQ(Frame::parse(test::id1_reply(c.abm))->turns(c.bits), c.turns) << c.abm;
    EXPECT_EQ(Frame::parse(test::id3_reply(0, c.abm))->turns(c.bits), c.turns) << c.abm;
  }
  EXPECT_EQ(Frame::sign_extend(0xFFFFFFFF, 32), -1);
}

struct AbsCase {
  const char* profile;
  unsigned bits;
  std::uint8_t enid;
};
class AbsLimits : public testing::TestWithParam<AbsCase> {};

TEST_P(AbsLimits, LastValueIsGoodAndTheNextIsNamed) {
  const auto [profile_name, bits, enid] = GetParam();
  const CompiledProfile profile = compiled(profile_name);
  const std::uint32_t range = 1U << bits;
  for (const auto& kind : kKinds) {
    if (kind.back != 6 && kind.back != 11) continue;
    if (kind.id == 1) continue;
    const auto id = static_cast<DataId>(kind.id);
    const auto reply = [&, cf = kind.cf, three = kind.id == 3](std::uint32_t abs) {
      return three ? test::id3_reply(abs, 0, enid) : test::short_reply(cf, abs);
    };
    for (const std::uint32_t abs : {0U, 1U, range / 2, range - 1}) {
      const auto good = Reply::parse(reply(abs), id, profile);
      ASSERT_TRUE(good) << kind.id << " " << abs;
      EXPECT_EQ(good->frame().abs(), abs);
    }
    for (unsigned bit = bits; bit < 24; ++bit) {
      EXPECT_EQ(error_of(Reply::parse(reply(1U << bit), id, profile)), Errc::abs_out_of_range)
          << kind.id << " bit " << bit;
      EXPECT_TRUE(Frame::parse(reply(1U << bit), id)) << "as a frame it is good";
    }
    EXPECT_EQ(error_of(Reply::parse(reply(0xFFFFFF), id, profile)), Errc::abs_out_of_range);
  }
}
INSTANTIATE_TEST_SUITE_P(Presets, AbsLimits,
                         testing::Values(AbsCase{"tm485_17", 17, 0x11}, AbsCase{"tm485_17_st", 17, 0x00},
                                         AbsCase{"tm485_23", 23, 0x17}, AbsCase{"tformat_17", 17, 0x17},
                                         AbsCase{"tformat_17_battery", 17, 0x11},
                                         AbsCase{"tformat_23", 23, 0x17},
                                         AbsCase{"tformat_23_battery", 23, 0x17}),
                         [](const auto& row) { return std::string(row.param.profile); });

TEST(Reply, AnyTakesAll24BitsOfAbs) {
  EXPECT_EQ(Reply::parse(test::id0_reply(0xFFFFFF), DataId::single_turn, compiled("any"))->frame().abs(),
            0xFFFFFFU);
}

TEST(Reply, AbmAtItsLimits) {
  for (const char* name : {"tm485_17", "tm485_23", "tformat_17", "tformat_23"}) {
    const CompiledProfile profile = compiled(name);
    const std::uint8_t enid = profile.profile().enids.values[0];
    const auto both = [&](std::uint32_t abm) {
      const Errc alone = error_of(Reply::parse(test::id1_reply(abm), DataId::multi_turn, profile));
      const Errc all = error_of(Reply::parse(test::id3_reply(5, abm, enid), DataId::everything, profile));
      EXPECT_EQ(alone, all) << name << " " << abm;
      return alone;
    };
    for (const std::uint32_t abm : {0U, 1U, 0x7FFFU, 0x8000U, 0xFFFFU})
      EXPECT_EQ(both(abm), Errc::ok) << name << " " << abm;
    EXPECT_EQ(both(0x10000), Errc::ok) << "bit 16 is left open (A-1)";
    EXPECT_EQ(both(0x1FFFF), Errc::ok) << "bit 16 is left open (A-1)";
    for (unsigned bit = 17; bit < 24; ++bit)
      EXPECT_EQ(both(1U << bit), Errc::abm_reserved_bits) << name << " bit " << bit;
  }
  EXPECT_TRUE(Reply::parse(test::id1_reply(0xFFFFFF), DataId::multi_turn, compiled("any")));
  EXPECT_TRUE(Reply::parse(test::id1_reply(0xFFFFFF), DataId::multi_turn, compiled("tm485_17_st")));
}

TEST(Reply, EnidMustBeOfTheList) {
  Profile many;
  many.enids = EnidSet{{0x00, 0x11, 0x17, 0x81}, 4};
  const struct {
    CompiledProfile profile;
    std::vector<unsigned> good;
  } kCases[] = {{compiled("tm485_17"), {0x11}},   {compiled("tm485_17_st"), {0x00}},
                {compiled("tm485_23"), {0x17}},   {compiled("tformat_17"), {0x11, 0x17}},
                {compiled("tformat_23"), {0x17}}, {compiled(many), {0x00, 0x11, 0x17, 0x81}}};
  for (const auto& c : kCases) {
    for (unsigned enid = 0; enid < 256; ++enid) {
      const bool good = std::find(c.good.begin(), c.good.end(), enid) != c.good.end();
      const Errc expected = good ? Errc::ok : Errc::enid_unexpected;
      const auto value = static_cast<std::uint8_t>(enid);
      EXPECT_EQ(error_of(Reply::parse(test::id2_reply(value), DataId::encoder_id, c.profile)), expected)
          << enid;
      EXPECT_EQ(error_of(Reply::parse(test::id3_reply(0, 0, value), DataId::everything, c.profile)), expected)
          << enid;
    }
  }
  for (unsigned enid = 0; enid < 256; ++enid)
    EXPECT_TRUE(
        Reply::parse(test::id2_reply(static_cast<std::uint8_t>(enid)), DataId::encoder_id, compiled("any")));
}

TEST(Reply, NoStatusBitEverDropsAPosition) {
  for (const Profile& p : profile_presets()) {
    const CompiledProfile profile = compiled(p);
    const std::uint8_t enid = p.enids.values[0];
    for (unsigned value = 0; value < 256; ++value) {
      const auto byte = static_cast<std::uint8_t>(value);
      EXPECT_TRUE(Reply::parse(test::id0_reply(7, byte), DataId::single_turn, profile)) << p.name;
      EXPECT_TRUE(Reply::parse(test::id3_reply(7, 0, enid, byte, 0), DataId::everything, profile)) << p.name;
      EXPECT_TRUE(Reply::parse(test::id3_reply(7, 0, enid, 0, byte), DataId::everything, profile)) << p.name;
    }
  }
}

TEST(Reply, FromAFrameJudgesLikeParse) {
  test::Rng rng(11);
  const CompiledProfile profile = compiled("tformat_17");
  int refused = 0;
  for (int round = 0; round < 20'000; ++round) {
    const auto& kind = kKinds[test::random_below(rng, 9)];
    const Bytes bytes = test::random_reply(rng, kind, 17 + static_cast<unsigned>(test::random_below(rng, 3)),
                                           test::random_below(rng, 2) == 0 ? 0x17 : 0x13);
    const auto whole = Reply::parse(bytes, static_cast<DataId>(kind.id), profile);
    const auto step = Reply::from(*Frame::parse(bytes), profile);
    ASSERT_EQ(error_of(whole), error_of(step));
    refused += whole ? 0 : 1;
  }
  EXPECT_GT(refused, 1'000);
}

}  // namespace
}  // namespace tm485
