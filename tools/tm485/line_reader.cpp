#include "line_reader.hpp"

#include <unistd.h>

#include <algorithm>
#include <cerrno>

#include "stop_signal.hpp"

namespace tm485::cli {

LineReader::LineReader() : chunk_(65'536) { line_.reserve(kLongest); }

LineReader::Result LineReader::refill() {
  while (!at_end_) {
    const ssize_t count = ::read(STDIN_FILENO, chunk_.data(), chunk_.size());
    if (count > 0) {
      position_ = 0;
      filled_ = static_cast<std::size_t>(count);
      return Result::line;
    }
    if (count < 0 && errno != EINTR) return Result::failed;
    at_end_ = count == 0 || stop_requested();
  }
  return Result::end;
}

LineReader::Result LineReader::next(std::string_view& line) {
  line_.clear();
  bool too_long = false;
  bool any = false;
  while (true) {
    if (drained()) {
      const Result result = refill();
      if (result == Result::failed) return result;
      if (result == Result::end) {
        if (!any) return Result::end;
        break;
      }
    }
    any = true;
    const auto begin = chunk_.begin() + static_cast<std::ptrdiff_t>(position_);
    const auto stop = chunk_.begin() + static_cast<std::ptrdiff_t>(filled_);
    const auto end = std::find(begin, stop, '\n');
    const auto length = static_cast<std::size_t>(end - begin);
    if (line_.size() + length > kLongest)
      too_long = true;
    else if (!too_long)
      line_.append(begin, end);
    position_ += length;
    if (end != stop) {
      ++position_;
      break;
    }
  }
  line = line_;
  return too_long ? Result::too_long : Result::line;
}

}  // namespace tm485::cli
