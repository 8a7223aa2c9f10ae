// The text form of a direction control.
#include <string>
#include <utility>
#include <vector>

#include "tm485/linux/rs485_direction.hpp"

namespace tm485::linux_hal {
namespace {

OsError bad_direction(std::string_view text, const std::string& why) {
  return {Errc::bad_argument, 0, "direction '" + std::string(text) + "': " + why,
          "write auto (transceiver or adapter switches), kernel[:low][:mute] (the port's driver switches), "
          "gpio:CHIP:LINE[:low] or gpio:NAME[:low] (a GPIO line switches; low: active low), for example "
          "gpio:gpiochip0:17"};
}

std::vector<std::string> split(std::string_view text) {
  std::vector<std::string> parts;
  for (std::size_t end = 0; end != std::string_view::npos;) {
    end = text.find(':');
    parts.emplace_back(text.substr(0, end));
    if (end != std::string_view::npos) text.remove_prefix(end + 1);
  }
  return parts;
}

std::expected<DirectionConfig, OsError> parse_kernel(std::string_view text,
                                                     const std::vector<std::string>& parts) {
  DirectionConfig config;
  config.kind = DirectionKind::kernel;
  for (std::size_t at = 1; at < parts.size(); ++at) {
    bool& flag = parts[at] == "low" ? config.rts_low : config.mute;
    if (parts[at] != "low" && parts[at] != "mute")
      return std::unexpected(bad_direction(text, "'" + parts[at] + "' is neither low nor mute"));
    if (std::exchange(flag, true))
      return std::unexpected(bad_direction(text, "'" + parts[at] + "' comes twice"));
  }
  return config;
}

std::expected<DirectionConfig, OsError> parse_gpio(std::string_view text, std::vector<std::string> parts) {
  DirectionConfig config;
  config.kind = DirectionKind::gpio;
  if (parts.size() > 2 && parts.back() == "low") {
    config.gpio.active_low = true;
    parts.pop_back();
  }
  if (parts.size() < 2 || parts.size() > 3)
    return std::unexpected(
        bad_direction(text, parts.size() < 2 ? "it names no line" : "it has too many parts"));
  for (std::size_t at = 1; at < parts.size(); ++at)
    if (parts[at].empty()) return std::unexpected(bad_direction(text, "a part of it is empty"));
  if (parts.size() == 3) config.gpio.chip = parts[1];
  config.gpio.line = parts.back();
  if (parts.size() == 2 && config.gpio.line.find_first_not_of("0123456789") == std::string::npos)
    return std::unexpected(bad_direction(text, "a number alone does not say of which chip"));
  return config;
}

}  // namespace

std::expected<DirectionConfig, OsError> parse_direction(std::string_view text) {
  std::vector<std::string> parts = split(text);
  if (parts.front() == "gpio") return parse_gpio(text, std::move(parts));
  if (parts.front() == "kernel") return parse_kernel(text, parts);
  if (text == "auto") return DirectionConfig{};
  return std::unexpected(
      bad_direction(text, text.empty() ? "it is empty" : "there is no such direction control"));
}

std::string to_text(const DirectionConfig& config) {
  switch (config.kind) {
    case DirectionKind::automatic:
      break;
    case DirectionKind::kernel:
      return std::string("kernel") + (config.rts_low ? ":low" : "") + (config.mute ? ":mute" : "");
    case DirectionKind::gpio:
      return "gpio:" + (config.gpio.chip.empty() ? "" : config.gpio.chip + ":") + config.gpio.line +
             (config.gpio.active_low ? ":low" : "");
  }
  return "auto";
}

}  // namespace tm485::linux_hal
