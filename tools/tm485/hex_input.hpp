// Frames as people write them: "1A 20 13 6E 01", "0x1A,0x20", "1A2013".
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <expected>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace tm485::cli {

/// The bytes of one frame. Has more room than any frame of the family needs, so that one that is too long is seen as
/// such; what goes beyond that room is dropped.
class FrameBytes {
 public:
  static constexpr std::size_t kCapacity = 256;

  [[nodiscard]] std::span<const std::uint8_t> bytes() const noexcept {
    return std::span(bytes_).first(size_);
  }
  [[nodiscard]] std::size_t size() const noexcept { return size_; }
  void add(std::uint8_t byte) noexcept {
    if (size_ < kCapacity) bytes_[size_++] = byte;
  }

 private:
  std::array<std::uint8_t, kCapacity> bytes_{};
  std::size_t size_ = 0;
};

/// Reads hexadecimal bytes with blanks, commas or colons between them and an optional 0x before each; what follows
/// a # is a comment. No byte at all is a good answer of size 0. The error is one clause. Does not allocate on success.
[[nodiscard]] std::expected<FrameBytes, std::string> parse_hex(std::string_view text);

/// Arguments to frames, one each; but the bytes of one frame written as single arguments (1A 20 13 ...) are put
/// together, if they have the length that their CF asks for and are not all requests of their own.
[[nodiscard]] std::vector<FrameBytes> group_frames(const std::vector<FrameBytes>& arguments);

}  // namespace tm485::cli
