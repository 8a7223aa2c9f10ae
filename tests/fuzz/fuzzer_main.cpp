// libFuzzer's entry; TM485_FUZZ_TARGET is the target of this program.
#include <cstddef>
#include <cstdint>
#include <span>

#include "fuzz/targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  return tm485::fuzz::TM485_FUZZ_TARGET({data, size});
}
