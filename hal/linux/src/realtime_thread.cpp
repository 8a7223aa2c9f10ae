#include "tm485/linux/realtime_thread.hpp"

#include <linux/capability.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <exception>
#include <semaphore>
#include <system_error>
#include <utility>

#include "realtime_remedy.hpp"

namespace tm485::linux_hal {
namespace {

constexpr std::size_t kNameBytes = 15;
constexpr std::size_t kPage = 4096;
/// What the C library, the thread's own data and a signal's frame take besides.
constexpr std::size_t kStackReserve = 32 * kPage;

RealtimeWarning warning(std::string name, std::string tried, int error, std::string remedy) {
  return {std::move(name), std::move(tried) + ": " + std::generic_category().message(error),
          std::move(remedy)};
}

bool may_lock_without_limit() noexcept {
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) == 0 && limit.rlim_cur == RLIM_INFINITY) return true;
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3> data{};
  return syscall(SYS_capget, &header, data.data()) == 0 && (data[0].effective & (1U << CAP_IPC_LOCK)) != 0;
}

/// Locks what is there, and what will be only where no limit can refuse it later: with one, the next allocation of the
/// program would fail instead.
void lock_memory(std::vector<RealtimeWarning>& warnings) {
  const bool unlimited = may_lock_without_limit();
  if (mlockall(unlimited ? MCL_CURRENT | MCL_FUTURE : MCL_CURRENT) == 0) {
    if (!unlimited)
      warnings.push_back({"memory_lock",
                          "only the memory of this moment is locked: the limit on locked memory "
                          "(memlock) would make later allocations fail",
                          kLockRemedy});
    return;
  }
  const int error = errno;
  munlockall();
  warnings.push_back(warning("memory_lock", "the memory cannot be locked (mlockall)", error, kLockRemedy));
}

/// Writes one byte in each page below this frame, so that no later call meets a page that is not there.
[[gnu::noinline]] void touch_stack(std::size_t bytes) noexcept {
  constexpr std::size_t kChunk = 16 * kPage;
  std::array<unsigned char, kChunk> chunk;
  volatile unsigned char* const bottom = chunk.data();
  for (std::size_t i = 0; i < kChunk; i += kPage) bottom[i] = 0;
  if (bytes > kChunk) touch_stack(bytes - kChunk);
  bottom[kChunk - 1] = 0;  // after the call, so that it is no jump that reuses this frame
}

void set_name(const std::string& name, std::vector<RealtimeWarning>& warnings) {
  if (name.empty()) return;
  if (const int error = pthread_setname_np(pthread_self(), name.substr(0, kNameBytes).c_str()); error != 0)
    warnings.push_back(warning("thread_name", "the thread cannot be named " + name, error,
                               "harmless: it keeps the name of the program"));
}

void set_affinity(int cpu, std::vector<RealtimeWarning>& warnings) {
  if (cpu < 0) return;
  int error = EINVAL;
  if (cpu < CPU_SETSIZE) {
    cpu_set_t set;
    CPU_ZERO(&set);
    CPU_SET(static_cast<std::size_t>(cpu), &set);
    error = pthread_setaffinity_np(pthread_self(), sizeof set, &set);
  }
  if (error != 0)
    warnings.push_back(
        warning("affinity", "the thread cannot stay on core " + std::to_string(cpu), error,
                "choose a core that exists and that the program may use: nproc and 'taskset -cp $$' show "
                "them; a container or a service may leave out some (cpuset, CPUAffinity=)"));
}

void set_priority(int priority, std::vector<RealtimeWarning>& warnings) {
  if (priority <= 0) return;
  sched_param parameters{};
  parameters.sched_priority = priority;
  const int error = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
  if (error == 0) return;
  const std::string tried = "no SCHED_FIFO priority " + std::to_string(priority);
  if (error == EINVAL)
    return warnings.push_back(warning("priority", tried, error, "choose 1 to 99; 80 is usual"));
  warnings.push_back(warning("priority", tried, error, kPriorityRemedy));
}

}  // namespace

struct RealtimeThread::State {
  RealtimeOptions options;
  Body body;
  std::atomic<bool> stop{false};
  std::binary_semaphore ready{0};
  std::vector<RealtimeWarning> warnings;
  std::string failure;
  static constexpr const char* kNoMemory = "out of memory";  ///< short enough for a string without the heap
  pthread_t thread{};
  bool running = false;

  void settle() noexcept {
    try {
      set_name(options.name, warnings);
      set_affinity(options.cpu, warnings);
      touch_stack(options.stack_bytes);
      set_priority(options.priority, warnings);
    } catch (...) {
      failure = kNoMemory;  // for the text of a warning; the body runs all the same
    }
  }

  void run() noexcept {
    settle();
    ready.release();
    try {
      body(stop);
    } catch (const std::exception& error) {
      describe(error.what());
    } catch (...) {
      describe("an exception that is no std::exception");
    }
  }

  void describe(const char* text) noexcept {
    try {
      failure = *text == '\0' ? "an exception without a text" : text;
    } catch (...) {
      failure = kNoMemory;
    }
  }
};

std::expected<RealtimeThread, OsError> RealtimeThread::start(const RealtimeOptions& options, Body body) {
  auto state = std::make_unique<State>();
  state->options = options;
  state->body = std::move(body);
  if (options.lock_memory) lock_memory(state->warnings);

  pthread_attr_t attributes;
  pthread_attr_init(&attributes);
  // A stack of its own size: with all memory locked, each of the usual 8 MB would be taken for good.
  const std::size_t pages = (options.stack_bytes + kStackReserve + kPage - 1) / kPage;
  pthread_attr_setstacksize(&attributes, pages * kPage);
  const auto entry = [](void* argument) -> void* {
    static_cast<State*>(argument)->run();
    return nullptr;
  };
  const int error = pthread_create(&state->thread, &attributes, entry, state.get());
  pthread_attr_destroy(&attributes);
  if (error != 0) {
    return std::unexpected(
        OsError{Errc::bad_argument, error,
                "cannot start the thread " + options.name + ": " + std::generic_category().message(error),
                "the limit on threads or memory is reached: see 'ulimit -u' and 'ulimit -v'; a smaller "
                "stack_bytes needs less"});
  }
  state->running = true;
  state->ready.acquire();
  return RealtimeThread(std::move(state));
}

RealtimeThread::RealtimeThread(std::unique_ptr<State> state) noexcept : state_(std::move(state)) {}
RealtimeThread::RealtimeThread(RealtimeThread&&) noexcept = default;

RealtimeThread& RealtimeThread::operator=(RealtimeThread&& other) noexcept {
  if (this != &other) {
    stop();
    join();
    state_ = std::move(other.state_);
  }
  return *this;
}

RealtimeThread::~RealtimeThread() {
  stop();
  join();
}

void RealtimeThread::stop() noexcept {
  if (state_) state_->stop.store(true, std::memory_order_relaxed);
}

void RealtimeThread::join() noexcept {
  if (state_ && std::exchange(state_->running, false)) pthread_join(state_->thread, nullptr);
}

const std::vector<RealtimeWarning>& RealtimeThread::warnings() const noexcept { return state_->warnings; }
const std::string& RealtimeThread::failure() const noexcept { return state_->failure; }

}  // namespace tm485::linux_hal
