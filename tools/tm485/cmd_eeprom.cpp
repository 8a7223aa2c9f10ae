// tm485 eeprom read, write, dump, verify and diff. restore is in cmd_eeprom_restore.cpp.

#include <fmt/format.h>

#include <algorithm>

#include "confirm.hpp"
#include "eeprom_session.hpp"
#include "hex_input.hpp"
#include "output.hpp"
#include "safe_file.hpp"

namespace tm485::cli {
namespace {

constexpr std::size_t kShownDifferences = 8;
constexpr unsigned kBytesInRow = 16;

/// The linear address of `count` bytes that lie in one page.
std::expected<unsigned, Problem> linear(const EepromOptions& options, std::size_t count,
                                        const EepromShape& shape) {
  const auto refused = [](std::string cause) {
    return std::unexpected(
        usage_problem("bad_address", std::move(cause),
                      "tm485 eeprom dump reads everything; address 127 of each page is the "
                      "page register and cannot be used"));
  };
  if (options.page >= shape.pages)
    return refused(fmt::format("--page {}: the encoder has pages 0 to {}", options.page, shape.pages - 1));
  if (options.address >= shape.page_bytes)
    return refused(fmt::format("--addr {}: a page has bytes 0 to {}", options.address, shape.page_bytes - 1));
  if (count == 0) return refused("no bytes");
  if (count > shape.page_bytes - options.address)
    return refused(fmt::format("{} bytes from address {} on: a page has bytes 0 to {}", count,
                               options.address, shape.page_bytes - 1));
  return options.page * shape.page_bytes + options.address;
}

JsonObject head_json(EepromSession& encoder) {
  JsonObject json;
  json.set("port", encoder.session->port().text());
  json.set("profile", encoder.session->profile().profile().name).set("enid", unsigned{encoder.enid});
  return json;
}

std::string rows(std::span<const std::uint8_t> bytes, unsigned page, unsigned address) {
  std::string text;
  for (std::size_t at = 0; at < bytes.size(); at += kBytesInRow) {
    text += fmt::format("{}:{:<3} ", page, address + at);
    for (const std::uint8_t byte : bytes.subspan(at, std::min<std::size_t>(kBytesInRow, bytes.size() - at)))
      text += fmt::format(" {:02X}", byte);
    text += '\n';
  }
  return text;
}

int print(const std::string& text) {
  Output output;
  output.write(text);
  return finish(output, kExitGood);
}

/// Lines such as "page 3, address 17: FF -> A5": `wanted` is new, `found` was there before.
std::string changes_text(const std::vector<ByteDifference>& changes) {
  std::string text;
  for (const ByteDifference& byte : changes)
    text += fmt::format("\n  page {}, address {:>3}: {:02X} -> {:02X}", byte.page, byte.address, byte.found,
                        byte.wanted);
  return text;
}

/// What verify and diff have in common.
struct Comparison {
  std::size_t bytes = 0;
  std::string text;
  std::vector<ByteDifference> different;
};

std::expected<Comparison, Problem> compare(const EepromOptions& options, std::string_view label) {
  const auto shape = shape_of(options.port);
  if (!shape) return std::unexpected(shape.error());
  const auto image = load_image(options.file, image_format(options.file, options.format), *shape);
  if (!image) return std::unexpected(image.error());
  auto encoder = open_eeprom(options);
  if (!encoder) return std::unexpected(encoder.error());
  const auto found = read_image(*encoder, label);
  if (!found) return std::unexpected(found.error());
  Comparison comparison{found->bytes.size(), {}, differences(*shape, image->bytes, found->bytes)};
  if (!options.port.json) return comparison;
  JsonObject json = head_json(*encoder);
  json.set("file", options.file).set("equal", comparison.different.empty());
  json.set("bytes", comparison.bytes).set("differing", comparison.different.size());
  json.set("crc32_file", crc32_text(image->bytes)).set("crc32_encoder", crc32_text(found->bytes));
  json.set("differences", differences_json(comparison.different));
  json.set("read_ns", encoder->runner->duration().count());
  add_totals(json, encoder->runner->totals());
  comparison.text = json.text() + '\n';
  return comparison;
}

}  // namespace

int run_eeprom_read(const EepromOptions& options) {
  const auto shape = shape_of(options.port);
  if (!shape) return report(shape.error());
  const auto first = linear(options, options.count, *shape);
  if (!first) return report(first.error());
  auto encoder = open_eeprom(options);
  if (!encoder) return report(encoder.error());
  std::vector<std::uint8_t> bytes(options.count);
  if (const auto done = encoder->runner->read(*first, bytes, "reading"); !done) return report(done.error());
  if (!options.port.json) return print(rows(bytes, options.page, options.address));
  JsonObject json = head_json(*encoder);
  json.set("page", options.page).set("address", options.address).set("count", options.count);
  json.set("hex", hex_text(bytes)).set("read_ns", encoder->runner->duration().count());
  add_totals(json, encoder->runner->totals());
  return print(json.text() + '\n');
}

int run_eeprom_write(const EepromOptions& options) {
  const auto shape = shape_of(options.port);
  if (!shape) return report(shape.error());
  const auto parsed = parse_hex(options.hex);
  if (!parsed)
    return report(usage_problem("bad_hex", fmt::format("--hex {}: {}", options.hex, parsed.error()),
                                "write bytes such as \"A5 5A\" or A55A"));
  const auto bytes = parsed->bytes();
  const auto first = linear(options, bytes.size(), *shape);
  if (!first) return report(first.error());
  if (const auto can = can_confirm(options.yes, "--yes"); !can) return report(can.error());
  auto encoder = open_eeprom(options);
  if (!encoder) return report(encoder.error());
  // All of it, so that a byte beside the wanted ones that noise changes can be put back, and is noticed.
  const auto before = read_image(*encoder, "reading");
  if (!before) return report(before.error());
  EepromImage wanted = *before;
  std::copy(bytes.begin(), bytes.end(), wanted.bytes.begin() + *first);
  const auto changes = differences(*shape, wanted.bytes, before->bytes);
  const std::size_t differing = changes.size();
  if (const auto yes =
          confirm(options.yes,
                  fmt::format("Write {} bytes to page {} from address {} on ({} differ)?{}", bytes.size(),
                              options.page, options.address, differing, changes_text(changes)),
                  "yes");
      !yes)
    return report(yes.error());
  const auto done = encoder->runner->write(*first, bytes, "writing");
  if (!done) {
    Problem problem = done.error();
    problem.cause += fmt::format("; {} writes were sent", encoder->runner->totals().writes);
    if (const auto doubt = encoder->runner->in_doubt()) problem.cause += doubt_text(*doubt);
    return report(problem);
  }
  const auto after = read_image(*encoder, "verifying");
  if (!after) return report(after.error());
  const auto wrong = differences(*shape, wanted.bytes, after->bytes);
  if (!wrong.empty())
    return report({"eeprom_mismatch",
                   fmt::format("after the write {} bytes are not as wanted:{}", wrong.size(),
                               differences_text(wrong, kShownDifferences)),
                   "write again; if it persists the EEPROM is worn or busy for longer than the profile says",
                   kExitFailure});
  if (!options.port.json)
    return print(fmt::format("{} bytes written, {} as they were; all {} bytes verified{}\n{}\n", differing,
                             bytes.size() - differing, wanted.bytes.size(), changes_text(changes),
                             totals_text(encoder->runner->totals())));
  JsonObject json = head_json(*encoder);
  json.set("page", options.page).set("address", options.address).set("count", bytes.size());
  json.set("hex", hex_text(bytes))
      .set("before", hex_text(std::span(before->bytes).subspan(*first, bytes.size())));
  json.set("differing", differing).set("verified", wanted.bytes.size());
  add_totals(json, encoder->runner->totals());
  return print(json.text() + '\n');
}

int run_eeprom_dump(const EepromOptions& options) {
  // An older image may be the only one of what an encoder held.
  if (const auto free = may_replace(options.yes, options.file); !free) return report(free.error());
  auto encoder = open_eeprom(options);
  if (!encoder) return report(encoder.error());
  const auto image = read_image(*encoder, "reading");
  if (!image) return report(image.error());
  const ImageFormat format = image_format(options.file, options.format);
  if (const auto saved = replace_file(options.file, image_text(*image, format)); !saved)
    return report(saved.error());
  const Time took = encoder->runner->duration();
  if (!options.port.json)
    return print(fmt::format("{}: {} bytes of {} pages, CRC-32 {}, read in {} ({})\n", options.file,
                             image->bytes.size(), image->shape.pages, crc32_text(image->bytes),
                             milliseconds_text(took), encoder->session->clock_name()));
  JsonObject json = head_json(*encoder);
  json.set("file", options.file).set("format", name(format)).set("date", image->date);
  json.set("pages", image->shape.pages)
      .set("bytes", image->bytes.size())
      .set("crc32", crc32_text(image->bytes));
  json.set("read_ns", took.count());
  add_totals(json, encoder->runner->totals());
  return print(json.text() + '\n');
}

int run_eeprom_verify(const EepromOptions& options) {
  const auto comparison = compare(options, "verifying");
  if (!comparison) return report(comparison.error());
  const auto& different = comparison->different;
  if (const int result = print(
          options.port.json   ? comparison->text
          : different.empty() ? fmt::format("{}: all {} bytes are equal\n", options.file, comparison->bytes)
                              : std::string());
      result != kExitGood || different.empty())
    return result;
  return report({"eeprom_mismatch",
                 fmt::format("{} of {} bytes differ from '{}':{}", different.size(), comparison->bytes,
                             options.file, differences_text(different, kShownDifferences)),
                 "tm485 eeprom diff shows all of them, tm485 eeprom restore writes the file", kExitFailure});
}

int run_eeprom_diff(const EepromOptions& options) {
  const auto comparison = compare(options, "reading");
  if (!comparison) return report(comparison.error());
  const auto& different = comparison->different;
  std::string text = comparison->text;
  if (!options.port.json)
    for (const ByteDifference& byte : different)
      text += fmt::format("page {}, address {:>3}: file {:02X}, encoder {:02X}\n", byte.page, byte.address,
                          byte.wanted, byte.found);
  const int result = print(text);
  return result != kExitGood || different.empty() ? result : kExitFailure;
}

}  // namespace tm485::cli
