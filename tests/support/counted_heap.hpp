// Allocations of the calling thread, counted: this program has an operator new of its own.
#pragma once

#include <cstdint>

namespace tm485::test {

[[nodiscard]] std::uint64_t allocations_of_this_thread() noexcept;

}  // namespace tm485::test
