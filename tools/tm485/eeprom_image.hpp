// EepromImage: the user bytes of an encoder as a file, raw or as JSON. Specification: section 5; docs/eeprom.md shows
// the JSON.
#pragma once

#include <cstddef>
#include <cstdint>
#include <expected>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "problem.hpp"
#include "tm485/protocol/profile.hpp"

namespace tm485::cli {

/// How many pages of how many bytes.
struct EepromShape {
  unsigned pages = 0;
  unsigned page_bytes = 0;
  [[nodiscard]] std::size_t size() const noexcept { return std::size_t{pages} * page_bytes; }
};
[[nodiscard]] EepromShape shape_of(const Profile& profile) noexcept;

struct EepromImage {
  EepromShape shape;
  std::vector<std::uint8_t> bytes;  ///< page after page
  std::optional<std::uint8_t> enid;
  std::string profile;
  std::string date;  ///< UTC, as 2026-01-31T12:00:00Z; a raw file has none of these three
};

enum class ImageFormat : std::uint8_t { raw, json };

/// By `format` ("bin", "json"), or if that is empty by the end of the file's name: .json, anything else is raw.
[[nodiscard]] ImageFormat image_format(std::string_view file, std::string_view format) noexcept;
[[nodiscard]] std::string_view name(ImageFormat format) noexcept;

/// CRC-32 as zlib and Ethernet have it.
[[nodiscard]] std::uint32_t crc32_of(std::span<const std::uint8_t> bytes) noexcept;
[[nodiscard]] std::string crc32_text(std::span<const std::uint8_t> bytes);
[[nodiscard]] std::string hex_text(std::span<const std::uint8_t> bytes);

/// The content of a file.
[[nodiscard]] std::string image_text(const EepromImage& image, ImageFormat format);

/// The image in the content of a file. Problems, all exit code 2: image_size (not the size of `shape`, or another page
/// count), image_checksum, image_format (no image at all). `file` is for the texts.
[[nodiscard]] std::expected<EepromImage, Problem> parse_image(std::string_view content, ImageFormat format,
                                                              const EepromShape& shape,
                                                              const std::string& file);

/// The same from and to a path.
[[nodiscard]] std::expected<EepromImage, Problem> load_image(const std::string& file, ImageFormat format,
                                                             const EepromShape& shape);

/// Now, as in EepromImage::date.
[[nodiscard]] std::string date_text();

/// A byte that is not what it should be.
struct ByteDifference {
  unsigned page = 0;
  unsigned address = 0;
  std::uint8_t wanted = 0;
  std::uint8_t found = 0;
};
/// Both of the size of `shape`.
[[nodiscard]] std::vector<ByteDifference> differences(const EepromShape& shape,
                                                      std::span<const std::uint8_t> wanted,
                                                      std::span<const std::uint8_t> found);

}  // namespace tm485::cli
