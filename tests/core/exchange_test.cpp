// Exchange: bytes and time in, a verdict out; every wait has an edge and the edge is exact.
#include "tm485/bus/exchange.hpp"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/frames.hpp"
#include "support/print.hpp"
#include "support/profiles.hpp"

namespace tm485 {
namespace {

using test::Bytes;
using test::ns;
using test::us;
using State = Exchange::State;

/// An exchange that began at 100 µs, with its profile and port.
class Talk {
 public:
  explicit Talk(DataId id = DataId::everything, bool wire_timestamps = true, bool echo = false,
                Time allowance = Time{0})
      : Talk(*Request::make(id), wire_timestamps, echo, allowance) {}
  Talk(const Request& request, bool wire_timestamps, bool echo, Time allowance) : profile_(make(echo)) {
    PortCapability port;
    port.wire_timestamps = wire_timestamps;
    port.latency_allowance = allowance;
    exchange_.begin(request, us(100), profile_, port);
  }

  void begin_again(Time start) { exchange_.begin(*Request::make(DataId::everything), start, profile_, {}); }
  /// Gives bytes that began on the wire at `first_start`, seen at `now`. Returns how many were taken.
  std::size_t give(const Bytes& bytes, Time first_start, Time now, Errc fault = Errc::ok) {
    const auto room = exchange_.room();
    const std::size_t count = std::min(room.size(), bytes.size());
    std::copy_n(bytes.begin(), count, room.begin());
    exchange_.on_received({.count = count, .first_start = first_start, .fault = fault}, now);
    return count;
  }
  Exchange* operator->() { return &exchange_; }

