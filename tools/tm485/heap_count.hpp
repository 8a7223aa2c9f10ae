// Allocations of the calling thread, counted: `tm485 campaign` and tests judge by it that the cycle makes none.
#pragma once

#include <cstdint>

namespace tm485::cli {

/// Since the thread began. Any thread.
[[nodiscard]] std::uint64_t heap_allocations() noexcept;

}  // namespace tm485::cli
