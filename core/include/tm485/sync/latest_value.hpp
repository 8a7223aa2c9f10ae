// LatestValue: the newest complete value from one writer to one reader; neither ever waits.
//
// The mechanism is chosen at compile time by what the core can do: an atomic exchange (TripleBuffer)
// or loads and stores only (FourSlot). Both have the same functions. For more than one reader see
// shared_latest.hpp.
#pragma once

#include "tm485/sync/four_slot.hpp"
#include "tm485/sync/triple_buffer.hpp"

namespace tm485 {

#if defined(__ARM_ARCH_6M__)
template <class T>
using LatestValue = FourSlot<T>;
#else
template <class T>
using LatestValue = TripleBuffer<T>;
#endif

}  // namespace tm485
