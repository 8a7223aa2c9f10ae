// The text behind `sim:`: refused, or a set-up that can be run.
#include <algorithm>
#include <cmath>
#include <string>

#include "fuzz/input.hpp"
#include "fuzz/targets.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::fuzz {
namespace {

bool is_probability(double value) { return std::isfinite(value) && value >= 0.0 && value <= 1.0; }

/// Enough of what is heard; an encoder says less, another talker has no end.
constexpr std::size_t kEnough = 64;

/// Some exchanges, by hand: their bytes end within bounds.
void exchange(sim::SimulatedEncoder& encoder, bool disturbed) {
  constexpr std::uint8_t kRequests[][4] = {{0x1A}, {0x02}, {0xEA, 0x05, 0xEF}, {0x32, 0x05, 0xA5, 0x92},
                                           {0xC2}, {0x92}};
  constexpr std::size_t kLengths[] = {1, 1, 3, 4, 1, 1};
  Time now{0};
  for (int round = 0; round < 2; ++round) {
    for (std::size_t i = 0; i < std::size(kLengths); ++i) {
      (void)encoder.port().try_send(std::span(kRequests[i]).first(kLengths[i]), now);
      std::uint8_t buffer[64];
      std::size_t heard = 0;
      for (int step = 0; step < 20 && heard <= kEnough; ++step) {
        now += std::chrono::milliseconds(2);
        (void)encoder.port().transmission(now);
        const Reception got = encoder.port().try_receive(buffer, now);
        require(got.count <= sizeof buffer, "what was received fits");
        if (got.count == 0 && heard != 0) break;  // that was all
        heard += got.count;
      }
      require(disturbed || heard <= kEnough, "one reply, one echo and a little noise");
    }
  }
}

}  // namespace

int fuzz_sim_options(std::span<const std::uint8_t> bytes) {
  Input input(bytes);
  const std::string_view text = input.text();
  const auto options = sim::parse_sim_options(text);
  if (!options) {
    require(!options.error().empty(), "a refusal says why");
    return 0;
  }
  require(is_probability(options->request_bit_errors) && is_probability(options->reply_bit_errors) &&
              is_probability(options->lost_replies) && is_probability(options->glitches),
          "probabilities");
  sim::SimulatedEncoder encoder(*options);
  exchange(encoder, text.find("plan=") != std::string_view::npos);  // another talker has no end
  return 0;
}

}  // namespace tm485::fuzz
