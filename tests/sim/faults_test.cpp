#include "tm485/sim/faults.hpp"

#include <gtest/gtest.h>

#include "ask.hpp"
#include "tm485/sim/line.hpp"

namespace tm485::sim {
namespace {

Burst burst_of(Talker talker, std::uint8_t count) {
  Burst burst;
  burst.talker = talker;
  burst.count = count;
  burst.bytes.fill(0);
  return burst;
}

TEST(BitErrors, NoneAtProbabilityZero) {
  BitErrors fault{0.0, 0.0, 1};
  for (int k = 0; k < 1000; ++k) {
    Burst burst = burst_of(Talker::encoder, 32);
    EXPECT_FALSE(fault.on_burst(burst));
  }
}

TEST(BitErrors, EveryBitAtProbabilityOne) {
  BitErrors fault{1.0, 0.0, 1};
  Burst burst = burst_of(Talker::host, 4);
  EXPECT_TRUE(fault.on_burst(burst));
  for (std::size_t k = 0; k < 4; ++k) EXPECT_EQ(burst.bytes[k], 0xFF);
  EXPECT_EQ(burst.bytes[4], 0x00);
  Burst reply = burst_of(Talker::encoder, 4);
  EXPECT_FALSE(fault.on_burst(reply));
}

TEST(BitErrors, KeepsItsProbabilityAndCountsWhatItFlips) {
  BitErrors fault{0.0, 0.01, 5};
  std::uint64_t seen = 0;
  for (int k = 0; k < 20'000; ++k) {
    Burst burst = burst_of(Talker::encoder, 11);
    fault.on_burst(burst);
    for (std::size_t i = 0; i < 11; ++i) seen += static_cast<unsigned>(std::popcount(burst.bytes[i]));
  }
  EXPECT_EQ(seen, fault.bits_flipped());
  EXPECT_NEAR(static_cast<double>(seen), 0.01 * 20'000 * 88, 500.0);  // about four standard deviations
}

TEST(LostCharacters, AllRepliesAtProbabilityOneAndNoRequests) {
  LostCharacters fault{1.0, 0.0, 1};
  Burst reply = burst_of(Talker::encoder, 11);
  EXPECT_TRUE(fault.on_burst(reply));
  EXPECT_EQ(reply.count, 0);
  Burst request = burst_of(Talker::host, 1);
  EXPECT_FALSE(fault.on_burst(request));
  EXPECT_EQ(request.count, 1);
}

TEST(LostCharacters, SingleCharactersCloseUp) {
  LostCharacters fault{0.0, 0.5, 3};
  Burst burst = burst_of(Talker::encoder, 32);
  for (std::uint8_t k = 0; k < 32; ++k) burst.bytes[k] = k;
  EXPECT_TRUE(fault.on_burst(burst));
  ASSERT_GT(burst.count, 0);
  ASSERT_LT(burst.count, 32);
  for (std::uint8_t k = 1; k < burst.count; ++k) EXPECT_LT(burst.bytes[k - 1u], burst.bytes[k]);
  EXPECT_EQ(fault.characters_lost(), 32u - burst.count);
}

TEST(FaultHook, ALostReplyIsSilenceOnTheLine) {
  EncoderModel encoder;
  Line line{&encoder};
  LostCharacters fault{1.0, 0.0, 1};
  line.set_fault_hook(&fault);
  const Bytes request{0x1A};
  line.transmit(Talker::host, us(0), request, us(-1), us(5));
  EXPECT_EQ(line.next_event(), kNever);
  Bytes buffer(16);
  EXPECT_EQ(line.host_receive(buffer, us(100)).count, 0u);
  EXPECT_EQ(encoder.statistics().replies, 1u);
}

TEST(FaultHook, AnAlteredRequestIsNotHeldAgainstTheHost) {
  EncoderModel encoder;
  Line line{&encoder};
  BitErrors fault{1.0, 0.0, 1};
  line.set_fault_hook(&fault);
  const Bytes request{static_cast<std::uint8_t>(~0x1A)};
  line.transmit(Talker::host, us(0), request, us(-1), us(4));
  line.set_fault_hook(nullptr);
  const Bytes good{0x02};
  line.transmit(Talker::host, us(55), good, us(54), us(59));
  line.advance_to(us(200));
  EXPECT_EQ(encoder.statistics().requests[3], 1u);
  EXPECT_EQ(encoder.t1().violations(), 0u);
}

TEST(FaultHook, MayShiftABurstInTime) {
  class Delay final : public FaultHook {
   public:
    bool on_burst(Burst& burst) noexcept override {
      if (burst.talker != Talker::encoder) return false;
      burst.start += us(10);
      burst.driver_on += us(10);
      burst.driver_off += us(10);
      return true;
    }
  } delay;
  EncoderModel encoder{{.t2_min = us(3), .t2_max = us(3)}};
  Line line{&encoder};
  line.set_fault_hook(&delay);
  const Bytes request{0x92};
  line.transmit(Talker::host, us(0), request, us(-1), us(5));
  EXPECT_EQ(line.next_event(), us(4 + 3 + 10 + 16));
}

TEST(FaultChain, AppliesEachInTurnAndHasABound) {
  BitErrors all{0.0, 1.0, 1};
  FaultChain chain;
  EXPECT_TRUE(chain.empty());
  for (std::size_t k = 0; k < FaultChain::kCapacity; ++k) EXPECT_TRUE(chain.add(all));
  EXPECT_FALSE(chain.add(all));
  Burst burst = burst_of(Talker::encoder, 1);
  EXPECT_TRUE(chain.on_burst(burst));
  EXPECT_EQ(burst.bytes[0], 0x00);  // flipped an even number of times
}

}  // namespace
}  // namespace tm485::sim
