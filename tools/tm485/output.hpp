// Output: standard output, buffered, which notices when its reader is gone (`tm485 read ... | head -1`).
#pragma once

#include <string>
#include <string_view>

namespace tm485::cli {

/// One for each process. Blocks only in flush(), when the reader is slow.
class Output {
 public:
  Output() = default;
  Output(const Output&) = delete;
  Output& operator=(const Output&) = delete;
  ~Output() { (void)flush(); }

  /// Appends; flushes by itself when 64 KiB have gathered. False once nobody reads any more.
  bool write(std::string_view text);
  /// Hands everything to the system. False once nobody reads any more.
  bool flush();

  /// The reader went away: a normal end, not a failure.
  [[nodiscard]] bool closed() const noexcept { return closed_; }
  /// The last write failed for another reason (errno), or 0.
  [[nodiscard]] int error() const noexcept { return error_; }
  /// Standard output is a terminal.
  [[nodiscard]] static bool is_terminal() noexcept;

 private:
  std::string buffer_;
  bool closed_ = false;
  int error_ = 0;
};

/// kExitFailure, with a message, if the output failed (a full disk); otherwise `exit_code`.
[[nodiscard]] int finish(Output& output, int exit_code);

}  // namespace tm485::cli
