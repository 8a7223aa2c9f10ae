#include "direction_view.hpp"

#include <fmt/format.h>

#include <utility>

#include "percentiles.hpp"
#include "time_buckets.hpp"
#include "tm485/linux/rs485_direction.hpp"

namespace tm485::cli {

JsonObject direction_json(const AnyPort& port) {
  JsonObject json;
  const std::string control = port.direction_text();
  json.set("control", control.empty() ? "auto" : control);
  if (const linux_hal::TimeHistogram* const times = port.release_times()) {
    JsonObject release = to_json(*times);
    release.set("histogram", to_json(buckets_of(*times)));
    release.set("limit_ns", linux_hal::kReleaseLimit.count()).set("late", port.late_releases());
    json.set("release", std::move(release));
  }
  if (const auto warning = port.direction_warning()) json.set("warning", *warning);
  return json;
}

std::string direction_line(const AnyPort& port) {
  const std::string control = port.direction_text();
  return control.empty() ? std::string() : fmt::format("direction {}\n", control);
}

std::string release_row(const AnyPort& port) {
  const linux_hal::TimeHistogram* const times = port.release_times();
  return times == nullptr ? std::string() : to_row("release", *times);
}

std::string direction_warning_lines(const AnyPort& port) {
  std::string text;
  const linux_hal::TimeHistogram* const times = port.release_times();
  if (times != nullptr && times->count() != 0) {
    text +=
        fmt::format("release  {} of {} later than {:.1f} us after the last stop bit\n", port.late_releases(),
                    times->count(), static_cast<double>(linux_hal::kReleaseLimit.count()) / 1e3);
  }
  if (const auto warning = port.direction_warning()) text += fmt::format("warning  {}\n", *warning);
  return text;
}

void warn_of_direction(const AnyPort& port) {
  if (const auto warning = port.direction_warning()) fmt::print(stderr, "tm485: warning: {}\n", *warning);
}

}  // namespace tm485::cli
