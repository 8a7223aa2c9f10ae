// Fault plans in action: what the line carries, what the host hears, what the encoder does.
#include "tm485/sim/fault_player.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <string>

#include "ask.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::sim {
namespace {

constexpr std::uint8_t kId3 = 0x1A;
/// ID3 from a 17-bit encoder at rest at 0, turn 1.
const Bytes kRest{0x1A, 0x00, 0x00, 0x00, 0x00, 0x11, 0x01, 0x00, 0x00, 0x00, 0x0A};

struct Heard {
  Bytes bytes;
  std::vector<Time> starts;  // of the pieces
  bool framing_error = false;
  bool lost = false;
};

/// A simulated encoder with a plan, asked every 100 us.
struct World {
  explicit World(const std::string& plan, const std::string& others = "t2=3us")
      : encoder{good(others + ",plan=" + plan)} {}

  static SimOptions good(const std::string& text) {
    auto options = parse_sim_options(text);
    EXPECT_TRUE(options.has_value()) << (options ? "" : options.error());
    return options.value_or(SimOptions{});
  }

  Heard ask(std::uint8_t cf = kId3) {
    const Bytes request{cf};
    EXPECT_TRUE(encoder.port().try_send(request, at).has_value());
    return listen();
  }
  Heard listen() {
    Heard heard;
    const Time end = at + us(100);
    std::array<std::uint8_t, 64> buffer{};
    for (Time now = at; now < end; now += us(1)) {
      for (;;) {
        const HostReception r = encoder.line().host_receive(buffer, now);
        heard.framing_error = heard.framing_error || r.framing_error;
        heard.lost = heard.lost || r.lost;
        if (r.count == 0) break;
        if (heard.bytes.empty() || heard.starts.empty() || r.first_start > last_end)
          heard.starts.push_back(r.first_start - at);
        last_end = r.first_start + kCharacter * static_cast<std::int64_t>(r.count);
        heard.bytes.insert(heard.bytes.end(), buffer.begin(),
                           buffer.begin() + static_cast<std::ptrdiff_t>(r.count));
      }
    }
    at = end;
    return heard;
  }

