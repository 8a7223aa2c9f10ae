#include "stop_signal.hpp"

#include <csignal>
#include <cstdint>
#include <ctime>

namespace tm485::cli {
namespace {

std::atomic<bool> g_stop{false};
std::atomic<std::int64_t> g_asked_at{0};  // ns of the monotonic clock; 0: never
static_assert(std::atomic<bool>::is_always_lock_free && std::atomic<std::int64_t>::is_always_lock_free,
              "set by a signal handler");

// timeout(1) sends its signal to the command and to the command's process group: twice at once. Fingers are slower.
constexpr std::int64_t kOneRequestNs = 200'000'000;

std::int64_t now_ns() noexcept {
  timespec now{};
  (void)clock_gettime(CLOCK_MONOTONIC, &now);
  return std::int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

extern "C" void on_stop(int number) {
  const std::int64_t now = now_ns();
  std::int64_t asked_at = 0;
  if (g_asked_at.compare_exchange_strong(asked_at, now)) {
    g_stop = true;
  } else if (now - asked_at >= kOneRequestNs) {
    // Blocked while this handler runs, so it takes effect when the handler returns.
    (void)std::signal(number, SIG_DFL);
    (void)std::raise(number);
  }
}

}  // namespace

void install_stop_signal() noexcept {
  struct sigaction action{};
  action.sa_handler = on_stop;
  sigemptyset(&action.sa_mask);
  action.sa_flags = 0;  // waiting calls shall end with EINTR
  (void)sigaction(SIGINT, &action, nullptr);
  (void)sigaction(SIGTERM, &action, nullptr);
  (void)std::signal(SIGPIPE, SIG_IGN);
}

const std::atomic<bool>& stop_flag() noexcept { return g_stop; }

}  // namespace tm485::cli
