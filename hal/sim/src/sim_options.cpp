#include "tm485/sim/sim_options.hpp"

#include <array>
#include <optional>
#include <type_traits>
#include <utility>

#include "option_text.hpp"

namespace tm485::sim {
namespace {

using Result = std::expected<void, std::string>;

constexpr double kMaxRpm = 1e6;
constexpr double kMaxRevolutions = 1e9;
constexpr double kMaxSeconds = 1e6;
constexpr Time kMaxGap = std::chrono::milliseconds{1};
constexpr Time kMaxDelay = std::chrono::seconds{3};
constexpr Time kMaxBoot = std::chrono::hours{1};

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
    if (t2_) {
      encoder->t2_min = t2_->low;
      encoder->t2_max = t2_->high;
    }
    encoder->latch_offset = latch_offset_;
    encoder->boot_time = boot_;
    encoder->seed = options_.seed;
    encoder->standstill_rpm = standstill_;
    encoder->eeprom = eeprom_;
    encoder->eeprom.seed = eeprom_seed_.value_or(options_.seed + 5);
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
  static const std::array<Key, 36> kKeys;

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
    return put(t2_, time_range(value, kMaxGap), key, value,
               "a time to 1ms such as 3us, or a range 2.8us..3.2us");
  }
  Result read_latch_offset(std::string_view key, std::string_view value) {
    return put(latch_offset_, time_span(value, kMaxGap), key, value, "a time to 1ms such as 0.5us");
  }
  Result read_boot(std::string_view key, std::string_view value) {
    return put(boot_, time_span(value, kMaxBoot), key, value, "a time to 3600s such as 300ms");
  }
  Result read_echo(std::string_view key, std::string_view value) {
    return put(options_.line.echo, on_off(value), key, value, "on or off");
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
  Result read_plan(std::string_view, std::string_view value) {
    auto plan = FaultPlan::parse(value);
    if (!plan) return std::unexpected{"plan: " + plan.error().text()};
    options_.faults = std::move(*plan);
    return {};
  }
  Result read_glitch(std::string_view key, std::string_view value) {
    return put(options_.glitches, number(value, 0.0, 1.0), key, value, "a probability 0..1");
  }
  Result read_swap(std::string_view key, std::string_view value) {
    const auto swap = value == "pair"      ? std::optional{Swap::pair}
                      : value == "receive" ? std::optional{Swap::receive}
                                           : std::nullopt;
    return put(options_.swap, swap, key, value, "pair or receive");
  }
  Result read_power(std::string_view key, std::string_view value) {
    return put(options_.power, on_off(value), key, value, "on or off");
  }
  Result read_standstill(std::string_view key, std::string_view value) {
    return put(standstill_, number(value, 0.0, kMaxRpm), key, value, "revolutions a minute, 0..1e6");
  }
  Result read_eeprom_pages(std::string_view key, std::string_view value) {
    const auto pages = integer<unsigned>(value);
    if (!pages || *pages < 1 || *pages > EepromModel::kPages) return bad(key, value, "1 to 7 pages");
    eeprom_.pages = *pages;
    return {};
  }
  Result read_eeprom_write(std::string_view key, std::string_view value) {
    const auto range = time_range(value, kMaxDelay);
    if (!range) return bad(key, value, "a time to 3s such as 10ms, or a range 5ms..12ms");
    eeprom_.write_time_min = range->low;
    eeprom_.write_time_max = range->high;
    return {};
  }
  Result read_eeprom_page(std::string_view key, std::string_view value) {
    return put(eeprom_.page_time, time_span(value, kMaxDelay), key, value, "a time to 3s such as 18ms");
  }
  Result read_eeprom_ack(std::string_view key, std::string_view value) {
    const bool known = value == "busy" || value == "plain";
    return put(eeprom_.write_reply_busy, known ? std::optional{value == "busy"} : std::nullopt, key, value,
               "busy or plain");
  }
  Result read_eeprom_deaf(std::string_view key, std::string_view value) {
    return put(eeprom_.deaf_while_busy, on_off(value), key, value, "on or off");
  }
  Result read_eeprom_volatile(std::string_view key, std::string_view value) {
    return put(eeprom_.page_volatile, on_off(value), key, value, "on or off");
  }
  Result read_eeprom_start(std::string_view key, std::string_view value) {
    return put(eeprom_.power_up_page, integer<std::uint8_t>(value), key, value, "a page number, 0..255");
  }
  Result read_eeprom_fail(std::string_view key, std::string_view value) {
    return put(eeprom_.failed_writes, number(value, 0.0, 1.0), key, value, "a probability 0..1");
  }
  Result read_eeprom_busy(std::string_view key, std::string_view value) {
    return put(eeprom_.busy_at_start, time_span(value, kMaxBoot), key, value, "a time to 3600s such as 5ms");
  }
  Result read_eeprom_seed(std::string_view key, std::string_view value) {
    return put(eeprom_seed_, integer<std::uint64_t>(value), key, value, "a whole number from 0");
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
  std::string_view profile_ = "tm485_17";
  std::string_view motion_;
  std::optional<double> rpm_;
  std::optional<double> accel_;
  std::optional<double> cruise_;
  double start_ = 0.0;
  std::optional<std::int64_t> turn_;
  std::optional<std::uint8_t> enid_;
  std::optional<std::uint8_t> sf_;
  std::optional<std::uint8_t> almc_;
  std::optional<TimeRange> t2_;
  Time latch_offset_{0};
  Time boot_{0};
  double standstill_ = EncoderConfig{}.standstill_rpm;
  EepromConfig eeprom_;
  std::optional<std::uint64_t> eeprom_seed_;
};

const std::array<Parser::Key, 36> Parser::kKeys{{
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
    {"plan", &Parser::read_plan},
    {"glitch", &Parser::read_glitch},
    {"swap", &Parser::read_swap},
    {"power", &Parser::read_power},
    {"standstill", &Parser::read_standstill},
    {"eeprom_pages", &Parser::read_eeprom_pages},
    {"eeprom_write", &Parser::read_eeprom_write},
    {"eeprom_page", &Parser::read_eeprom_page},
    {"eeprom_ack", &Parser::read_eeprom_ack},
    {"eeprom_deaf", &Parser::read_eeprom_deaf},
    {"eeprom_volatile", &Parser::read_eeprom_volatile},
    {"eeprom_start", &Parser::read_eeprom_start},
    {"eeprom_fail", &Parser::read_eeprom_fail},
    {"eeprom_busy", &Parser::read_eeprom_busy},
    {"eeprom_seed", &Parser::read_eeprom_seed},
}};

}  // namespace

FaultPlan fault_plan_of(const SimOptions& options) {
  FaultPlan plan;
  if (options.request_bit_errors > 0.0 || options.reply_bit_errors > 0.0) {
    plan.add({.kind = FaultKind::bits,
              .values = {options.request_bit_errors, options.reply_bit_errors},
              .seed = options.seed + 3});
  }
  if (options.lost_replies > 0.0)
    plan.add({.kind = FaultKind::lose, .values = {options.lost_replies}, .seed = options.seed + 4});
  plan.add(options.faults);
  return plan;
}

std::expected<SimOptions, std::string> parse_sim_options(std::string_view text) {
  Parser parser;
  if (!text.empty()) {
    for (const std::string_view pair : split(text, ',')) {
      const std::size_t equals = pair.find('=');
      const std::string_view key = pair.substr(0, equals);
      const bool has_value = equals != std::string_view::npos;
      if (!has_value && key != "echo" && key != "eeprom_deaf") {
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
