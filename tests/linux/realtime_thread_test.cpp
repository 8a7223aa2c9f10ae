// RealtimeThread: starts whatever the system refuses, says what was refused, stops and joins.
#include "tm485/linux/realtime_thread.hpp"

#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <functional>
#include <stdexcept>
#include <thread>

namespace tm485::linux_hal {
namespace {

/// Asks for nothing that could be refused.
RealtimeOptions plain() { return {.name = "tm485_test", .priority = 0, .lock_memory = false}; }

const RealtimeWarning* find(const RealtimeThread& thread, const std::string& name) {
  const auto found = std::find_if(thread.warnings().begin(), thread.warnings().end(),
                                  [&](const auto& each) { return each.name == name; });
  return found == thread.warnings().end() ? nullptr : &*found;
}

void run_until_stopped(const std::atomic<bool>& stop) {
  while (!stop.load(std::memory_order_relaxed)) std::this_thread::yield();
}

TEST(RealtimeThread, RunsItsBodyAndIsStopped) {
  std::atomic<int> rounds{0};
  auto thread = RealtimeThread::start(plain(), [&](const std::atomic<bool>& stop) {
    while (!stop.load(std::memory_order_relaxed)) {
      ++rounds;
      std::this_thread::yield();
    }
  });
  ASSERT_TRUE(thread) << thread.error().message();
  EXPECT_TRUE(thread->warnings().empty());
  while (rounds.load() < 3) std::this_thread::yield();
  thread->stop();
  thread->join();
  const int last = rounds.load();
  std::this_thread::yield();
  EXPECT_EQ(rounds.load(), last) << "joined";
  thread->join();  // again: nothing happens
  EXPECT_TRUE(thread->failure().empty());
}

TEST(RealtimeThread, ItsDestructorStopsAndJoins) {
  std::atomic<bool> ended{false};
  {
    auto thread = RealtimeThread::start(plain(), [&](const std::atomic<bool>& stop) {
      run_until_stopped(stop);
      ended = true;
    });
    ASSERT_TRUE(thread);
  }
  EXPECT_TRUE(ended);
}

TEST(RealtimeThread, MovingKeepsItAndAssigningEndsTheOld) {
  std::array<std::atomic<bool>, 2> ended{};
  auto make = [&](std::size_t i) {
    return RealtimeThread::start(plain(), [&ended, i](const std::atomic<bool>& stop) {
      run_until_stopped(stop);
      ended.at(i) = true;
    });
  };
  auto first = make(0);
  auto second = make(1);
  ASSERT_TRUE(first && second);
  RealtimeThread kept = std::move(*first);
  EXPECT_FALSE(ended[0]);
  kept = std::move(*second);
  EXPECT_TRUE(ended[0]);
  EXPECT_FALSE(ended[1]);
  kept.stop();
  kept.join();
  EXPECT_TRUE(ended[1]);
}

TEST(RealtimeThread, AnExceptionEndsTheBodyOnly) {
  auto known = RealtimeThread::start(
      plain(), [](const std::atomic<bool>&) { throw std::runtime_error("the reason"); });
  auto other = RealtimeThread::start(plain(), [](const std::atomic<bool>&) { throw 7; });
  ASSERT_TRUE(known && other);
  known->join();
  other->join();
  EXPECT_EQ(known->failure(), "the reason");
  EXPECT_FALSE(other->failure().empty());
}

TEST(RealtimeThread, HasTheNameTheCoreAndTheStackThatWereAskedFor) {
  cpu_set_t allowed;
  ASSERT_EQ(sched_getaffinity(0, sizeof allowed, &allowed), 0);
  int core = 0;
  while (!CPU_ISSET(static_cast<std::size_t>(core), &allowed)) ++core;
  RealtimeOptions options = plain();
  options.name = "a_name_that_is_too_long";
  options.cpu = core;
  options.stack_bytes = 2U << 20;
  std::string name;
  int ran_on = -1;
  int cores = 0;
  std::size_t stack = 0;
  auto thread = RealtimeThread::start(options, [&](const std::atomic<bool>&) {
    std::array<char, 32> buffer{};
    pthread_getname_np(pthread_self(), buffer.data(), buffer.size());
    name = buffer.data();
    ran_on = sched_getcpu();
    cpu_set_t mine;
    CPU_ZERO(&mine);
    sched_getaffinity(0, sizeof mine, &mine);
    cores = CPU_COUNT(&mine);
    pthread_attr_t attributes;
    pthread_getattr_np(pthread_self(), &attributes);
    pthread_attr_getstacksize(&attributes, &stack);
    pthread_attr_destroy(&attributes);
  });
  ASSERT_TRUE(thread);
  thread->join();
  EXPECT_TRUE(thread->warnings().empty());
  EXPECT_EQ(name, "a_name_that_is_");
  EXPECT_EQ(ran_on, core);
  EXPECT_EQ(cores, 1);
  EXPECT_GE(stack, options.stack_bytes);
}

TEST(RealtimeThread, ImpossibleWishesAreWarningsWithARemedy) {
  for (const int core : {CPU_SETSIZE - 1, CPU_SETSIZE, 1'000'000}) {
    RealtimeOptions options = plain();
    options.cpu = core;
    options.priority = 1'000;
    bool ran = false;
    auto thread = RealtimeThread::start(options, [&](const std::atomic<bool>&) { ran = true; });
    ASSERT_TRUE(thread);
    thread->join();
    EXPECT_TRUE(ran);
    EXPECT_EQ(thread->warnings().size(), 2U);
    for (const char* name : {"affinity", "priority"}) {
      const RealtimeWarning* found = find(*thread, name);
      ASSERT_NE(found, nullptr) << name;
      EXPECT_FALSE(found->cause.empty());
      EXPECT_FALSE(found->remedy.empty());
    }
  }
}

/// Runs `body` in a child process without privileges and limits; answers what it returned, or -1 for a crash.
int without_privileges(const std::function<int()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    const rlimit none{0, 0};
    const rlimit little{64 * 1024, 64 * 1024};
    setrlimit(RLIMIT_RTPRIO, &none);
    setrlimit(RLIMIT_MEMLOCK, &little);
    constexpr uid_t kNobody = 65534;
    if (geteuid() == 0 && (setgid(kNobody) != 0 || setuid(kNobody) != 0)) _exit(99);
    _exit(body());
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
}

TEST(RealtimeThread, StartsWithoutPrivilegesAndSaysWhatIsMissing) {
  const int result = without_privileges([] {
    RealtimeOptions options;
    std::atomic<bool> ran{false};
    auto thread = RealtimeThread::start(options, [&](const std::atomic<bool>& stop) {
      ran = true;
      run_until_stopped(stop);
    });
    if (!thread) return 1;
    thread->stop();
    thread->join();
    if (!ran) return 2;
    const RealtimeWarning* priority = find(*thread, "priority");
    if (priority == nullptr || priority->remedy.find("rtprio") == std::string::npos) return 3;
    if (priority->remedy.find("cap_sys_nice") == std::string::npos) return 4;
    const RealtimeWarning* lock = find(*thread, "memory_lock");
    if (lock == nullptr || lock->remedy.find("memlock") == std::string::npos) return 5;
    return 0;
  });
  EXPECT_EQ(result, 0);
}

TEST(RealtimeThread, NothingIsRefusedLaterForBeingLocked) {
  const int result = without_privileges([] {
    auto thread = RealtimeThread::start({.priority = 0}, run_until_stopped);
    if (!thread) return 1;
    // Beyond the limit on locked memory: with MCL_FUTURE in force this would fail.
    void* more = mmap(nullptr, 1U << 20, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    return more == MAP_FAILED ? 2 : 0;
  });
  EXPECT_EQ(result, 0);
}

TEST(RealtimeThread, GetsItsPriorityWhereTheSystemAllowsIt) {
  RealtimeOptions options = plain();
  options.priority = 10;
  int policy = -1;
  sched_param parameters{};
  auto thread = RealtimeThread::start(options, [&](const std::atomic<bool>&) {
    pthread_getschedparam(pthread_self(), &policy, &parameters);
  });
  ASSERT_TRUE(thread);
  thread->join();
  if (thread->warnings().empty()) {
    EXPECT_EQ(policy, SCHED_FIFO);
    EXPECT_EQ(parameters.sched_priority, 10);
  } else {
    EXPECT_EQ(policy, SCHED_OTHER);
    EXPECT_NE(find(*thread, "priority"), nullptr);
  }
}

TEST(RealtimeThread, AStackThatDoesNotFitIsAnError) {
  RealtimeOptions options = plain();
  options.stack_bytes = std::size_t{1} << 46;
  bool ran = false;
  const auto thread = RealtimeThread::start(options, [&](const std::atomic<bool>&) { ran = true; });
  ASSERT_FALSE(thread);
  EXPECT_NE(thread.error().error_number, 0);
  EXPECT_FALSE(thread.error().what.empty());
  EXPECT_FALSE(thread.error().remedy.empty());
  EXPECT_FALSE(ran);
}

}  // namespace
}  // namespace tm485::linux_hal
