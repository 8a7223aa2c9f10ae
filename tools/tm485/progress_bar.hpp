// ProgressBar: one line on standard error that is drawn again in its place. Nothing at all if that is no terminal.
#pragma once

#include <cstdint>
#include <string_view>

#include "tm485/time.hpp"

namespace tm485::cli {

class ProgressBar {
 public:
  ProgressBar();
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;
  ~ProgressBar() { clear(); }

  /// Draws it, ten times a second at most.
  void show(std::string_view label, std::uint32_t done, std::uint32_t total, Time left, Time now);
  /// Leaves the line empty.
  void clear();

 private:
  bool terminal_;
  bool drawn_ = false;
  Time drawn_at_{0};
};

}  // namespace tm485::cli
