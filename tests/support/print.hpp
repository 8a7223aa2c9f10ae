// How GoogleTest prints the stack's types.
#pragma once

#include <ostream>

#include "tm485/errc.hpp"
#include "tm485/protocol/control_field.hpp"
#include "tm485/time.hpp"

namespace tm485 {

inline void PrintTo(Errc code, std::ostream* out) { *out << name(code); }
inline void PrintTo(DataId id, std::ostream* out) { *out << "ID" << number(id); }

}  // namespace tm485

namespace tm485::test {

/// Nanoseconds and microseconds as they are written in the specification.
constexpr Time ns(std::int64_t value) { return Time{value}; }
constexpr Time us(std::int64_t value) { return Time{value * 1'000}; }
constexpr Time ms(std::int64_t value) { return Time{value * 1'000'000}; }

/// The error of an expected, or ok.
template <class Expected>
Errc error_of(const Expected& result) {
  return result.has_value() ? Errc::ok : result.error();
}

}  // namespace tm485::test
