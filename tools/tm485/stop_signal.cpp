#include "stop_signal.hpp"

#include <csignal>

namespace tm485::cli {
namespace {

std::atomic<bool> g_stop{false};
static_assert(std::atomic<bool>::is_always_lock_free, "set by a signal handler");

extern "C" void on_stop(int number) {
  if (g_stop.exchange(true)) {
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
