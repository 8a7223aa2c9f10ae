#include "tm485/sim/sim_options.hpp"

#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <type_traits>
#include <vector>

namespace tm485::sim {
namespace {

using Result = std::expected<void, std::string>;

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

constexpr double kMaxRpm = 1e6;
constexpr double kMaxRevolutions = 1e9;
constexpr double kMaxSeconds = 1e6;
constexpr Time kMaxGap = std::chrono::milliseconds{1};
constexpr Time kMaxDelay = std::chrono::seconds{3};
constexpr Time kMaxBoot = std::chrono::hours{1};

std::unexpected<std::string> bad(std::string_view key, std::string_view value, std::string_view expected) {
  return std::unexpected{std::string{key} + "=" + std::string{value} + ": expected " + std::string{expected}};
}

std::vector<std::string_view> split(std::string_view text, char separator) {
  std::vector<std::string_view> parts;
  for (;;) {
    const std::size_t at = text.find(separator);
    parts.push_back(text.substr(0, at));
    if (at == std::string_view::npos) return parts;
    text.remove_prefix(at + 1);
  }
}

/// A finite number in low..high, nothing after it.
std::optional<double> number(std::string_view text, double low, double high) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  if (!std::isfinite(value) || value < low || value > high) return std::nullopt;
  return value;
}

template <class Integer>
std::optional<Integer> integer(std::string_view text, int base = 10) {
  if (base == 16 && (text.starts_with("0x") || text.starts_with("0X"))) text.remove_prefix(2);
  Integer value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value, base);
  if (error != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

/// A time of 0..limit with its unit: ns, us (or the micro sign), ms, s.
std::optional<Time> time_span(std::string_view text, Time limit) {
  struct Unit {
    std::string_view suffix;
    double ns;
  };
  constexpr std::array<Unit, 6> kUnits{
      {{"ns", 1.0}, {"us", 1e3}, {"\u00B5s", 1e3}, {"\u03BCs", 1e3}, {"ms", 1e6}, {"s", 1e9}}};
  for (const Unit& unit : kUnits) {
    if (!text.ends_with(unit.suffix)) continue;
    text.remove_suffix(unit.suffix.size());
    const auto value = number(text, 0.0, static_cast<double>(limit.count()) / unit.ns);
    if (!value) return std::nullopt;
    return Time{std::llround(*value * unit.ns)};
  }
  return std::nullopt;
}

/// Collects the pairs; what depends on several of them is put together in `finish`.
class Parser {
 public:
  Result read(std::string_view key, std::string_view value) {
    for (const Key& known : kKeys) {
      if (known.name == key) return (this->*known.read)(key, value);
    }
    std::string message = "unknown key '" + std::string{key} + "': known are";
    for (const Key& known : kKeys) message += " " + std::string{known.name};
    return std::unexpected{message};
  }

  std::expected<SimOptions, std::string> finish() {
    auto encoder = encoder_for_profile(profile_);
    if (!encoder) return std::unexpected{encoder.error()};
    if (enid_) encoder->enid = *enid_;
    if (turn_) encoder->start_turn = *turn_;
    if (almc_) {
      encoder->almc = *almc_;
      encoder->sf = EncoderModel::sf_of(*almc_);
    }
    if (sf_) encoder->sf = *sf_;
    encoder->t2_min = t2_min_.value_or(encoder->t2_min);
    encoder->t2_max = t2_max_.value_or(encoder->t2_max);
    encoder->latch_offset = latch_offset_;
    encoder->boot_time = boot_;
    encoder->seed = options_.seed;
    options_.line.seed = options_.seed + 1;
    options_.port.seed = options_.seed + 2;
    options_.encoder = *encoder;

    if (!motion_.empty()) {
      if (rpm_ || accel_ || cruise_) return std::unexpected{"motion= excludes rpm=, accel= and cruise="};
      if (const Result read = read_motion(); !read) return std::unexpected{read.error()};
    } else if (accel_ || cruise_) {
      if (!accel_ || !rpm_) return std::unexpected{"a trapezoid needs rpm= and accel="};
      options_.motion = MotionProfile::trapezoid(*rpm_, *accel_, cruise_.value_or(1.0), start_);
    } else {
      options_.motion = MotionProfile::constant(rpm_.value_or(0.0), start_);
    }
    return options_;
  }

 private:
  struct Key {
    std::string_view name;
    Result (Parser::*read)(std::string_view key, std::string_view value);
  };
  static const std::array<Key, 21> kKeys;

  template <class To>
  static Result put(To& to, const auto& value, std::string_view key, std::string_view text,
                    std::string_view expected) {
    if (!value) return bad(key, text, expected);
    if constexpr (std::is_same_v<To, std::remove_cvref_t<decltype(value)>>) {
      to = value;
    } else {
      to = *value;
    }
    return {};
  }

  Result read_profile(std::string_view, std::string_view value) {
    profile_ = value;
    return {};
  }
  Result read_motion_text(std::string_view, std::string_view value) {
    motion_ = value;
    return {};
  }
  Result read_rpm(std::string_view key, std::string_view value) {
    return put(rpm_, number(value, -kMaxRpm, kMaxRpm), key, value, "revolutions a minute, -1e6..1e6");
  }
  Result read_accel(std::string_view key, std::string_view value) {
    return put(accel_, number(value, 1e-3, 1e9), key, value, "rpm per second, 1e-3..1e9");
  }
  Result read_cruise(std::string_view key, std::string_view value) {
    const auto time = time_span(value, std::chrono::seconds{1'000'000});
    if (!time) return bad(key, value, "a time such as 1s");
    cruise_ = static_cast<double>(time->count()) * 1e-9;
    return {};
  }
  Result read_start(std::string_view key, std::string_view value) {
    return put(start_, number(value, -kMaxRevolutions, kMaxRevolutions), key, value,
               "revolutions, -1e9..1e9");
  }
  Result read_turn(std::string_view key, std::string_view value) {
    return put(turn_, integer<std::int32_t>(value), key, value, "a whole number of 32 bits");
  }
  Result read_seed(std::string_view key, std::string_view value) {
    return put(options_.seed, integer<std::uint64_t>(value), key, value, "a whole number from 0");
  }
  Result read_enid(std::string_view key, std::string_view value) {
    return put(enid_, integer<std::uint8_t>(value, 16), key, value, "one byte in hexadecimal");
  }
  Result read_sf(std::string_view key, std::string_view value) {
    return put(sf_, integer<std::uint8_t>(value, 16), key, value, "one byte in hexadecimal");
  }
  Result read_almc(std::string_view key, std::string_view value) {
    return put(almc_, integer<std::uint8_t>(value, 16), key, value, "one byte in hexadecimal");
  }
  Result read_t2(std::string_view key, std::string_view value) {
    const std::size_t dots = value.find("..");
    const auto low = time_span(value.substr(0, dots), kMaxGap);
    const auto high = dots == std::string_view::npos ? low : time_span(value.substr(dots + 2), kMaxGap);
    if (!low || !high || *low > *high)
      return bad(key, value, "a time to 1ms such as 3us, or a range 2.8us..3.2us");
    t2_min_ = *low;
    t2_max_ = *high;
    return {};
  }
  Result read_latch_offset(std::string_view key, std::string_view value) {
    return put(latch_offset_, time_span(value, kMaxGap), key, value, "a time to 1ms such as 0.5us");
  }
  Result read_boot(std::string_view key, std::string_view value) {
    return put(boot_, time_span(value, kMaxBoot), key, value, "a time to 3600s such as 300ms");
  }
  Result read_echo(std::string_view key, std::string_view value) {
    if (!value.empty() && value != "on" && value != "off") return bad(key, value, "on or off");
    options_.line.echo = value != "off";
    return {};
  }
  Result read_jitter(std::string_view key, std::string_view value) {
    return put(options_.port.start_jitter, time_span(value, kMaxDelay), key, value,
               "a time to 3s such as 2us");
  }
  Result read_margin(std::string_view key, std::string_view value) {
    return put(options_.port.jitter_margin, time_span(value, kMaxDelay), key, value,
               "a time to 3s such as 2us");
  }
  Result read_release(std::string_view key, std::string_view value) {
    return put(options_.port.release, time_span(value, kMaxDelay), key, value, "a time to 3s such as 0.2us");
  }
  Result read_baud(std::string_view key, std::string_view value) {
    const auto rate = integer<std::int64_t>(value);
    if (!rate || *rate < 300 || *rate > 100'000'000)
      return bad(key, value, "bits per second, 300..100000000");
    options_.line.bits_per_second = *rate;
    return {};
  }
  Result read_ber(std::string_view key, std::string_view value) {
    const auto parts = split(value, ':');
    const auto requests = number(parts.front(), 0.0, 1.0);
    const auto replies = number(parts.back(), 0.0, 1.0);
    if (parts.size() > 2 || !requests || !replies) return bad(key, value, "a probability 0..1, or two: P:P");
    options_.request_bit_errors = *requests;
    options_.reply_bit_errors = *replies;
    return {};
  }
  Result read_lost(std::string_view key, std::string_view value) {
    return put(options_.lost_replies, number(value, 0.0, 1.0), key, value, "a probability 0..1");
  }

  Result read_motion() {
    constexpr std::string_view kForms =
        "constant:RPM, sine:REVOLUTIONS:HZ or trapezoid:RPM:RPM_PER_S:SECONDS, with numbers in range";
    const auto parts = split(motion_, ':');
    const auto part = [&](std::size_t k, double low, double high) {
      return k < parts.size() ? number(parts[k], low, high) : std::nullopt;
    };
    if (parts[0] == "constant" && parts.size() == 2) {
      if (const auto rpm = part(1, -kMaxRpm, kMaxRpm)) {
        options_.motion = MotionProfile::constant(*rpm, start_);
        return {};
      }
    } else if (parts[0] == "sine" && parts.size() == 3) {
      const auto amplitude = part(1, 0.0, kMaxRevolutions);
      const auto frequency = part(2, 0.0, 1e6);
      if (amplitude && frequency) {
        options_.motion = MotionProfile::sine(*amplitude, *frequency, start_);
        return {};
      }
    } else if (parts[0] == "trapezoid" && parts.size() == 4) {
      const auto rpm = part(1, -kMaxRpm, kMaxRpm);
      const auto accel = part(2, 1e-3, 1e9);
      const auto cruise = part(3, 0.0, kMaxSeconds);
      if (rpm && accel && cruise) {
        options_.motion = MotionProfile::trapezoid(*rpm, *accel, *cruise, start_);
        return {};
      }
    }
    return bad("motion", motion_, kForms);
  }

  SimOptions options_;
  std::string_view profile_ = kProfiles[0].name;
  std::string_view motion_;
  std::optional<double> rpm_;
  std::optional<double> accel_;
  std::optional<double> cruise_;
  double start_ = 0.0;
  std::optional<std::int64_t> turn_;
  std::optional<std::uint8_t> enid_;
  std::optional<std::uint8_t> sf_;
  std::optional<std::uint8_t> almc_;
  std::optional<Time> t2_min_;
  std::optional<Time> t2_max_;
  Time latch_offset_{0};
  Time boot_{0};
};

const std::array<Parser::Key, 21> Parser::kKeys{{
    {"profile", &Parser::read_profile},
    {"rpm", &Parser::read_rpm},
    {"accel", &Parser::read_accel},
    {"cruise", &Parser::read_cruise},
    {"motion", &Parser::read_motion_text},
    {"start", &Parser::read_start},
    {"turn", &Parser::read_turn},
    {"seed", &Parser::read_seed},
    {"enid", &Parser::read_enid},
    {"sf", &Parser::read_sf},
    {"almc", &Parser::read_almc},
    {"t2", &Parser::read_t2},
    {"latch_offset", &Parser::read_latch_offset},
    {"boot", &Parser::read_boot},
    {"echo", &Parser::read_echo},
    {"jitter", &Parser::read_jitter},
    {"margin", &Parser::read_margin},
    {"release", &Parser::read_release},
    {"baud", &Parser::read_baud},
    {"ber", &Parser::read_ber},
    {"lost", &Parser::read_lost},
}};

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

std::expected<SimOptions, std::string> parse_sim_options(std::string_view text) {
  Parser parser;
  if (!text.empty()) {
    for (const std::string_view pair : split(text, ',')) {
      const std::size_t equals = pair.find('=');
      const std::string_view key = pair.substr(0, equals);
      const bool has_value = equals != std::string_view::npos;
      if (!has_value && key != "echo") {
        return std::unexpected{"'" + std::string{pair} + "': expected key=value"};
      }
      if (const Result read = parser.read(key, has_value ? pair.substr(equals + 1) : ""); !read) {
        return std::unexpected{read.error()};
      }
    }
  }
  return parser.finish();
}

}  // namespace tm485::sim
