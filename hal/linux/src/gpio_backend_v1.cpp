// libgpiod 1.x (Debian 12: package libgpiod2, soname .so.2).
#include <gpiod.h>

#include <cerrno>

#include "gpio_backend.hpp"

#ifndef GPIOD_LINE_BULK_MAX_LINES
#error "this <gpiod.h> is not that of libgpiod 1.x"
#endif

namespace tm485::linux_hal::gpio_backend {

struct Chip {
  gpiod_chip* handle;
};
/// Belongs to its chip, which stays open with it.
struct Line {
  ChipHandle chip;
  gpiod_line* handle;
};

void ChipCloser::operator()(Chip* chip) const noexcept {
  gpiod_chip_close(chip->handle);  // releases its lines too
  delete chip;
}

void LineCloser::operator()(Line* line) const noexcept {
  gpiod_line_release(line->handle);
  delete line;
}

std::string library() { return std::string("libgpiod ") + gpiod_version_string(); }

std::expected<ChipHandle, int> open_chip(const std::string& path) {
  gpiod_chip* const handle = gpiod_chip_open(path.c_str());
  if (handle == nullptr) return std::unexpected(errno);
  return ChipHandle(new Chip{handle});
}

std::string label_of(Chip& chip) { return gpiod_chip_label(chip.handle); }

unsigned line_count(Chip& chip) { return gpiod_chip_num_lines(chip.handle); }

std::expected<LineInfo, int> line_info(Chip& chip, unsigned offset) {
  gpiod_line* const line = gpiod_chip_get_line(chip.handle, offset);
  if (line == nullptr) return std::unexpected(errno);
  const auto text = [](const char* found) { return std::string(found == nullptr ? "" : found); };
  return LineInfo{text(gpiod_line_name(line)), text(gpiod_line_consumer(line)), gpiod_line_is_used(line)};
}

std::expected<LineHandle, int> request_output(ChipHandle chip, unsigned offset, bool active_low,
                                              const std::string& consumer) {
  gpiod_line* const line = gpiod_chip_get_line(chip->handle, offset);
  if (line == nullptr) return std::unexpected(errno);
  const int flags = active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  if (gpiod_line_request_output_flags(line, consumer.c_str(), flags, 0) != 0) return std::unexpected(errno);
  return LineHandle(new Line{std::move(chip), line});
}

int set(Line& line, bool active) noexcept {
  return gpiod_line_set_value(line.handle, active ? 1 : 0) == 0 ? 0 : errno;
}

}  // namespace tm485::linux_hal::gpio_backend
