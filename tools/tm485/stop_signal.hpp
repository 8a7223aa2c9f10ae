// Ctrl-C and SIGTERM ask for an orderly end; a second one ends the command at once. Within 0.2 s several are one request:
// timeout(1) sends two.
#pragma once

#include <atomic>

namespace tm485::cli {

/// Installs the handlers for SIGINT and SIGTERM, and ignores SIGPIPE: a reader that goes away is seen by write().
void install_stop_signal() noexcept;

/// True once SIGINT or SIGTERM has arrived.
[[nodiscard]] const std::atomic<bool>& stop_flag() noexcept;
[[nodiscard]] inline bool stop_requested() noexcept { return stop_flag().load(std::memory_order_relaxed); }

}  // namespace tm485::cli
