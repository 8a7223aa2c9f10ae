// A port that knows what went wrong on the line: the bus asks it after a failed exchange, and only then.
#include <gtest/gtest.h>

#include "support/bus_fixture.hpp"

namespace tm485 {
namespace {

using namespace test;

class FaultTellingPort : public ScriptedPort {
 public:
  Errc fault = Errc::ok;
  int asked = 0;
  Errc line_fault() noexcept {
    ++asked;
    return std::exchange(fault, Errc::ok);
  }
};
static_assert(Port<FaultTellingPort>);

struct Case {
  const char* name;
  Errc without;  ///< the cause that the bus finds by itself
  void (*edit)(ScriptedPort::Answer&);
};

class BusLineFault : public testing::TestWithParam<Case> {
 protected:
  BusLineFault() : profile_(compiled(preset("tm485_17"))), bus_(port_, profile_, BusConfig{}) {
    port_.answer = [this](const Bytes& request, Time) {
      ScriptedPort::Answer answer;
      answer.bytes = encoder_.reply(request);
      if (spoil_ != nullptr) {
        spoil_(answer);
        spoil_ = nullptr;
        port_.fault = fault_;
      }
      return answer;
    };
  }
  bool cycles(std::uint32_t count) {
    const std::uint32_t end = bus_.statistics().cycles + count;
    return driver_.run(bus_, port_, driver_.now + ms(1'000), [&] { return bus_.statistics().cycles >= end; });
  }
  Errc spoiled(Errc fault) {
    fault_ = fault;
    spoil_ = GetParam().edit;
    EXPECT_TRUE(cycles(1));
    const Errc result = bus_.last_record().result;
    EXPECT_TRUE(cycles(3));
    return result;
  }

  PlainEncoder encoder_;
  FaultTellingPort port_;
  CompiledProfile profile_;
  Bus<FaultTellingPort> bus_;
  Driver driver_;
  void (*spoil_)(ScriptedPort::Answer&) = nullptr;
  Errc fault_ = Errc::ok;
};

INSTANTIATE_TEST_SUITE_P(
    All, BusLineFault,
    testing::Values(Case{"Contents", Errc::crc_error, [](ScriptedPort::Answer& a) { a.bytes[3] ^= 1; }},
                    Case{"Echo", Errc::cf_mismatch,
                         [](ScriptedPort::Answer& a) {
                           a.bytes = id0_reply(1);
                           a.bytes.resize(11);
                         }},
                    Case{"Length", Errc::incomplete_reply,
                         [](ScriptedPort::Answer& a) { a.bytes.pop_back(); }},
                    Case{"Silence", Errc::timeout, [](ScriptedPort::Answer& a) { a.bytes.clear(); }}),
    [](const auto& test) { return std::string(test.param.name); });

TEST_P(BusLineFault, NamesTheCauseOfAFailedExchange) {
  ASSERT_TRUE(bus_.start(driver_.now));
  ASSERT_TRUE(cycles(10));
  const int before = port_.asked;
  ASSERT_TRUE(cycles(100));
  EXPECT_EQ(port_.asked, before) << "not while all is well";
  EXPECT_EQ(spoiled(Errc::ok), GetParam().without);
  EXPECT_EQ(port_.asked, before + 1);
  EXPECT_EQ(spoiled(Errc::overrun), Errc::overrun);
  EXPECT_EQ(spoiled(Errc::framing_error), Errc::framing_error);
  EXPECT_EQ(bus_.statistics().errors[static_cast<std::size_t>(Errc::overrun)], 1U);
  EXPECT_EQ(bus_.statistics().errors[static_cast<std::size_t>(Errc::framing_error)], 1U);
  EXPECT_EQ(bus_.statistics().failed, 3U);
  const int asked = port_.asked;
  fault_ = Errc::overrun;
  spoil_ = [](ScriptedPort::Answer& a) { a.bytes = id3_reply(1U << 17, 1); };
  ASSERT_TRUE(cycles(1));
  EXPECT_EQ(bus_.last_record().result, Errc::abs_out_of_range) << "it came whole: not the line's fault";
  EXPECT_EQ(port_.asked, asked);
}

}  // namespace
}  // namespace tm485
