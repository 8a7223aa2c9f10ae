// Without libgpiod: everything else works, and whoever asks for a line is told what to install.
#include <cerrno>

#include "gpio_backend.hpp"

namespace tm485::linux_hal::gpio_backend {

struct Chip {};
struct Line {};

void ChipCloser::operator()(Chip* chip) const noexcept { delete chip; }
void LineCloser::operator()(Line* line) const noexcept { delete line; }

std::string library() { return {}; }
std::expected<ChipHandle, int> open_chip(const std::string&) { return std::unexpected(ENOSYS); }
std::string label_of(Chip&) { return {}; }
unsigned line_count(Chip&) { return 0; }
std::expected<LineInfo, int> line_info(Chip&, unsigned) { return std::unexpected(ENOSYS); }
std::expected<LineHandle, int> request_output(ChipHandle, unsigned, bool, const std::string&) {
  return std::unexpected(ENOSYS);
}
int set(Line&, bool) noexcept { return ENOSYS; }

}  // namespace tm485::linux_hal::gpio_backend