 private:
  static CompiledProfile make(bool echo) {
    Profile profile;
    profile.echo = echo;
    return test::compiled(profile);
  }
  CompiledProfile profile_;
  Exchange exchange_;
};

// ID3 from 100 µs: the request ends at 104, T2 is 2 to 6, so the reply starts in 106 to 110 and has 44 on the wire.
constexpr Time kStart = us(107);
const Bytes kReply = test::id3_reply(0x12345, 3);

TEST(Exchange, ACompleteReplyInOnePiece) {
  Talk run;
  EXPECT_EQ(run->state(), State::waiting);
  EXPECT_EQ(run->start(), us(100));
  EXPECT_EQ(run->request_end(), us(104));
  EXPECT_FALSE(run->has_reply_delay());
  run.give(kReply, kStart, us(151));
  ASSERT_EQ(run->state(), State::done);
  EXPECT_EQ(run->error(), Errc::ok);
  EXPECT_TRUE(std::ranges::equal(run->reply(), kReply));
  EXPECT_TRUE(run->has_reply_delay());
  EXPECT_EQ(run->reply_delay(), us(3));
}

TEST(Exchange, BegunAgainItKnowsNothingOfTheLast) {
  Talk run;
  run.give({kReply.begin(), kReply.begin() + 4}, kStart, us(120), Errc::framing_error);
  run->on_time(us(1'000));
  ASSERT_EQ(run->error(), Errc::framing_error);
  run.begin_again(us(2'000));
  EXPECT_EQ(run->state(), State::waiting);
  EXPECT_EQ(run->error(), Errc::ok);
  EXPECT_FALSE(run->has_reply_delay());
  EXPECT_EQ(run->reply_delay(), Time{0});
  run.give(kReply, us(2'007), us(2'051));
  ASSERT_EQ(run->state(), State::done);
  EXPECT_EQ(run->error(), Errc::ok);
  EXPECT_TRUE(std::ranges::equal(run->reply(), kReply));
}

TEST(Exchange, InEveryPairOfPiecesAndByteByByte) {
  for (std::size_t cut = 1; cut < kReply.size(); ++cut) {
    Talk run;
    run.give({kReply.begin(), kReply.begin() + static_cast<std::ptrdiff_t>(cut)}, kStart, us(120));
    EXPECT_EQ(run->state(), State::waiting);
    run.give({kReply.begin() + static_cast<std::ptrdiff_t>(cut), kReply.end()}, us(140), us(151));
    ASSERT_EQ(run->state(), State::done);
    EXPECT_EQ(run->error(), Errc::ok);
    EXPECT_TRUE(std::ranges::equal(run->reply(), kReply));
    EXPECT_EQ(run->reply_delay(), us(3)) << "of the first byte";
  }
  Talk run;
  for (std::size_t i = 0; i < kReply.size(); ++i) {
    ASSERT_EQ(run->state(), State::waiting);
    run.give({kReply[i]}, kStart + us(4) * static_cast<int>(i), kStart + us(4) * static_cast<int>(i + 1));
  }
  EXPECT_EQ(run->error(), Errc::ok);
  EXPECT_TRUE(std::ranges::equal(run->reply(), kReply));
}

TEST(Exchange, TheSameForEveryId) {
  test::Rng rng(60);
  for (const auto& kind : test::kKinds) {
    const Request request = kind.id == 6    ? *Request::eeprom_write(3, 4)
                            : kind.id == 13 ? *Request::eeprom_read(3)
                                            : *Request::make(static_cast<DataId>(kind.id));
    Talk run(request, true, false, ns(0));
    EXPECT_EQ(run->request_end(), us(100) + us(4) * static_cast<int>(kind.out));
    const Bytes reply = test::random_reply(rng, kind);
    run.give(reply, run->request_end() + us(3), us(200));
    ASSERT_EQ(run->state(), State::done);
    EXPECT_EQ(run->error(), Errc::ok);
    EXPECT_TRUE(std::ranges::equal(run->reply(), reply));
  }
}

TEST(Exchange, OneByteTooMany) {
  Talk run;
  Bytes longer = kReply;
  longer.push_back(0);
  EXPECT_EQ(run.give(longer, kStart, us(155)), kReply.size() + 1);
  EXPECT_EQ(run->state(), State::done);
  EXPECT_EQ(run->error(), Errc::overlong_reply);
  Talk hundred;
  EXPECT_EQ(hundred.give(Bytes(100, 0x1A), kStart, us(155)), kReply.size() + 1)
      << "room never grows beyond that";
  EXPECT_EQ(hundred->error(), Errc::overlong_reply);
}

TEST(Exchange, SilenceTimesOutJustAfterItsEdge) {
  Talk run(DataId::everything, true, false, us(1));
  // Latest start 110, eleven characters and one more, and the port's allowance.
  EXPECT_EQ(run->deadline(), us(110 + 44 + 4 + 1));
  run->on_time(us(159));
  EXPECT_EQ(run->state(), State::waiting);
  run->on_time(us(159) + ns(1));
  EXPECT_EQ(run->state(), State::done);
  EXPECT_EQ(run->error(), Errc::timeout);
  EXPECT_FALSE(run->has_reply_delay());
}

TEST(Exchange, AReplyThatStopsTimesOutJustAfterTheWholeFramesEdge) {
  Talk run(DataId::everything, true, false, us(1));
  run.give({0x1A}, kStart, us(112));
  EXPECT_EQ(run->deadline(), us(110 + 44 + 4 + 1));
  run->on_time(us(159));
  EXPECT_EQ(run->state(), State::waiting);
  run->on_time(us(159) + ns(1));
  EXPECT_EQ(run->error(), Errc::incomplete_reply);
}

TEST(Exchange, WithoutWireTimestampsTheEdgeIsThatOfThePort) {
  Talk run(DataId::everything, false, false, us(500));
  EXPECT_EQ(run->deadline(), us(110 + 44 + 4 + 500));
  run->on_time(us(658));
  EXPECT_EQ(run->state(), State::waiting);
  run.give(kReply, ns(0), us(658));
  EXPECT_EQ(run->error(), Errc::ok);
  EXPECT_EQ(run->reply_delay(), us(658 - 104)) << "what the host has seen";
  Talk silent(DataId::everything, false, false, us(500));
  silent->on_time(us(658) + ns(1));
  EXPECT_EQ(silent->error(), Errc::timeout);
}

TEST(Exchange, T2WindowIsClosedAtItsEdges) {
  const struct {
    Time t2;
    Errc error;
  } kCases[] = {{ns(1'999), Errc::t2_out_of_window},
                {ns(2'000), Errc::ok},
                {ns(6'000), Errc::ok},
                {ns(6'001), Errc::t2_out_of_window},
                {ns(-1), Errc::t2_out_of_window}};
  for (const auto& c : kCases) {
    Talk run;
    run.give(kReply, us(104) + c.t2, us(152));
    EXPECT_EQ(run->error(), c.error) << c.t2.count();
    EXPECT_EQ(run->reply_delay(), c.t2) << "measured either way";
  }
}

TEST(Exchange, WithoutWireTimestampsThereIsNoT2Window) {
  Talk run(DataId::everything, false);
  run.give(kReply, ns(0), us(104));
  EXPECT_EQ(run->error(), Errc::ok);
}

TEST(Exchange, TheEchoOfTheRequestIsDropped) {
  for (const bool whole : {true, false}) {
    Talk run(*Request::eeprom_read(5), true, true, ns(0));
    const Bytes echo{0xEA, 0x05, 0xEF};
    const Bytes reply = test::eeprom_reply(0xEA, 5, 0x77);
    if (whole) {
      EXPECT_EQ(run.give(echo, us(100), us(112)), 3U) << "room offers no more than the echo";
    } else {
      for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(run.give({echo[i]}, us(100), us(112)), 1U);
    }
    EXPECT_FALSE(run->has_reply_delay()) << "the echo is no reply";
    run.give(reply, us(115), us(131));
    EXPECT_EQ(run->error(), Errc::ok);
    EXPECT_TRUE(std::ranges::equal(run->reply(), reply));
    EXPECT_EQ(run->reply_delay(), us(3));
  }
}

TEST(Exchange, AWrongEchoIsReportedOnceTheReplyIsThere) {
  for (std::size_t at = 0; at < 3; ++at) {
    Talk run(*Request::eeprom_read(5), true, true, ns(0));
    Bytes echo{0xEA, 0x05, 0xEF};
    echo[at] ^= 0x10;
    run.give(echo, us(100), us(112));
    EXPECT_EQ(run->state(), State::waiting);
    run.give(test::eeprom_reply(0xEA, 5, 0x77), us(115), us(131));
    EXPECT_EQ(run->error(), Errc::echo_mismatch) << at;
  }
}

TEST(Exchange, AWrongEchoAndThenSilenceIsAnEchoMismatch) {
  Talk run(DataId::everything, true, true, ns(0));
  run.give({0x1B}, us(100), us(104));
  run->on_time(run->deadline() + ns(1));
  EXPECT_EQ(run->error(), Errc::echo_mismatch);
}

TEST(Exchange, AnEchoAloneIsATimeout) {
  Talk run(DataId::everything, true, true, ns(0));
  run.give({0x1A}, us(100), us(104));
  run->on_time(run->deadline() + ns(1));
  EXPECT_EQ(run->error(), Errc::timeout);
}

// The head of the reply is taken for the echo: of ID3 it even looks like it, of the EEPROM's requests it does not.
TEST(Exchange, AnEchoThatNeverCameIsAnEchoMismatchAtTheDeadline) {
  for (const bool wire_timestamps : {false, true}) {
    const struct {
      Request request;
      Bytes reply;
    } kCases[] = {{*Request::make(DataId::everything), kReply},
                  {*Request::make(DataId::encoder_id), test::id2_reply(0x11)},
                  {*Request::make(DataId::single_turn), test::id0_reply(5)},
                  {*Request::eeprom_read(5), test::eeprom_reply(0xEA, 5, 0x77)}};
    for (const auto& c : kCases) {
      Talk run(c.request, wire_timestamps, true, ns(0));
      const Time begin = run->request_end() + us(3);
      Bytes rest = c.reply;
      for (std::size_t at = 0; at < c.reply.size();) {  // as much as the room takes, again and again
        const Time start = begin + us(4) * static_cast<int>(at);
        const std::size_t taken = run.give(rest, start, begin + us(44));
        at += taken;
        rest.erase(rest.begin(), rest.begin() + static_cast<std::ptrdiff_t>(taken));
      }
      ASSERT_EQ(run->state(), State::waiting);
      run->on_time(run->deadline() + ns(1));
      EXPECT_EQ(run->error(), Errc::echo_mismatch)
          << c.request.bytes().size() << " bytes out, " << wire_timestamps;
    }
  }
}

TEST(Exchange, SilenceIsATimeoutAndACutReplyIncompleteWithAnEchoToo) {
  for (const Request& request : {*Request::make(DataId::everything), *Request::make(DataId::encoder_id),
                                 *Request::eeprom_read(5), *Request::eeprom_write(5, 6)}) {
    Talk silent(request, true, true, ns(0));
    silent->on_time(silent->deadline() + ns(1));
    EXPECT_EQ(silent->error(), Errc::timeout) << "no byte at all; " << request.bytes().size() << " bytes out";
  }
  for (std::size_t length = 1; length < kReply.size(); ++length) {
    Talk run(DataId::everything, true, true, ns(0));
    run.give({0x1A}, us(100), us(104));
    run.give({kReply.begin(), kReply.begin() + static_cast<std::ptrdiff_t>(length)}, kStart, us(151));
    run->on_time(run->deadline() + ns(1));
    EXPECT_EQ(run->error(), Errc::incomplete_reply)
        << "the echo was there; " << length << " bytes of the reply";
  }
}

// Without the profile's `echo` an echo is refused by its time, before its content could be believed.
TEST(Exchange, AnEchoThatNobodyExpectsIsOutsideTheT2Window) {
  Talk run;
  run.give({0x1A}, us(100), us(104));
  run.give({kReply.begin(), kReply.end() - 1}, kStart, us(151));
  EXPECT_EQ(run->error(), Errc::t2_out_of_window);
}

TEST(Exchange, LineFaultsAreReportedWhenTheReplyIsComplete) {
  for (const Errc fault : {Errc::framing_error, Errc::overrun}) {
    Talk run;
    run.give({kReply.begin(), kReply.begin() + 5}, kStart, us(130), fault);
    EXPECT_EQ(run->state(), State::waiting);
    run.give({kReply.begin() + 5, kReply.end()}, us(130), us(151));
    EXPECT_EQ(run->error(), fault);
    Talk silent;
    silent.give({}, ns(0), us(110), fault);
    silent->on_time(silent->deadline() + ns(1));
    EXPECT_EQ(silent->error(), fault) << "a better cause than silence";
  }
}

TEST(Exchange, PortGoneEndsItAtOnce) {
  Talk run;
  run.give({}, ns(0), us(105), Errc::port_gone);
  EXPECT_EQ(run->state(), State::done);
  EXPECT_EQ(run->error(), Errc::port_gone);
}

TEST(Exchange, NothingChangesAVerdict) {
  Talk run;
  run.give(kReply, kStart, us(151));
  run->on_received({.count = 1, .first_start = us(152), .fault = Errc::framing_error}, us(156));
  run->on_time(us(1'000));
  EXPECT_EQ(run->error(), Errc::ok);
  EXPECT_EQ(run->reply().size(), kReply.size());
}

TEST(Exchange, IsReusedWithoutATraceOfTheLast) {
  Talk run;
  run.give({0x1A, 0x00}, ns(1), us(120), Errc::framing_error);
  run->on_time(us(1'000));
  PortCapability port;
  port.wire_timestamps = true;
  const CompiledProfile profile = test::compiled("tm485_17");
  run->begin(*Request::make(DataId::encoder_id), us(2'000), profile, port);
  EXPECT_EQ(run->state(), State::waiting);
  EXPECT_FALSE(run->has_reply_delay());
  run.give(test::id2_reply(0x11), us(2'007), us(2'023));
  EXPECT_EQ(run->error(), Errc::ok);
  EXPECT_EQ(run->reply().size(), 4U);
}

}  // namespace
}  // namespace tm485
