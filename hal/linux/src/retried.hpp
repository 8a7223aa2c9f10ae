// A system call again while a signal interrupts it, but not for ever.
#pragma once

#include <cerrno>

namespace tm485::linux_hal {

inline constexpr int kInterruptions = 8;

/// The result of the last call; errno is that of the call.
template <class Call>
auto retried(const Call& call) noexcept(noexcept(call())) {
  auto result = call();
  for (int again = 0; result < 0 && errno == EINTR && again < kInterruptions; ++again) result = call();
  return result;
}

}  // namespace tm485::linux_hal
