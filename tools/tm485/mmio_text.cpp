#include "mmio_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>

#include "quantity.hpp"

namespace tm485::cli {
namespace {

using linux_hal::MmioBlock;
using linux_hal::MmioDirection;
using linux_hal::MmioOptions;

struct Parsed {
  MmioOptions options;
  bool width_given = false;
};

using Outcome = std::optional<std::string>;  ///< what is wrong, or nothing

struct Block {
  std::string_view name;
  MmioBlock block;
};
constexpr std::array kBlocks{Block{"pl011", MmioBlock::pl011}, Block{"16550", MmioBlock::ns16550}};

struct DirectionName {
  std::string_view name;
  MmioDirection::Kind kind;
};
constexpr std::array kDirections{DirectionName{"none", MmioDirection::Kind::automatic},
                                 DirectionName{"rts", MmioDirection::Kind::rts},
                                 DirectionName{"rts_off", MmioDirection::Kind::rts_off}};

/// Decimal, or hexadecimal with 0x.
std::optional<std::uint64_t> whole_number(std::string_view text) {
  const bool hexadecimal = text.starts_with("0x") || text.starts_with("0X");
  if (hexadecimal) text.remove_prefix(2);
  std::uint64_t number = 0;
  const auto [end, error] =
      std::from_chars(text.data(), text.data() + text.size(), number, hexadecimal ? 16 : 10);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return number;
}

Outcome set_clock(Parsed& parsed, std::string_view value) {
  const auto hertz = parse_frequency(value);
  if (!hertz) return fmt::format("clock: {}", hertz.error());
  const double rounded = std::round(*hertz);
  if (rounded < 1.0 || rounded > static_cast<double>(std::numeric_limits<std::uint32_t>::max()))
    return fmt::format("clock: {} is out of range", value);
  parsed.options.clock_hz = static_cast<std::uint32_t>(rounded);
  return {};
}

Outcome set_byte(std::uint8_t& to, std::string_view key, std::string_view value, std::string_view allowed) {
  const auto number = whole_number(value);
  if (!number || *number > 4) return fmt::format("{}={}: it is {}", key, value, allowed);
  to = static_cast<std::uint8_t>(*number);
  return {};
}

Outcome set_shift(Parsed& parsed, std::string_view value) {
  return set_byte(parsed.options.layout.shift, "shift", value, "0, 1 or 2");
}

Outcome set_width(Parsed& parsed, std::string_view value) {
  parsed.width_given = true;
  return set_byte(parsed.options.layout.width, "width", value, "1, 2 or 4 bytes");
}

Outcome set_uio(Parsed& parsed, std::string_view value) {
  if (value.empty()) return "uio: no path";
  parsed.options.uio = value;
  return {};
}

Outcome set_memory(Parsed& parsed, std::string_view value) {
  if (value.empty()) return "memory: no path";
  parsed.options.memory = value;
  return {};
}

Outcome set_direction(Parsed& parsed, std::string_view value) {
  for (const DirectionName& row : kDirections) {
    if (row.name != value) continue;
    parsed.options.direction.kind = row.kind;
    return {};
  }
  return fmt::format("direction={}: it is none, rts or rts_off", value);
}

Outcome set_time(std::optional<Time>& to, std::string_view key, std::string_view value) {
  const auto time = parse_time(value, PlainNumber::refused);
  if (!time) return fmt::format("{}: {}", key, time.error());
  to = *time;
  return {};
}

Outcome set_lead(Parsed& parsed, std::string_view value) {
  std::optional<Time> lead;
  Outcome outcome = set_time(lead, "lead", value);
  parsed.options.driver_lead = lead.value_or(Time{0});
  return outcome;
}

Outcome set_release(Parsed& parsed, std::string_view value) {
  return set_time(parsed.options.release_bound, "release", value);
}

Outcome set_allowance(Parsed& parsed, std::string_view value) {
  return set_time(parsed.options.latency_allowance, "allowance", value);
}

struct Key {
  std::string_view name;
  Outcome (*set)(Parsed&, std::string_view);
};
constexpr std::array kKeys{
    Key{"clock", set_clock}, Key{"shift", set_shift},     Key{"width", set_width},
    Key{"uio", set_uio},     Key{"memory", set_memory},   Key{"direction", set_direction},
    Key{"lead", set_lead},   Key{"release", set_release}, Key{"allowance", set_allowance},
};

/// KIND or KIND@ADDRESS.
Outcome set_block(MmioOptions& options, std::string_view text) {
  const std::string_view name = text.substr(0, text.find('@'));
  const Block* found = nullptr;
  for (const Block& row : kBlocks)
    if (row.name == name) found = &row;
  if (found == nullptr)
    return fmt::format("'{}' is no kind of UART that is known here: pl011 or 16550", name);
  options.block = found->block;
  if (name.size() == text.size()) return {};
  const std::string_view address = text.substr(name.size() + 1);
  const auto number = whole_number(address);
  if (!number || *number == 0) return fmt::format("'{}' is no address", address);
  options.address = *number;
  return {};
}

Outcome set_pair(Parsed& parsed, std::string_view pair) {
  const std::size_t equals = pair.find('=');
  const std::string_view name = pair.substr(0, equals);
  const std::string_view value =
      equals == std::string_view::npos ? std::string_view{} : pair.substr(equals + 1);
  for (const Key& key : kKeys)
    if (key.name == name) return key.set(parsed, value);
  std::string names;
  for (const Key& key : kKeys) names += (names.empty() ? "" : ", ") + std::string(key.name);
  return fmt::format("no key '{}'; there are: {}", name, names);
}

}  // namespace

std::string_view mmio_usage() noexcept {
  return "mmio:pl011@ADDRESS,clock=48MHz or mmio:16550@ADDRESS,clock=...,shift=2 (or ...,uio=/dev/uio0 "
         "without "
         "an address)";
}

std::expected<MmioOptions, std::string> parse_mmio(std::string_view text) {
  Parsed parsed;
  bool first = true;
  while (first || !text.empty()) {
    const std::string_view part = text.substr(0, text.find(','));
    if (Outcome wrong = first ? set_block(parsed.options, part) : set_pair(parsed, part))
      return std::unexpected(std::move(*wrong));
    text.remove_prefix(std::min(text.size(), part.size() + 1));
    first = false;
  }
  MmioOptions& options = parsed.options;
  if (options.clock_hz == 0) return std::unexpected("the UART's clock is needed: clock=48MHz");
  if (options.address == 0 && options.uio.empty())
    return std::unexpected("an address (pl011@0x9000000) or a UIO device (uio=/dev/uio0) is needed");
  // Blocks whose registers are words apart want word accesses, as a rule.
  if (!parsed.width_given && options.layout.shift <= 2)
    options.layout.width = static_cast<std::uint8_t>(1U << options.layout.shift);
  if (!options.layout.valid())
    return std::unexpected("shift is 0, 1 or 2; width is 1, 2 or 4 and not more than the shift leaves");
  return options;
}

}  // namespace tm485::cli
