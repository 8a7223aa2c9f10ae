// One context inside another, after every machine instruction: the processor's single-step trap stands for an interrupt
// that may come anywhere.
#pragma once

#include <csignal>
#include <cstdint>
#include <functional>
#include <utility>

namespace tm485::test {

#if defined(__x86_64__) && defined(__linux__) && !defined(__SANITIZE_THREAD__)
#define TM485_TEST_SINGLE_STEP 1
#if defined(__has_feature)
#if __has_feature(thread_sanitizer)
#undef TM485_TEST_SINGLE_STEP
#endif
#endif
#endif

#if defined(TM485_TEST_SINGLE_STEP)

/// The interrupt of the one who steps; it is not stepped itself.
class SingleStep {
 public:
  /// Runs `body`, and `interrupt` after each of its instructions; answers how many there were.
  static std::uint64_t run(const std::function<void()>& body, const std::function<void()>& interrupt) {
    handler() = &interrupt;
    steps() = 0;
    struct sigaction action = {};
    struct sigaction before = {};
    action.sa_handler = [](int) {
      ++steps();
      (*handler())();
    };
    sigaction(SIGTRAP, &action, &before);
    trap_on();
    body();
    trap_off();
    sigaction(SIGTRAP, &before, nullptr);
    return steps();
  }

 private:
  static const std::function<void()>*& handler() {
    static const std::function<void()>* current = nullptr;
    return current;
  }
  static std::uint64_t& steps() {
    static std::uint64_t count = 0;
    return count;
  }
  // The trap flag is bit 8. The 128 bytes below the stack pointer belong to the function that this is compiled into.
  [[gnu::noinline]] static void trap_on() {
    asm volatile("leaq -128(%%rsp), %%rsp; pushfq; orq $0x100, (%%rsp); popfq; leaq 128(%%rsp), %%rsp" ::
                     : "memory", "cc");
  }
  [[gnu::noinline]] static void trap_off() {
    asm volatile("leaq -128(%%rsp), %%rsp; pushfq; andq $~0x100, (%%rsp); popfq; leaq 128(%%rsp), %%rsp" ::
                     : "memory", "cc");
  }
};

#endif

}  // namespace tm485::test
