#include "progress_bar.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

#include "screen.hpp"

namespace tm485::cli {
namespace {

constexpr Time kRedraw = std::chrono::milliseconds(100);
constexpr std::size_t kColumns = 30;

}  // namespace

ProgressBar::ProgressBar() : terminal_(::isatty(STDERR_FILENO) == 1) {}

void ProgressBar::show(std::string_view label, std::uint32_t done, std::uint32_t total, Time left, Time now) {
  if (!terminal_ || (drawn_ && now - drawn_at_ < kRedraw)) return;
  drawn_ = true;
  drawn_at_ = now;
  const double fraction = static_cast<double>(done) / static_cast<double>(std::max(total, 1U));
  fmt::print(stderr, "\r\x1b[2K{:<9} [{}] {} of {} bytes, {:.1f} s left", label, gauge(fraction, kColumns),
             done, total, std::chrono::duration<double>(left).count());
  std::fflush(stderr);
}

void ProgressBar::clear() {
  if (!drawn_) return;
  drawn_ = false;
  fmt::print(stderr, "\r\x1b[2K");
  std::fflush(stderr);
}

}  // namespace tm485::cli
