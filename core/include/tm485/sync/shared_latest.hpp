// SharedLatest: the newest value from one writer to any number of readers.
//
// A sequence lock over words: the count is odd while the writer is at work, and a reader that saw
// the same even count before and after has a whole value. The payload is atomic words, so there is
// no data race by the language's rules either. The writer never waits; a reader tries a bounded
// number of times. The argument is in docs/concurrency.md.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>

#include "tm485/sync/atomics.hpp"

namespace tm485 {

/// One writer context, any number of reader contexts.
template <class T, class Atomics = StdAtomics>
class SharedLatest {
  static_assert(std::is_trivially_copyable_v<T>);
  static_assert(std::has_unique_object_representations_v<T>, "padding has no value that could be copied");
  static constexpr std::size_t kWords = (sizeof(T) + sizeof(std::uint32_t) - 1) / sizeof(std::uint32_t);
  static_assert(sizeof(T) == kWords * sizeof(std::uint32_t), "the size is a multiple of four bytes");
  using Image = std::array<std::uint32_t, kWords>;

 public:
  /// Writer. Replaces the newest value; as many stores as T has words.
  void put(const T& value) noexcept {
    const auto image = std::bit_cast<Image>(value);
    ++count_;
    sequence_.store(count_, Atomics::kRelaxed);
    // release: pairs with the acquire fence in try_get(): whoever reads a word stored below also reads this count, or a later one.
    Atomics::fence(Atomics::kRelease);
    for (std::size_t i = 0; i < kWords; ++i) words_[i].store(image[i], Atomics::kRelaxed);
    ++count_;
    sequence_.store(count_, Atomics::kRelease);  // pairs with the first load in try_get()
  }

  /// Reader. True, and the newest value, if within `tries` the writer left it alone for the time of one copy.
  [[nodiscard]] bool try_get(T& value, unsigned tries = 8) const noexcept {
    for (; tries != 0; --tries) {
      const auto before = static_cast<std::uint32_t>(
          sequence_.load(Atomics::kAcquire));  // pairs with the last store in put()
      if ((before & 1U) != 0) continue;
      Image image;
      for (std::size_t i = 0; i < kWords; ++i) image[i] = words_[i].load(Atomics::kRelaxed);
      Atomics::fence(Atomics::kAcquire);  // pairs with the release fence in put()
      if (static_cast<std::uint32_t>(sequence_.load(Atomics::kRelaxed)) != before) continue;
      value = std::bit_cast<T>(image);
      return true;
    }
    return false;
  }

 private:
  using Word = typename Atomics::template Atomic<std::uint32_t>;

  alignas(Atomics::kCacheLine) Word sequence_{0U};
  std::array<Word, kWords> words_{};
  alignas(Atomics::kCacheLine) std::uint32_t count_ = 0;  ///< the writer's own
};

}  // namespace tm485
