// RealtimeThread: a thread as a bus or a servo loop needs it: scheduled first, on a core of its own, its memory
// present and locked.
//
// Needs no privilege to start: what the system refuses is left as it is, and a warning says what is missing and how
// to get it. `tm485 rt-check` shows the same before anything runs.
#pragma once

#include <atomic>
#include <cstddef>
#include <expected>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tm485/linux/os_error.hpp"

namespace tm485::linux_hal {

struct RealtimeOptions {
  std::string name = "tm485";         ///< as in top -H and ps -L; cut at 15 bytes
  int priority = 80;                  ///< SCHED_FIFO 1 to 99; 0: ordinary scheduling
  int cpu = -1;                       ///< the core to stay on; -1: any
  bool lock_memory = true;            ///< the whole process, now and later (mlockall)
  std::size_t stack_bytes = 0x80000;  ///< 512 KiB: of the stack, touched before the body starts
};

/// Something that was asked for and not granted; the thread runs without it.
struct RealtimeWarning {
  std::string name;    ///< "priority", "affinity", "memory_lock" or "thread_name"
  std::string cause;   ///< what was tried and what the system said
  std::string remedy;  ///< plain words
};

/// Start, stop and join from one thread. Movable; the thread does not notice.
class RealtimeThread {
 public:
  /// Runs in the new thread. Returns soon after `stop` becomes true (relaxed loads do).
  using Body = std::function<void(const std::atomic<bool>& stop)>;

  /// Starts the thread and returns once its settings are made, so that warnings() is complete; the body begins then.
  /// The one error: the system starts no thread (errno EAGAIN: a limit on threads or memory).
  [[nodiscard]] static std::expected<RealtimeThread, OsError> start(const RealtimeOptions& options,
                                                                    Body body);

  RealtimeThread(RealtimeThread&&) noexcept;
  RealtimeThread& operator=(RealtimeThread&&) noexcept;
  /// stop() and join(): blocks until the body returns.
  ~RealtimeThread();

  /// Asks the body to return. Any thread; never blocks.
  void stop() noexcept;
  /// Waits for the body to return; at once if it has.
  void join() noexcept;

  /// What was not granted; empty if all of it was.
  [[nodiscard]] const std::vector<RealtimeWarning>& warnings() const noexcept;
  /// After join(): what an exception that left the body said; empty if none did. It ends the body and nothing else.
  [[nodiscard]] const std::string& failure() const noexcept;

 private:
  struct State;
  explicit RealtimeThread(std::unique_ptr<State> state) noexcept;

  std::unique_ptr<State> state_;
};

}  // namespace tm485::linux_hal
