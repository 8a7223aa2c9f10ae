// Screen: a block of lines that is drawn again in its place on a terminal. Nothing has to be put back afterwards: the
// cursor stays visible and below the block.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "output.hpp"

namespace tm485::cli {

class Screen {
 public:
  explicit Screen(Output& output) : output_(&output) {}

  /// Draws the lines over those of the last call, cut to the width of the terminal. False once nobody reads any more.
  bool show(const std::vector<std::string>& lines);

 private:
  Output* output_;
  std::size_t height_ = 0;
};

/// The first `columns` characters of a UTF-8 text.
[[nodiscard]] std::string_view cut(std::string_view text, std::size_t columns) noexcept;

/// A gauge of `columns` characters for a fraction 0..1.
[[nodiscard]] std::string gauge(double fraction, std::size_t columns);

}  // namespace tm485::cli
