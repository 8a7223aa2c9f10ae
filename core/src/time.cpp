#include "tm485/time.hpp"

namespace tm485 {

std::int64_t whole_in(Time span, Time step) noexcept {
  std::int64_t left = span.count();
  std::int64_t part = step.count();
  unsigned doublings = 0;
  while (part <= left - part) {
    part += part;
    ++doublings;
  }
  std::int64_t whole = 0;
  for (;; part >>= 1, --doublings) {
    whole += whole;
    if (left >= part) {
      left -= part;
      ++whole;
    }
    if (doublings == 0) return whole;
  }
}

}  // namespace tm485
