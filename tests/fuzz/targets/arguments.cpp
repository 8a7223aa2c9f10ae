// What is typed: the command line is parsed and its quantities, ports and hexadecimal bytes are read; nothing is
// opened or run.
#include <string>
#include <vector>

#include "any_port.hpp"
#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "hex_input.hpp"
#include "mmio_text.hpp"
#include "quantity.hpp"
#include "tm485/linux/rs485_direction.hpp"

namespace tm485::cli {
/// tools/tm485/main.cpp, which this program has without its main(): parses as the command does; no message, no run.
bool command_line_is_good(int argc, char** argv);
}  // namespace tm485::cli

namespace tm485::fuzz {
namespace {

void read_quantities(const std::string& text) {
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
}

}  // namespace

/// Arguments, one a line.
int fuzz_arguments(std::span<const std::uint8_t> bytes) {
  Input input(bytes);
  std::string_view text = input.text().substr(0, 1'024);
  std::vector<std::string> words{"tm485"};
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    // An argument ends at its NUL.
    words.emplace_back(text.substr(0, std::min(end, text.find('\0'))));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  (void)cli::command_line_is_good(static_cast<int>(words.size()), argv.data());
  std::vector<cli::FrameBytes> frames;
  for (const std::string& word : words) {
    read_quantities(word);
    const auto hex = cli::parse_hex(word);
    if (!hex) continue;
    require(hex->size() <= cli::FrameBytes::kCapacity, "bounded");
    frames.push_back(*hex);
  }
  require(cli::group_frames(frames).size() <= frames.size(), "grouping makes no frames");
  return 0;
}

}  // namespace tm485::fuzz
