// Texts that people write for quantities, ports, directions and frames: each is refused or within its bounds, and what was
// written is read again.
#include <string>

#include "any_port.hpp"
#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "hex_input.hpp"
#include "mmio_text.hpp"
#include "quantity.hpp"
#include "tm485/linux/rs485_direction.hpp"

namespace tm485::fuzz {

/// One text.
int fuzz_quantities(std::span<const std::uint8_t> bytes) {
  const std::string text(Input(bytes).text());
  for (const auto plain :
       {cli::PlainNumber::refused, cli::PlainNumber::seconds, cli::PlainNumber::nanoseconds}) {
    const auto time = cli::parse_time(text, plain);
    if (!time) continue;
    require(*time >= Time{0} && *time <= std::chrono::seconds(1'000'000), "a time of 0 to 10^6 s");
    const auto again = cli::parse_time(cli::format_time(*time), cli::PlainNumber::refused);
    require(again && *again == *time, "a time that was written is read again");
  }
  const auto within = [](const std::expected<double, std::string>& value, double most) {
    require(!value || (*value >= -most && *value <= most), "within its bounds");
  };
  (void)cli::parse_period(text);
  within(cli::parse_rpm(text), 1e6);
  within(cli::parse_angle(text), 1e6);
  within(cli::parse_frequency(text), 1e9);
  within(cli::parse_torque(text), 1e6);
  within(cli::parse_ppm(text), 1e6);
  (void)cli::parse_mmio(text);
  if (const auto direction = linux_hal::parse_direction(text)) {
    const auto again = linux_hal::parse_direction(linux_hal::to_text(*direction));
    require(again.has_value(), "a direction that was written is read again");
  }
  const auto hex = cli::parse_hex(text);
  require(!hex || hex->size() <= cli::FrameBytes::kCapacity, "bounded");
  return 0;
}

}  // namespace tm485::fuzz
