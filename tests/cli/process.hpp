// Runs the real tm485 command, with a bound on its time.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <string>
#include <vector>

namespace tm485::test {

struct Finished {
  int exit_code = -1;      ///< -1: ended by a signal
  int signal = 0;          ///< that signal
  bool timed_out = false;  ///< did not end by itself in time and was killed
  std::string out;
  std::string err;

  /// The lines of `out`.
  [[nodiscard]] std::vector<std::string> lines() const;
};

/// A running command. Killed, at the latest, by the destructor.
class Process {
 public:
  using Arguments = std::vector<std::string>;

  explicit Process(const Arguments& arguments);
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;
  ~Process();

  /// Writes all of it to standard input and closes that; reads what the command writes meanwhile.
  void feed(const std::string& input, std::chrono::milliseconds bound = std::chrono::seconds(60));
  /// The next line of standard output, without its end; empty if none came in time.
  [[nodiscard]] std::string read_line(std::chrono::milliseconds bound = std::chrono::seconds(20));
  /// Closes the reading end of standard output, as `head -1` does.
  void close_output();
  void send_signal(int number) const;
  /// Waits for the end; kills the command after `bound`.
  [[nodiscard]] Finished wait(std::chrono::milliseconds bound = std::chrono::seconds(60));

 private:
  bool pump(int timeout_ms);

  pid_t pid_ = -1;
  int in_ = -1, out_ = -1, err_ = -1;
  std::string unsent_;
  Finished result_;
  std::size_t consumed_ = 0;
};

/// Runs to the end, with nothing or `input` on standard input.
[[nodiscard]] Finished run(const Process::Arguments& arguments, const std::string& input = {});

/// A folder that is removed with everything in it.
class TemporaryFolder {
 public:
  TemporaryFolder();
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  ~TemporaryFolder();
  [[nodiscard]] std::string path(const std::string& name) const { return path_ + "/" + name; }
  /// Writes a file and answers its path.
  [[nodiscard]] std::string write(const std::string& name, const std::string& text) const;

 private:
  std::string path_;
};

}  // namespace tm485::test
