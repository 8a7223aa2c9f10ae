// libgpiod 2.x (Debian: package libgpiod3, soname .so.3; in Debian 12 from the backports suite).
#include <gpiod.h>

#include <cerrno>

#include "gpio_backend.hpp"

#ifdef GPIOD_LINE_BULK_MAX_LINES
#error "this <gpiod.h> is that of libgpiod 1.x"
#endif

namespace tm485::linux_hal::gpio_backend {

struct Chip {
  gpiod_chip* handle;
};
struct Line {
  gpiod_line_request* handle;
  unsigned offset;
};

namespace {

template <class Object, void (*Free)(Object*)>
struct Freer {
  void operator()(Object* object) const noexcept { Free(object); }
};
template <class Object, void (*Free)(Object*)>
using Owned = std::unique_ptr<Object, Freer<Object, Free>>;

}  // namespace

void ChipCloser::operator()(Chip* chip) const noexcept {
  gpiod_chip_close(chip->handle);
  delete chip;
}

void LineCloser::operator()(Line* line) const noexcept {
  gpiod_line_request_release(line->handle);
  delete line;
}

std::string library() { return std::string("libgpiod ") + gpiod_api_version(); }

std::expected<ChipHandle, int> open_chip(const std::string& path) {
  gpiod_chip* const handle = gpiod_chip_open(path.c_str());
  if (handle == nullptr) return std::unexpected(errno);
  return ChipHandle(new Chip{handle});
}

std::string label_of(Chip& chip) {
  const Owned<gpiod_chip_info, gpiod_chip_info_free> info(gpiod_chip_get_info(chip.handle));
  return info ? gpiod_chip_info_get_label(info.get()) : "";
}

unsigned line_count(Chip& chip) {
  const Owned<gpiod_chip_info, gpiod_chip_info_free> info(gpiod_chip_get_info(chip.handle));
  return info ? static_cast<unsigned>(gpiod_chip_info_get_num_lines(info.get())) : 0;
}

std::expected<LineInfo, int> line_info(Chip& chip, unsigned offset) {
  const Owned<gpiod_line_info, gpiod_line_info_free> info(gpiod_chip_get_line_info(chip.handle, offset));
  if (!info) return std::unexpected(errno);
  const auto text = [](const char* found) { return std::string(found == nullptr ? "" : found); };
  return LineInfo{text(gpiod_line_info_get_name(info.get())), text(gpiod_line_info_get_consumer(info.get())),
                  gpiod_line_info_is_used(info.get())};
}

std::expected<LineHandle, int> request_output(ChipHandle chip, unsigned offset, bool active_low,
                                              const std::string& consumer) {
  const Owned<gpiod_line_settings, gpiod_line_settings_free> settings(gpiod_line_settings_new());
  const Owned<gpiod_line_config, gpiod_line_config_free> lines(gpiod_line_config_new());
  const Owned<gpiod_request_config, gpiod_request_config_free> request(gpiod_request_config_new());
  if (!settings || !lines || !request) return std::unexpected(ENOMEM);
  gpiod_line_settings_set_active_low(settings.get(), active_low);
  gpiod_request_config_set_consumer(request.get(), consumer.c_str());
  if (gpiod_line_settings_set_direction(settings.get(), GPIOD_LINE_DIRECTION_OUTPUT) != 0 ||
      gpiod_line_settings_set_output_value(settings.get(), GPIOD_LINE_VALUE_INACTIVE) != 0 ||
      gpiod_line_config_add_line_settings(lines.get(), &offset, 1, settings.get()) != 0)
    return std::unexpected(errno);
  gpiod_line_request* const handle = gpiod_chip_request_lines(chip->handle, request.get(), lines.get());
  if (handle == nullptr) return std::unexpected(errno);
  return LineHandle(new Line{handle, offset});  // the request holds the line by itself
}

int set(Line& line, bool active) noexcept {
  const gpiod_line_value value = active ? GPIOD_LINE_VALUE_ACTIVE : GPIOD_LINE_VALUE_INACTIVE;
  return gpiod_line_request_set_value(line.handle, line.offset, value) == 0 ? 0 : errno;
}

}  // namespace tm485::linux_hal::gpio_backend
