#include "output.hpp"

#include <unistd.h>

#include <cerrno>
#include <system_error>

#include "problem.hpp"
#include "stop_signal.hpp"

namespace tm485::cli {
namespace {
constexpr std::size_t kFlushAt = 65'536;
}

bool Output::write(std::string_view text) {
  if (closed_ || error_ != 0) return false;
  buffer_ += text;
  return buffer_.size() < kFlushAt || flush();
}

bool Output::flush() {
  std::string_view rest = buffer_;
  while (!rest.empty() && !closed_ && error_ == 0) {
    const ssize_t written = ::write(STDOUT_FILENO, rest.data(), rest.size());
    if (written >= 0) {
      rest.remove_prefix(static_cast<std::size_t>(written));
    } else if (errno == EPIPE) {
      closed_ = true;
    } else if (errno != EINTR) {
      error_ = errno;
    } else if (stop_requested()) {
      break;  // a reader that does not read must not keep Ctrl-C from ending the command
    }
  }
  buffer_.clear();
  return !closed_ && error_ == 0;
}

bool Output::is_terminal() noexcept { return ::isatty(STDOUT_FILENO) == 1; }

int finish(Output& output, int exit_code) {
  (void)output.flush();
  if (output.error() == 0) return exit_code;
  return report({"output_failed", "standard output: " + std::generic_category().message(output.error()),
                 "look at where the output goes: a full disk, a closed file", kExitFailure});
}

}  // namespace tm485::cli
