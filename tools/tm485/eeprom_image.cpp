#include "eeprom_image.hpp"

#include <fmt/format.h>
#include <zlib.h>

#include <ctime>
#include <nlohmann/json.hpp>

#include "hex_input.hpp"
#include "plain_text.hpp"
#include "safe_file.hpp"

namespace tm485::cli {
namespace {

using Json = nlohmann::ordered_json;

/// Deeper than any image: a file that nests for ever must not use up the stack.
constexpr int kDeepest = 8;
constexpr std::string_view kFormat = "tm485-eeprom";
constexpr int kVersion = 1;
constexpr std::size_t kLargestFile = 65'536;

Problem no_image(const std::string& file, std::string_view why) {
  return usage_problem(
      "image_format", fmt::format("'{}' is no EEPROM image: {}", file, why),
      "name a file that tm485 eeprom dump has written; --format bin or json if its name does "
      "not say what it is");
}

Problem wrong_size(const std::string& file, std::string_view why) {
  return usage_problem("image_size", fmt::format("'{}': {}", file, why),
                       "use an image of this kind of encoder, or the --profile that fits both");
}

/// Bytes of one page from its hexadecimal text.
std::optional<std::vector<std::uint8_t>> page_bytes(const Json& page) {
  if (!page.is_string()) return std::nullopt;
  const auto parsed = parse_hex(page.get<std::string>());
  if (!parsed) return std::nullopt;
  return std::vector<std::uint8_t>(parsed->bytes().begin(), parsed->bytes().end());
}

std::string text_of(const Json& json, const char* key) {
  const auto at = json.find(key);
  return at != json.end() && at->is_string() ? at->get<std::string>() : std::string();
}

std::expected<EepromImage, Problem> parse_json_image(std::string_view content, const EepromShape& shape,
                                                     const std::string& file) {
  const Json json =
      Json::parse(content, [](int depth, Json::parse_event_t, Json&) { return depth <= kDeepest; }, false);
  if (!json.is_object()) return std::unexpected(no_image(file, "it is not one JSON object"));
  if (text_of(json, "format") != kFormat)
    return std::unexpected(no_image(file, fmt::format("its \"format\" is not \"{}\"", kFormat)));
  if (json.value("version", Json()) != Json(kVersion))
    return std::unexpected(no_image(file, fmt::format("its \"version\" is not {}", kVersion)));
  const auto pages = json.find("pages");
  if (pages == json.end() || !pages->is_object())
    return std::unexpected(no_image(file, "it has no \"pages\""));
  if (pages->size() != shape.pages)
    return std::unexpected(
        wrong_size(file, fmt::format("it has {} pages, the encoder {}", pages->size(), shape.pages)));
  EepromImage image;
  image.shape = shape;
  for (unsigned page = 0; page < shape.pages; ++page) {
    const auto at = pages->find(std::to_string(page));
    if (at == pages->end()) return std::unexpected(no_image(file, fmt::format("page {} is missing", page)));
    const auto bytes = page_bytes(*at);
    if (!bytes) return std::unexpected(no_image(file, fmt::format("page {} is not hexadecimal", page)));
    if (bytes->size() != shape.page_bytes)
      return std::unexpected(wrong_size(file, fmt::format("page {} has {} bytes, that of the encoder {}",
                                                          page, bytes->size(), shape.page_bytes)));
    image.bytes.insert(image.bytes.end(), bytes->begin(), bytes->end());
  }
  const std::string stated = text_of(json, "crc32");
  if (stated != crc32_text(image.bytes))
    return std::unexpected(
        usage_problem("image_checksum",
                      fmt::format("'{}': its \"crc32\" is \"{}\", that of its bytes {}", file,
                                  plain_text(stated), crc32_text(image.bytes)),
                      "the file is damaged: use another copy. If you have changed bytes on purpose, put "
                      "the checksum of its bytes into \"crc32\""));
  image.profile = plain_text(text_of(json, "profile"));
  image.date = plain_text(text_of(json, "date"));
  if (const auto enid = json.find("enid"); enid != json.end() && enid->is_number_unsigned())
    if (const auto value = enid->get<std::uint64_t>(); value <= 0xFF)
      image.enid = static_cast<std::uint8_t>(value);
  return image;
}

}  // namespace

EepromShape shape_of(const Profile& profile) noexcept {
  return {profile.eeprom_pages, profile.eeprom_page_bytes};
}

ImageFormat image_format(std::string_view file, std::string_view format) noexcept {
  if (format.empty()) return file.ends_with(".json") ? ImageFormat::json : ImageFormat::raw;
  return format == "json" ? ImageFormat::json : ImageFormat::raw;
}

std::string_view name(ImageFormat format) noexcept { return format == ImageFormat::json ? "json" : "bin"; }

std::uint32_t crc32_of(std::span<const std::uint8_t> bytes) noexcept {
  return static_cast<std::uint32_t>(::crc32(0, bytes.data(), static_cast<uInt>(bytes.size())));
}

std::string crc32_text(std::span<const std::uint8_t> bytes) { return fmt::format("{:08X}", crc32_of(bytes)); }

std::string hex_text(std::span<const std::uint8_t> bytes) {
  std::string text;
  for (const std::uint8_t byte : bytes) text += fmt::format("{:02X}", byte);
  return text;
}

std::string image_text(const EepromImage& image, ImageFormat format) {
  if (format == ImageFormat::raw) return {image.bytes.begin(), image.bytes.end()};
  Json json;
  json["format"] = kFormat;
  json["version"] = kVersion;
  json["profile"] = image.profile;
  if (image.enid) json["enid"] = *image.enid;
  json["date"] = image.date;
  json["crc32"] = crc32_text(image.bytes);
  Json pages = Json::object();
  for (unsigned page = 0; page < image.shape.pages; ++page)
    pages[std::to_string(page)] = hex_text(
        std::span(image.bytes).subspan(std::size_t{page} * image.shape.page_bytes, image.shape.page_bytes));
  json["pages"] = std::move(pages);
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

std::expected<EepromImage, Problem> parse_image(std::string_view content, ImageFormat format,
                                                const EepromShape& shape, const std::string& file) {
  if (format == ImageFormat::json) return parse_json_image(content, shape, file);
  if (content.size() != shape.size())
    return std::unexpected(
        wrong_size(file, fmt::format("it has {} bytes, the encoder {} ({} pages of {})", content.size(),
                                     shape.size(), shape.pages, shape.page_bytes)));
  EepromImage image;
  image.shape = shape;
  image.bytes.assign(content.begin(), content.end());
  return image;
}

std::expected<EepromImage, Problem> load_image(const std::string& file, ImageFormat format,
                                               const EepromShape& shape) {
  const auto content = read_whole_file(file, kLargestFile);
  if (!content) return std::unexpected(content.error());
  return parse_image(*content, format, shape, file);
}

std::string date_text() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  (void)::gmtime_r(&now, &parts);
  return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}Z", parts.tm_year + 1900, parts.tm_mon + 1,
                     parts.tm_mday, parts.tm_hour, parts.tm_min, parts.tm_sec);
}

std::vector<ByteDifference> differences(const EepromShape& shape, std::span<const std::uint8_t> wanted,
                                        std::span<const std::uint8_t> found) {
  std::vector<ByteDifference> result;
  for (unsigned i = 0; i < shape.size(); ++i)
    if (wanted[i] != found[i])
      result.push_back({i / shape.page_bytes, i % shape.page_bytes, wanted[i], found[i]});
  return result;
}

}  // namespace tm485::cli
