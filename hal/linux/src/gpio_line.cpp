#include "tm485/linux/gpio_line.hpp"

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "gpio_backend.hpp"

namespace tm485::linux_hal {
namespace {

using gpio_backend::ChipHandle;

constexpr std::string_view kChipPrefix = "gpiochip";

std::optional<unsigned> number_of(std::string_view text) {
  unsigned number = 0;
  const auto [end, failure] = std::from_chars(text.data(), text.data() + text.size(), number);
  if (text.empty() || failure != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return number;
}

OsError gpio_error(std::string_view what, std::string_view operation, int error_number) {
  return make_os_error(Resource::gpio_line, what, operation, error_number);
}

/// An error that the system knows no number for.
OsError own_error(std::string what, std::string remedy) {
  return {Errc::bad_argument, EINVAL, "cannot open " + std::move(what), std::move(remedy)};
}

/// The chips of the folder, in the order of their numbers.
std::vector<std::string> chip_paths(const std::string& folder) {
  std::vector<std::pair<unsigned, std::string>> found;
  std::error_code ignored;
  for (auto entry = std::filesystem::directory_iterator(folder, ignored);
       !ignored && entry != std::filesystem::directory_iterator(); entry.increment(ignored)) {
    const std::string name = entry->path().filename().string();
    if (!name.starts_with(kChipPrefix)) continue;
    if (const auto number = number_of(std::string_view(name).substr(kChipPrefix.size())))
      found.emplace_back(*number, entry->path().string());
  }
  std::ranges::sort(found);
  std::vector<std::string> paths;
  paths.reserve(found.size());
  for (auto& [number, path] : found) paths.push_back(std::move(path));
  return paths;
}

/// A chip that is open, and one of its lines.
struct Place {
  ChipHandle chip;
  std::string path;
  unsigned offset = 0;
};

/// Calls `visit` for each chip that can be opened. The first error if none could be, ENOENT if there is none.
template <class Visit>
std::expected<void, OsError> for_each_chip(const std::string& folder, const Visit& visit) {
  std::optional<OsError> failure;
  bool any = false;
  for (const std::string& path : chip_paths(folder)) {
    auto chip = gpio_backend::open_chip(path);
    if (chip) {
      any = true;
      visit(std::move(*chip), path);
    } else if (!failure) {
      failure = gpio_error(path, "open", chip.error());
    }
  }
  if (any) return {};
  return std::unexpected(failure ? std::move(*failure) : gpio_error(folder + "gpiochip*", "open", ENOENT));
}

void lines_named(const ChipHandle& chip, const std::string& name, std::vector<unsigned>& found) {
  const unsigned count = gpio_backend::line_count(*chip);
  for (unsigned offset = 0; offset < count; ++offset) {
    const auto info = gpio_backend::line_info(*chip, offset);
    if (info && info->name == name) found.push_back(offset);
  }
}

OsError no_such_name(const std::string& name, const std::string& where) {
  return own_error(
      where + ": no line has the name '" + name + "'",
      "'gpioinfo' (package gpiod) lists the lines and their names; a line without a name is given by "
      "chip and offset");
}

OsError ambiguous(const std::string& name, const std::string& where) {
  return own_error(where + ": more than one line has the name '" + name + "'",
                   "give it by chip and offset ('gpioinfo' lists them)");
}

/// By the line's name, on every chip.
std::expected<Place, OsError> find_by_name(const std::string& name, const GpioOptions& options) {
  std::optional<Place> place;
  std::size_t hits = 0;
  std::vector<unsigned> found;
  const auto asked = for_each_chip(options.chip_folder, [&](ChipHandle chip, const std::string& path) {
    found.clear();
    lines_named(chip, name, found);
    hits += found.size();
    if (!found.empty() && !place) place = Place{std::move(chip), path, found.front()};
  });
  if (!asked) return std::unexpected(asked.error());
  if (hits > 1) return std::unexpected(ambiguous(name, "GPIO"));
  if (!place) return std::unexpected(no_such_name(name, "GPIO"));
  return std::move(*place);
}

std::expected<Place, OsError> open_path(const std::string& path) {
  auto chip = gpio_backend::open_chip(path);
  if (!chip) return std::unexpected(gpio_error(path, "open", chip.error()));
  return Place{std::move(*chip), path, 0};
}

std::expected<Place, OsError> find_chip(const std::string& text, const GpioOptions& options) {
  if (text.find('/') != std::string::npos) return open_path(text);
  if (number_of(text)) return open_path(options.chip_folder + std::string(kChipPrefix) + text);
  if (text.starts_with(kChipPrefix)) return open_path(options.chip_folder + text);
  std::optional<Place> place;
  std::size_t hits = 0;
  const auto asked = for_each_chip(options.chip_folder, [&](ChipHandle chip, const std::string& path) {
    if (gpio_backend::label_of(*chip) != text) return;
    ++hits;
    place = Place{std::move(chip), path, 0};
  });
  if (!asked) return std::unexpected(asked.error());
  if (hits == 1) return std::move(*place);
  return std::unexpected(own_error(
      "GPIO chip '" + text +
          "': " + (hits == 0 ? "no chip has this label" : "more than one chip has this label"),
      "give its path, name or number; 'gpiodetect' (package gpiod) lists the chips with their labels"));
}

std::expected<Place, OsError> find(const GpioAddress& address, const GpioOptions& options) {
  if (address.line.empty())
    return std::unexpected(own_error("GPIO: no line is named", "name one, for example gpiochip0 and 17"));
  if (address.chip.empty()) return find_by_name(address.line, options);
  auto place = find_chip(address.chip, options);
  if (!place) return place;
  const unsigned count = gpio_backend::line_count(*place->chip);
  if (const auto offset = number_of(address.line)) {
    if (*offset >= count) {
      return std::unexpected(
          own_error(place->path + ": it has " + std::to_string(count) + " lines and no line " + address.line,
                    "offsets count from 0 in each chip; 'gpioinfo' (package gpiod) lists them"));
    }
    place->offset = *offset;
    return place;
  }
  std::vector<unsigned> found;
  lines_named(place->chip, address.line, found);
  if (found.empty()) return std::unexpected(no_such_name(address.line, place->path));
  if (found.size() > 1) return std::unexpected(ambiguous(address.line, place->path));
  place->offset = found.front();
  return place;
}

std::string describe(const Place& place, const std::string& name, bool active_low) {
  std::string text = "line " + std::to_string(place.offset);
  if (!name.empty()) text += " (" + name + ")";
  return text + " of " + place.path + (active_low ? ", active low" : "");
}

}  // namespace

std::string gpio_library() { return gpio_backend::library(); }

std::expected<GpioLine, OsError> GpioLine::open(const GpioAddress& address, const GpioOptions& options) {
  if (gpio_library().empty()) return std::unexpected(gpio_error("a GPIO line", "libgpiod", ENOSYS));
  auto place = find(address, options);
  if (!place) return std::unexpected(std::move(place.error()));
  const auto info = gpio_backend::line_info(*place->chip, place->offset);
  if (!info)
    return std::unexpected(gpio_error(place->path, "line " + std::to_string(place->offset), info.error()));
  std::string description = describe(*place, info->name, address.active_low);
  auto line = gpio_backend::request_output(std::move(place->chip), place->offset, address.active_low,
                                           options.consumer.substr(0, 31));
  if (line) return GpioLine(std::move(*line), std::move(description));
  OsError error = gpio_error(description, "request", line.error());
  if (line.error() == EBUSY && info->used)
    error.what +=
        info->consumer.empty() ? ", used by somebody without a name" : ", used by '" + info->consumer + "'";
  return std::unexpected(std::move(error));
}

GpioLine& GpioLine::operator=(GpioLine&& other) noexcept {
  if (this == &other) return *this;
  let_go();
  line_ = std::move(other.line_);
  description_ = std::move(other.description_);
  return *this;
}

int GpioLine::set(bool active) noexcept { return gpio_backend::set(*line_, active); }

void GpioLine::let_go() noexcept {
  if (line_) (void)set(false);
  line_.reset();
}

}  // namespace tm485::linux_hal