  SimulatedEncoder encoder;
  Time at = us(10);
  Time last_end{0};
};

unsigned differing_bits(const Bytes& a, const Bytes& b) {
  unsigned bits = 0;
  for (std::size_t k = 0; k < std::min(a.size(), b.size()); ++k)
    bits += static_cast<unsigned>(std::popcount(static_cast<unsigned>(a[k] ^ b[k])));
  return bits;
}

TEST(FaultPlayer, WithoutFaultsTheReplyIsTheEncoders) {
  World world("");
  const Heard heard = world.ask();
  EXPECT_EQ(heard.bytes, kRest);
  EXPECT_EQ(heard.starts, std::vector<Time>{us(7)});
  EXPECT_FALSE(world.encoder.faults().effects().touched);
}

TEST(FaultPlayer, BitsOfRepliesAndNotOfRequests) {
  World world("bits replies=1");
  const Heard heard = world.ask();
  ASSERT_EQ(heard.bytes.size(), 11u);
  EXPECT_EQ(differing_bits(heard.bytes, kRest), 88u);
  EXPECT_TRUE(world.encoder.faults().effects().bits_changed);
  EXPECT_EQ(world.encoder.faults().bits_flipped(), 88u);
  EXPECT_EQ(world.encoder.model().statistics().requests[3], 1u);
}

TEST(FaultPlayer, ABurstIsARunOfWrongBits) {
  World world("burst bits=8");
  for (int k = 0; k < 200; ++k) {
    const Heard heard = world.ask();
    ASSERT_EQ(heard.bytes.size(), 11u);
    int first = -1;
    int last = -1;
    for (int bit = 0; bit < 88; ++bit) {
      const auto byte = static_cast<std::size_t>(bit / 8);
      if ((((heard.bytes[byte] ^ kRest[byte]) >> (bit % 8)) & 1) == 0) continue;
      if (first < 0) first = bit;
      last = bit;
    }
    EXPECT_EQ(last - first, 7);
  }
}

TEST(FaultPlayer, OnceInASpanOfTime) {
  World world("burst bits=1 every=1ms");
  int wrong = 0;
  for (int k = 0; k < 100; ++k) wrong += world.ask().bytes != kRest ? 1 : 0;
  EXPECT_EQ(wrong, 10) << "10 ms";
  EXPECT_EQ(world.encoder.faults().hits(0), 10u);
}

TEST(FaultPlayer, WithAProbability) {
  World world("wrong-cf p=0.1");
  int wrong = 0;
  for (int k = 0; k < 5'000; ++k) wrong += world.ask().bytes != kRest ? 1 : 0;
  EXPECT_NEAR(wrong, 500, 90) << "about four standard deviations";
}

TEST(FaultPlayer, AStuckColumnInItsWindow) {
  World world("stuck column=3 value=0 from=200us for=200us");
  EXPECT_EQ(world.ask().bytes, kRest);  // at 10 us
  EXPECT_EQ(world.ask().bytes, kRest);  // at 110 us
  const Heard heard = world.ask();      // at 210 us
  Bytes expected = kRest;
  for (auto& byte : expected) byte = static_cast<std::uint8_t>(byte & ~0x08);
  EXPECT_EQ(heard.bytes, expected);
  EXPECT_EQ(world.ask().bytes, expected);  // at 310 us
  EXPECT_EQ(world.ask().bytes, kRest);     // at 410 us
}

TEST(FaultPlayer, InAWindowOfCycles) {
  World world("lose replies=1 cycles=2..3");
  std::string seen;
  for (int k = 0; k < 6; ++k) seen += world.ask().bytes.empty() ? '-' : '+';
  EXPECT_EQ(seen, "++--++");
}

TEST(FaultPlayer, LosesRepliesRequestsAndCharacters) {
  World replies("lose replies=1");
  EXPECT_TRUE(replies.ask().bytes.empty());
  EXPECT_EQ(replies.encoder.model().statistics().replies, 1u);
  World requests("lose requests=1");
  EXPECT_TRUE(requests.ask().bytes.empty());
  EXPECT_EQ(requests.encoder.model().statistics().requests[3], 0u);
  World characters("lose characters=0.5 from=10us cycles=1..");
  EXPECT_EQ(characters.ask().bytes, kRest);
  std::size_t heard = 0;
  for (int k = 0; k < 200; ++k) heard += characters.ask().bytes.size();
  EXPECT_NEAR(static_cast<double>(heard), 200 * 5.5 / 2.0, 150.0) << "half of the requests, half of a reply";
}

TEST(FaultPlayer, ExtraCharactersAreBetweenTheOthers) {
  World world("extra characters=0.2");
  bool longer = false;
  for (int k = 0; k < 50; ++k) {
    const Heard heard = world.ask();
    ASSERT_GE(heard.bytes.size(), kRest.size());
    longer = longer || heard.bytes.size() > kRest.size();
    std::size_t found = 0;
    for (const std::uint8_t byte : heard.bytes)
      if (found < kRest.size() && byte == kRest[found]) ++found;
    EXPECT_EQ(found, kRest.size()) << "the reply's own characters are all there, in order";
  }
  EXPECT_TRUE(longer);
}

TEST(FaultPlayer, LateBytesComeAfterAPause) {
  World world("late bytes=20us");
  for (int k = 0; k < 20; ++k) {
    const Heard heard = world.ask();
    EXPECT_EQ(heard.bytes, kRest);
    ASSERT_EQ(heard.starts.size(), 2u);
    const Time first = heard.starts[1] - heard.starts[0] - us(20);
    EXPECT_EQ(first.count() % kCharacter.count(), 0);
    EXPECT_GE(first, kCharacter);
    EXPECT_LE(first, 10 * kCharacter);
    EXPECT_FALSE(heard.framing_error);
  }
}

// The campaign called a reply broken that had paused: it knew the bytes before the pause only.
TEST(FaultPlayer, KeepsBothPartsOfAReplyThatPaused) {
  World world("late bytes=20us");
  world.encoder.faults().keep_replies(true);
  for (int k = 0; k < 20; ++k) {
    (void)world.ask();
    const Burst& reply = world.encoder.faults().last_reply();
    EXPECT_EQ(Bytes(reply.bytes.begin(), reply.bytes.begin() + reply.count), kRest);
  }
}

// The campaign (seed 1, run 4373) saw the second part of a reply before the first, and its CRC is right in any order.
TEST(FaultPlayer, TheCharactersOfAReplyStayInTheirOrder) {
  for (const char* plan :
       {"late bytes=3us; t2 12us", "t2 12us; late bytes=3us", "late bytes=20us; late bytes=1us"}) {
    World world(plan);
    for (int k = 0; k < 20; ++k) ASSERT_EQ(world.ask().bytes, kRest) << plan;
  }
}

// The campaign (seed 8, run 1345) took a reply for untouched into which the rest of the one before had come.
TEST(FaultPlayer, TheRestOfAReplyThatMeetsTheNextOneIsAChangeOfThat) {
  World world("late bytes=90us cycles=0");
  (void)world.ask();
  EXPECT_FALSE(world.encoder.faults().effects().bits_changed);
  (void)world.ask();
  EXPECT_TRUE(world.encoder.faults().effects().bits_changed);
  EXPECT_TRUE(world.encoder.faults().effects().mixed);
  (void)world.ask();
  EXPECT_FALSE(world.encoder.faults().effects().bits_changed);
}

TEST(FaultPlayer, T2IsWhatThePlanSays) {
  World world("t2 8us cycles=1..");
  EXPECT_EQ(world.ask().starts, std::vector<Time>{us(7)});
  const Heard heard = world.ask();
  EXPECT_EQ(heard.bytes, kRest);
  EXPECT_EQ(heard.starts, std::vector<Time>{us(12)});
  EXPECT_TRUE(world.encoder.faults().effects().touched);
  EXPECT_FALSE(world.encoder.faults().effects().bits_changed);
}

TEST(FaultPlayer, AWrongCfHasARightCrc) {
  World world("wrong-cf");
  for (int k = 0; k < 50; ++k) {
    const Heard heard = world.ask();
    ASSERT_EQ(heard.bytes.size(), 11u);
    EXPECT_NE(heard.bytes[0], kId3);
    EXPECT_TRUE(heard.bytes[0] == 0x02 || heard.bytes[0] == 0x8A || heard.bytes[0] == 0x92);
    unsigned sum = 0;
    for (const std::uint8_t byte : heard.bytes) sum ^= byte;
    EXPECT_EQ(sum, 0u);
    EXPECT_TRUE(std::equal(heard.bytes.begin() + 1, heard.bytes.end() - 1, kRest.begin() + 1));
  }
}

TEST(FaultPlayer, AnOverrunLosesACharacterAndSaysSo) {
  World world("overrun cycles=1..1");
  EXPECT_FALSE(world.ask().lost);
  const Heard heard = world.ask();
  EXPECT_TRUE(heard.lost);
  EXPECT_EQ(heard.bytes.size(), 10u);
  EXPECT_FALSE(world.ask().lost);
}

TEST(FaultPlayer, ALateReleaseSpoilsTheReply) {
  World harmless("late-release 2us");
  EXPECT_EQ(harmless.ask().bytes, kRest) << "2.2 us after the request nobody else is on the line";
  World world("late-release 5us");
  const Heard heard = world.ask();
  EXPECT_TRUE(heard.framing_error);
  ASSERT_EQ(heard.bytes.size(), 11u);
  EXPECT_NE(heard.bytes[0], kRest[0]);
  EXPECT_TRUE(std::equal(heard.bytes.begin() + 1, heard.bytes.end(), kRest.begin() + 1));
  EXPECT_EQ(world.encoder.line().statistics().collisions, 1u);
}

TEST(FaultPlayer, NoiseBeforeTheReplyIsAFalseStartBit) {
  World world("noise-before-reply p=1 cycles=1..1");
  EXPECT_EQ(world.ask().bytes, kRest);
  EXPECT_NE(world.ask().bytes, kRest);
  EXPECT_EQ(world.ask().bytes, kRest);
}

TEST(FaultPlayer, SwappedWires) {
  World world("swapped cycles=1..2; swapped receive cycles=4..4");
  EXPECT_EQ(world.ask().bytes, kRest);
  EXPECT_TRUE(world.ask().bytes.empty()) << "the encoder does not understand the request";
  EXPECT_TRUE(world.ask().bytes.empty());
  EXPECT_EQ(world.ask().bytes, kRest);
  const Heard inverted = world.ask();
  EXPECT_FALSE(inverted.bytes.empty());
  EXPECT_NE(inverted.bytes, kRest);
  EXPECT_EQ(world.ask().bytes, kRest);
}

TEST(FaultPlayer, TheEncodersRateDriftsAway) {
  World world("baud drift=10%/s max=6%; baud offset=1%");
  EXPECT_EQ(world.ask().bytes, kRest) << "1 % is well within what a receiver forgives";
  world.at = ms(100);
  EXPECT_EQ(world.ask().bytes, kRest) << "2 %";
  world.at = ms(600);
  EXPECT_NE(world.ask().bytes, kRest)
      << "7 %: the last bit of a character is read in the one before or after it";
}

TEST(FaultPlayer, TheHostHearsItself) {
  World world("echo cycles=1..1");
  EXPECT_EQ(world.ask().bytes, kRest);
  Bytes both{kId3};
  both.insert(both.end(), kRest.begin(), kRest.end());
  EXPECT_EQ(world.ask().bytes, both);
  EXPECT_EQ(world.ask().bytes, kRest);
}

TEST(FaultPlayer, AnotherTalker) {
  World world("talker every=1ms characters=2 from=1ms");
  unsigned foreign = 0;
  for (int k = 0; k < 10; ++k) EXPECT_EQ(world.ask().bytes, kRest) << k;  // until 1010 us
  for (int k = 0; k < 100; ++k) foreign += static_cast<unsigned>(world.listen().bytes.size());
  EXPECT_NEAR(foreign, 20.0, 10.0) << "two each of ten times in 10 ms";
  EXPECT_EQ(foreign % 2, 0u);
}

TEST(FaultPlayer, ABabblerFillsTheLineAndSpoilsRequests) {
  World world("babble from=1ms for=1ms");
  std::size_t heard = 0;
  while (world.at < us(900)) EXPECT_EQ(world.ask().bytes, kRest);
  while (world.at < us(1'900)) heard += world.ask().bytes.size();
  EXPECT_NEAR(static_cast<double>(heard), 250.0, 60.0)
      << "1 ms of characters, some of them lost in collisions";
  EXPECT_GT(world.encoder.line().statistics().collisions, 0u);
  while (world.at < us(2'200)) (void)world.ask();
  EXPECT_EQ(world.ask().bytes, kRest);
}

TEST(FaultPlayer, ARestartIsSilenceAndThenTheFirstTurn) {
  World world("restart at=6ms off=1ms", "t2=3us,boot=2ms,rpm=60000,start=7");
  world.at = us(2'010);
  while (world.at < us(5'900)) EXPECT_EQ(world.ask().bytes.size(), 11u);
  EXPECT_EQ(world.encoder.model().last_latch().turns, 6) << "1, and a turn every millisecond";
  while (world.at < us(8'900)) {
    const Heard heard = world.ask();
    EXPECT_TRUE(heard.bytes.empty() || world.at < us(6'100)) << world.at.count();
  }
  EXPECT_EQ(world.encoder.faults().effects().last, ms(9)) << "off for 1 ms, then 2 ms of booting";
  EXPECT_TRUE(world.encoder.faults().effects().restarted);
  while (world.at < us(9'100)) (void)world.ask();
  EXPECT_EQ(world.ask().bytes.size(), 11u);
  EXPECT_EQ(world.encoder.model().last_latch().turns, 3) << "1, and what it has turned since 7 ms";
  EXPECT_EQ(world.encoder.model().statistics().power_ups, 2u);
}

TEST(FaultPlayer, RestartsAgainAndAgain) {
  World world("restart at=1ms off=100us every=2ms until=6ms");
  while (world.at < ms(10)) (void)world.ask();
  EXPECT_EQ(world.encoder.model().statistics().power_ups, 1u + 3u) << "at 1, 3 and 5 ms";
}

TEST(FaultPlayer, AnAlarmForAWhile) {
  World world("alarm almc=40 from=100us for=100us; alarm 04 from=100us for=200us");
  EXPECT_EQ(world.ask().bytes[9], 0x00);
  Heard heard = world.ask();  // at 110 us
  EXPECT_EQ(heard.bytes[9], 0x44);
  EXPECT_EQ(heard.bytes[1], 0x30);
  heard = world.ask();
  EXPECT_EQ(heard.bytes[9], 0x04);
  EXPECT_EQ(heard.bytes[1], 0x10);
  EXPECT_EQ(world.ask().bytes, kRest);
}

TEST(FaultPlayer, AFrozenSensorKeepsAnsweringWithoutAnAlarm) {
  World world("frozen from=300us for=300us", "t2=3us,rpm=600");
  Bytes before;
  while (world.at < us(300)) before = world.ask().bytes;
  const Heard frozen = world.ask();
  EXPECT_NE(frozen.bytes, before);
  EXPECT_EQ(world.ask().bytes, frozen.bytes);
  EXPECT_EQ(world.ask().bytes, frozen.bytes);
  EXPECT_EQ(frozen.bytes[1], 0x00);
  EXPECT_TRUE(world.encoder.faults().effects().frozen);
  const std::int64_t shaft = world.encoder.model().shaft_counts(us(614));
  EXPECT_NE(world.ask().bytes, frozen.bytes);
  EXPECT_EQ(world.encoder.model().last_latch().counts, shaft) << "where it really was all the time";
  EXPECT_FALSE(world.encoder.faults().effects().frozen);
}

TEST(FaultPlayer, SeveralComposeInTheOrderOfThePlan) {
  World set_then_flip("stuck column=0 value=1; burst bits=88");
  World flip_then_set("burst bits=88; stuck column=0 value=1");
  unsigned odd = 0;
  for (int k = 0; k < 20; ++k) {
    for (const std::uint8_t byte : set_then_flip.ask().bytes) odd += byte & 1u;
    for (const std::uint8_t byte : flip_then_set.ask().bytes) EXPECT_EQ(byte & 1u, 1u);
  }
  EXPECT_LT(odd, 180u) << "of 220: what is stuck before it is flipped does not stay";
}

TEST(FaultPlayer, TheSameSeedDoesTheSameAgain) {
  const std::string plan =
      "bits requests=1e-3 replies=1e-2; lose characters=0.01; extra characters=0.01; burst bits=5 p=0.1; "
      "late bytes=9us p=0.05; talker every=300us characters=3; wrong-cf p=0.1; overrun p=0.1; "
      "noise-before-reply p=0.1";
  const auto run = [&](const char* seed) {
    World world(plan, std::string("t2=2.8us..3.2us,rpm=3000,seed=") + seed);
    Bytes all;
    for (int k = 0; k < 500; ++k) {
      const Heard heard = world.ask();
      all.insert(all.end(), heard.bytes.begin(), heard.bytes.end());
    }
    return all;
  };
  const Bytes first = run("7");
  EXPECT_EQ(run("7"), first);
  EXPECT_NE(run("8"), first);
}

}  // namespace
}  // namespace tm485::sim
