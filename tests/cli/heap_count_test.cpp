// What tm485 campaign counts allocations with.
#include "heap_count.hpp"

#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <vector>

namespace tm485::cli {
namespace {

TEST(HeapCount, SeesEveryFormOfNew) {
  struct alignas(256) Wide {
    char bytes[256];
  };
  const auto made = [](auto make) {
    const std::uint64_t before = heap_allocations();
    const auto kept = make();
    static const volatile void* volatile seen;
    seen = kept.get();  // or the compiler leaves the allocation out
    return seen != nullptr ? heap_allocations() - before : 0;
  };
  EXPECT_EQ(made([] { return std::make_unique<int>(1); }), 1u);
  EXPECT_EQ(made([] { return std::make_unique<int[]>(100); }), 1u);
  EXPECT_EQ(made([] { return std::make_unique<Wide>(); }), 1u);
  EXPECT_EQ(made([] { return std::unique_ptr<int>(new (std::nothrow) int(1)); }), 1u);
}

TEST(HeapCount, IsOfTheCallingThread) {
  const std::uint64_t before = heap_allocations();
  std::uint64_t others = 0;
  std::thread thread([&] {
    const std::vector<int> some(1'000);
    others = heap_allocations() + some.size() - 1'000;
  });
  const std::uint64_t begun = heap_allocations();
  thread.join();
  EXPECT_EQ(heap_allocations(), begun);
  EXPECT_GE(others, 1u);
  EXPECT_GE(begun, before);
}

}  // namespace
}  // namespace tm485::cli
