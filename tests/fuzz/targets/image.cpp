// EEPROM images: any content is refused or is an image of that shape; what is written is read again.
#include <string>

#include "eeprom_image.hpp"
#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"

namespace tm485::fuzz {

/// What one of so many inputs is for besides.
constexpr unsigned kOwnOnceIn = 16;

/// Format and shape; then the content.
int fuzz_image(std::span<const std::uint8_t> bytes) {
  using namespace cli;
  Input input(bytes);
  const ImageFormat format = input.flag() ? ImageFormat::json : ImageFormat::raw;
  const EepromShape shape{1 + input.below(8), 1 + input.below(127)};
  const bool own_too = input.below(kOwnOnceIn) == 0;
  const std::string_view content = input.text();
  const auto image = parse_image(content, format, shape, "x.json");
  if (!image) {
    require(image.error().exit_code == kExitUsage && !image.error().remedy.empty(),
            "a refusal with a remedy");
  } else {
    require(image->bytes.size() == shape.size(), "as many bytes as the encoder has");
    const std::string again = image_text(*image, format);
    const auto second = parse_image(again, format, shape, "x.json");
    require(second.has_value(), "what was written is an image");
    require(second->bytes == image->bytes && second->enid == image->enid, "and the same");
  }
  if (!own_too) return 0;
  // The content as bytes of an encoder.
  EepromImage own{
      .shape = shape, .bytes = {}, .enid = 0x11, .profile = std::string(content.substr(0, 40)), .date = {}};
  for (std::size_t i = 0; i < shape.size(); ++i)
    own.bytes.push_back(content.empty() ? std::uint8_t{0xFF}
                                        : static_cast<std::uint8_t>(content[i % content.size()]));
  for (const ImageFormat as : {ImageFormat::raw, ImageFormat::json}) {
    const auto read = parse_image(image_text(own, as), as, shape, "x.json");
    require(read.has_value() && read->bytes == own.bytes, "an image that was written is read again");
  }
  return 0;
}

}  // namespace tm485::fuzz
