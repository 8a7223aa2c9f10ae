// The byte stream itself, over a socket pair: order, ends, full buffers, and when a request counts as sent.
#include "tm485/linux/stream_port.hpp"

#include <gtest/gtest.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <numeric>
#include <vector>

namespace tm485::linux_hal {
namespace {

constexpr std::array<std::uint8_t, 1> kOne{0x1A};
constexpr std::array<std::uint8_t, 4> kFour{0x32, 0x05, 0xA5, 0x92};

class StreamPortTest : public ::testing::Test {
 protected:
  StreamPortTest() : port_(posix::FileDescriptor(), StreamKind::socket, 1, {}) {
    int ends[2] = {-1, -1};
    EXPECT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0, ends), 0);
    port_ = StreamPort(posix::FileDescriptor(ends[0]), StreamKind::socket, 2'500'000, {});
    peer_ = posix::FileDescriptor(ends[1]);
  }

  void peer_writes(std::span<const std::uint8_t> bytes) {
    ASSERT_EQ(write(peer_.get(), bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }
  std::vector<std::uint8_t> peer_reads() {
    std::vector<std::uint8_t> bytes(1 << 16);
    const ssize_t count = read(peer_.get(), bytes.data(), bytes.size());
    bytes.resize(count < 0 ? 0 : static_cast<std::size_t>(count));
    return bytes;
  }

  StreamPort port_;
  posix::FileDescriptor peer_;
  std::array<std::uint8_t, 16> buffer_{};
};

TEST_F(StreamPortTest, AFreshPortIsIdleAndEmpty) {
  EXPECT_EQ(port_.transmission(Time{0}).state, Transmission::State::idle);
  const Reception reception = port_.try_receive(buffer_, Time{0});
  EXPECT_EQ(reception.count, 0U);
  EXPECT_EQ(reception.fault, Errc::ok);
}

TEST_F(StreamPortTest, SendsWholeRequestsAndAnswersTheTimeGiven) {
  EXPECT_EQ(port_.try_send(kFour, Time{123'456}), Time{123'456});
  EXPECT_EQ(peer_reads(), std::vector<std::uint8_t>(kFour.begin(), kFour.end()));
}

TEST_F(StreamPortTest, ARequestIsSentWhenItsCharactersHavePassed) {
  ASSERT_TRUE(port_.try_send(kFour, Time{1'000'000}));
  EXPECT_EQ(port_.transmission(Time{1'000'000}).state, Transmission::State::sending);
  EXPECT_EQ(port_.transmission(Time{1'015'999}).state, Transmission::State::sending);
  EXPECT_EQ(port_.transmission(Time{1'016'000}).state, Transmission::State::sent);
  ASSERT_TRUE(port_.try_send(kOne, Time{2'000'000}));
  EXPECT_EQ(port_.transmission(Time{2'003'999}).state, Transmission::State::sending);
  EXPECT_EQ(port_.transmission(Time{2'004'000}).state, Transmission::State::sent);
}

TEST_F(StreamPortTest, HandsBytesOutOnceAndInOrder) {
  std::array<std::uint8_t, 40> sent{};
  std::iota(sent.begin(), sent.end(), std::uint8_t{0});
  peer_writes(sent);
  std::vector<std::uint8_t> got;
  for (int pass = 0; pass < 3; ++pass) {
    const Reception reception = port_.try_receive(buffer_, Time{0});
    EXPECT_EQ(reception.fault, Errc::ok);
    got.insert(got.end(), buffer_.begin(), buffer_.begin() + static_cast<std::ptrdiff_t>(reception.count));
  }
  EXPECT_EQ(got, std::vector<std::uint8_t>(sent.begin(), sent.end()));
  EXPECT_EQ(port_.try_receive(buffer_, Time{0}).count, 0U);
}

TEST_F(StreamPortTest, NoRoomIsNotTheEndOfTheStream) {
  const Reception reception = port_.try_receive({}, Time{0});
  EXPECT_EQ(reception.count, 0U);
  EXPECT_EQ(reception.fault, Errc::ok);
  EXPECT_TRUE(port_.try_send(kOne, Time{0}));
}

TEST_F(StreamPortTest, AnEmptyRequestIsRefused) {
  EXPECT_EQ(port_.try_send({}, Time{0}), std::unexpected(Errc::send_failed));
  EXPECT_EQ(port_.transmission(Time{0}).state, Transmission::State::failed);
  EXPECT_FALSE(port_.gone());
}

TEST_F(StreamPortTest, WhatThePeerSentBeforeItClosedIsStillHandedOut) {
  peer_writes(kFour);
  peer_.close();
  EXPECT_EQ(port_.try_receive(buffer_, Time{0}).count, kFour.size());
  const Reception end = port_.try_receive(buffer_, Time{0});
  EXPECT_EQ(end.count, 0U);
  EXPECT_EQ(end.fault, Errc::port_gone);
  EXPECT_TRUE(port_.gone());
  EXPECT_EQ(port_.last_errno(), 0);
}

TEST_F(StreamPortTest, SendingToAClosedPeerIsPortGoneAndRaisesNoSignal) {
  peer_.close();
  EXPECT_EQ(port_.try_send(kOne, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_EQ(port_.last_errno(), EPIPE);
  const Transmission transmission = port_.transmission(Time{0});
  EXPECT_EQ(transmission.state, Transmission::State::failed);
  EXPECT_EQ(transmission.fault, Errc::port_gone);
}

TEST_F(StreamPortTest, GoneIsRememberedEvenIfTheDescriptorWorksAgain) {
  peer_.close();
  ASSERT_EQ(port_.try_receive(buffer_, Time{0}).fault, Errc::port_gone);
  int ends[2] = {-1, -1};
  ASSERT_EQ(socketpair(AF_UNIX, SOCK_STREAM | SOCK_NONBLOCK, 0, ends), 0);
  const posix::FileDescriptor first(ends[0]);
  const posix::FileDescriptor second(ends[1]);
  ASSERT_GE(dup2(first.get(), port_.descriptor()), 0);
  ASSERT_EQ(write(second.get(), kFour.data(), kFour.size()), 4);
  EXPECT_EQ(port_.try_receive(buffer_, Time{0}).fault, Errc::port_gone);
  EXPECT_EQ(port_.try_send(kOne, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_EQ(port_.transmission(Time{0}).fault, Errc::port_gone);
}

TEST_F(StreamPortTest, AFullBufferFailsTheSendAndRecovers) {
  std::expected<Time, Errc> result = Time{0};
  std::size_t taken = 0;
  for (int i = 0; i < 1'000'000 && result; ++i) {
    result = port_.try_send(kFour, Time{0});
    if (result) taken += kFour.size();
  }
  ASSERT_EQ(result, std::unexpected(Errc::send_failed));
  EXPECT_EQ(port_.last_errno(), EAGAIN);
  EXPECT_EQ(port_.transmission(Time{0}).state, Transmission::State::failed);
  EXPECT_EQ(port_.transmission(Time{0}).fault, Errc::send_failed);
  EXPECT_FALSE(port_.gone());
  std::size_t arrived = 0;
  for (std::size_t got = 1; got != 0; arrived += got) got = peer_reads().size();
  EXPECT_EQ(arrived, taken);
  EXPECT_TRUE(port_.try_send(kFour, Time{0}));
}

TEST_F(StreamPortTest, AMovedFromPortIsGone) {
  StreamPort other = std::move(port_);
  EXPECT_TRUE(other.try_send(kOne, Time{0}));
  EXPECT_EQ(peer_reads().size(), 1U);
  // NOLINTNEXTLINE(bugprone-use-after-move): that is what is tested
  EXPECT_EQ(port_.try_send(kOne, Time{0}), std::unexpected(Errc::port_gone));
  EXPECT_EQ(port_.last_errno(), EBADF);
}

}  // namespace
}  // namespace tm485::linux_hal
