// What is typed: the command line is parsed and its hexadecimal bytes are grouped; nothing is opened or run.
#include <string>
#include <vector>

#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "hex_input.hpp"

namespace tm485::cli {
/// tools/tm485/main.cpp, which this program has without its main(): parses as the command does; no message, no run.
bool command_line_is_good(int argc, char** argv);
}  // namespace tm485::cli

namespace tm485::fuzz {

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
    const auto hex = cli::parse_hex(word);
    if (!hex) continue;
    require(hex->size() <= cli::FrameBytes::kCapacity, "bounded");
    frames.push_back(*hex);
  }
  require(cli::group_frames(frames).size() <= frames.size(), "grouping makes no frames");
  return 0;
}

}  // namespace tm485::fuzz
