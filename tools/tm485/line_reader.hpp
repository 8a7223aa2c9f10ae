// LineReader: lines of standard input with a bounded length, as soon as they are there.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace tm485::cli {

class LineReader {
 public:
  static constexpr std::size_t kLongest = 4096;

  enum class Result { line, too_long, end, failed };

  LineReader();

  /// The next line, without its end, valid until the next call. too_long: the line was dropped up to its end. end:
  /// nothing more, or Ctrl-C. failed: standard input cannot be read (errno).
  [[nodiscard]] Result next(std::string_view& line);

  /// True if the next call may have to wait: the moment to flush what was written so far.
  [[nodiscard]] bool drained() const noexcept { return position_ >= filled_; }

 private:
  [[nodiscard]] Result refill();

  std::vector<char> chunk_;
  std::size_t position_ = 0;
  std::size_t filled_ = 0;
  std::string line_;
  bool at_end_ = false;
};

}  // namespace tm485::cli
