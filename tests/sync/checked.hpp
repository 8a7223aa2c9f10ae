// A payload of one cache line that shows tearing: every word follows from the first.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>

namespace tm485::test {

struct Checked {
  std::array<std::uint64_t, 8> words{};

  /// Checked::of(0) is Checked{}.
  [[nodiscard]] static constexpr Checked of(std::uint64_t number) noexcept {
    Checked checked;
    checked.fill(number);
    return checked;
  }
  /// Word by word, in place, so that an interrupted writer leaves a torn value behind.
  constexpr void fill(std::uint64_t number) noexcept {
    for (std::size_t i = 0; i < words.size(); ++i) words[i] = number * factor(i);
  }
  [[nodiscard]] constexpr std::uint64_t number() const noexcept { return words[0]; }
  [[nodiscard]] constexpr bool whole() const noexcept {
    for (std::size_t i = 1; i < words.size(); ++i)
      if (words[i] != words[0] * factor(i)) return false;
    return true;
  }

 private:
  [[nodiscard]] static constexpr std::uint64_t factor(std::size_t i) noexcept {
    return i == 0 ? 1U : 0x9E3779B97F4A7C15U * (2 * i + 1);
  }
};
static_assert(sizeof(Checked) == 64 && Checked::of(0).whole() && Checked::of(7).whole());

/// What a reader of a newest value found wrong.
struct Findings {
  std::uint64_t torn = 0;
  std::uint64_t backwards = 0;
  std::uint64_t last = 0;

  constexpr void see(const Checked& value) noexcept {
    torn += value.whole() ? 0U : 1U;
    backwards += value.number() < last ? 1U : 0U;
    last = value.number();
  }
};

/// For everything that threads share: Clang 19's thread sanitizer leaves out accesses to members of an object on the
/// stack of the function that accesses it, even if another thread knows the object.
template <class T>
[[nodiscard]] std::unique_ptr<T> on_heap() {
  return std::make_unique<T>();
}

/// A few bits that repeat from run to run.
class Dice {
 public:
  explicit constexpr Dice(std::uint32_t seed) noexcept : state_(seed) {}
  /// 0 to `sides` - 1.
  constexpr std::uint32_t roll(std::uint32_t sides) noexcept {
    state_ = state_ * 1664525U + 1013904223U;
    return (state_ >> 16) % sides;
  }

 private:
  std::uint32_t state_;
};

}  // namespace tm485::test
