// Random valid frames for the benchmarks: the same 4096 for everything that is compared.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <random>
#include <span>

#include "tm485/protocol/control_field.hpp"
#include "tm485/protocol/crc.hpp"
#include "tm485/protocol/layout.hpp"

namespace tm485::bench {

inline constexpr std::size_t kFrames = 4096;
inline constexpr std::size_t kStride = 16;

/// `kFrames` valid replies to one ID, 17-bit ABS, 16-bit ABM, ENID 11; each at a multiple of kStride.
class Frames {
 public:
  explicit Frames(DataId id) : length_(layout(id).reply_length) {
    std::mt19937 random(485);
    const Layout& row = layout(id);
    for (std::size_t i = 0; i < kFrames; ++i) {
      const std::span<std::uint8_t> frame(&bytes_[i * kStride], length_);
      for (std::uint8_t& byte : frame) byte = static_cast<std::uint8_t>(random());
      frame[0] = control_field(id);
      if (row.sf_at != 0) frame[row.sf_at] &= 0x30;
      if (row.abs_at != 0) frame[row.abs_at + 2U] &= 0x01;
      if (row.abm_at != 0) frame[row.abm_at + 2U] = 0;
      if (row.enid_at != 0) frame[row.enid_at] = 0x11;
      frame.back() = crc(frame.first(length_ - 1));
    }
  }

  [[nodiscard]] std::span<const std::uint8_t> operator[](std::size_t i) const {
    return {&bytes_[(i % kFrames) * kStride], length_};
  }

 private:
  std::size_t length_;
  std::array<std::uint8_t, kFrames * kStride> bytes_{};
};

}  // namespace tm485::bench
