// What Ctrl-C does, in a process of its own for each test: `timeout 60 tm485 ...` sends its signal twice at once, and the
// command was ended before it had said what it had seen.
#include "stop_signal.hpp"

#include <gtest/gtest.h>

#include <chrono>
#include <csignal>
#include <cstdlib>
#include <thread>

namespace tm485::test {
namespace {

constexpr int kStopsInOrder = 7, kGoesOn = 8;

[[noreturn]] void end() { std::_Exit(cli::stop_requested() ? kStopsInOrder : kGoesOn); }

/// Both are there before either is handled.
void send_at_once(int one, int other) {
  sigset_t both;
  sigemptyset(&both);
  sigaddset(&both, one);
  sigaddset(&both, other);
  (void)sigprocmask(SIG_BLOCK, &both, nullptr);
  (void)std::raise(one);
  (void)std::raise(other);
  (void)sigprocmask(SIG_UNBLOCK, &both, nullptr);
}

TEST(StopSignalDeathTest, GoesOnUntilItIsAsked) {
  EXPECT_EXIT((cli::install_stop_signal(), end()), testing::ExitedWithCode(kGoesOn), "");
}

TEST(StopSignalDeathTest, OneAsksForAnOrderlyEnd) {
  EXPECT_EXIT((cli::install_stop_signal(), (void)std::raise(SIGINT), end()),
              testing::ExitedWithCode(kStopsInOrder), "");
  EXPECT_EXIT((cli::install_stop_signal(), (void)std::raise(SIGTERM), end()),
              testing::ExitedWithCode(kStopsInOrder), "");
}

TEST(StopSignalDeathTest, TwoAtOnceAreOneRequest) {
  EXPECT_EXIT((cli::install_stop_signal(), send_at_once(SIGINT, SIGTERM), end()),
              testing::ExitedWithCode(kStopsInOrder), "");
  EXPECT_EXIT((cli::install_stop_signal(), (void)std::raise(SIGINT), (void)std::raise(SIGINT), end()),
              testing::ExitedWithCode(kStopsInOrder), "");
}

TEST(StopSignalDeathTest, ASecondOneLaterEndsTheCommandAtOnce) {
  const auto twice = [](int number) {
    cli::install_stop_signal();
    (void)std::raise(number);
    std::this_thread::sleep_for(std::chrono::milliseconds(400));
    (void)std::raise(number);
    end();
  };
  EXPECT_EXIT(twice(SIGINT), testing::KilledBySignal(SIGINT), "");
  EXPECT_EXIT(twice(SIGTERM), testing::KilledBySignal(SIGTERM), "");
}

}  // namespace
}  // namespace tm485::test
