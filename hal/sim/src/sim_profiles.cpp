// The kinds of encoder that a simulated one can be.

#include <array>

#include "tm485/sim/sim_options.hpp"

namespace tm485::sim {
namespace {

struct Named {
  std::string_view name;
  Flavour flavour;
  unsigned single_turn_bits;
  std::uint8_t enid;
  bool multi_turn;
  bool battery;
};
constexpr std::array<Named, 9> kProfiles{{
    {"tm485_17", Flavour::tm485, 17, 0x11, true, false},
    {"tm485_17_battery", Flavour::tm485, 17, 0x11, true, true},
    {"tm485_17_st", Flavour::tm485, 17, 0x00, false, false},
    {"tm485_23", Flavour::tm485, 23, 0x17, true, false},
    {"tm485_23_battery", Flavour::tm485, 23, 0x17, true, true},
    {"tformat_17", Flavour::t_format, 17, 0x11, true, false},
    {"tformat_17_battery", Flavour::t_format, 17, 0x11, true, true},
    {"tformat_23", Flavour::t_format, 23, 0x17, true, false},
    {"tformat_23_battery", Flavour::t_format, 23, 0x17, true, true},
}};

/// What a T-format encoder without a battery reports for ever.
constexpr std::uint8_t kNoBatterySf = 0x20;
constexpr std::uint8_t kNoBatteryAlmc = 0xC1;

}  // namespace

std::expected<EncoderConfig, std::string> encoder_for_profile(std::string_view profile) {
  for (const Named& known : kProfiles) {
    if (known.name != profile) continue;
    EncoderConfig config;
    config.flavour = known.flavour;
    config.single_turn_bits = known.single_turn_bits;
    config.enid = known.enid;
    config.multi_turn = known.multi_turn;
    config.battery = known.battery;
    if (known.flavour == Flavour::t_format) {
      config.start_turn = 0;
      if (!known.battery) {
        config.sf = kNoBatterySf;
        config.almc = kNoBatteryAlmc;
      }
    }
    return config;
  }
  std::string message = "unknown profile '" + std::string{profile} + "': known are";
  for (const Named& known : kProfiles) message += " " + std::string{known.name};
  return std::unexpected{message};
}

}  // namespace tm485::sim
