#include "process.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>

namespace tm485::test {
namespace {

using Clock = std::chrono::steady_clock;

void close_end(int& fd) {
  if (fd >= 0) ::close(fd);
  fd = -1;
}

int remaining_ms(Clock::time_point end) {
  const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - Clock::now()).count();
  return left < 0 ? 0 : static_cast<int>(left);
}

/// Appends what is there; closes at the end of the stream.
void drain(int& fd, std::string& text) {
  std::array<char, 65536> chunk;
  const ssize_t count = ::read(fd, chunk.data(), chunk.size());
  if (count > 0)
    text.append(chunk.data(), static_cast<std::size_t>(count));
  else if (count == 0 || errno != EINTR)
    close_end(fd);
}

}  // namespace

std::vector<std::string> Finished::lines() const {
  std::vector<std::string> result;
  for (std::size_t at = 0; at < out.size();) {
    const std::size_t end = std::min(out.find('\n', at), out.size());
    result.push_back(out.substr(at, end - at));
    at = end + 1;
  }
  return result;
}

Process::Process(const Arguments& arguments) {
  std::signal(SIGPIPE, SIG_IGN);
  std::array<int, 2> in{}, out{}, err{};
  if (::pipe2(in.data(), O_CLOEXEC) != 0 || ::pipe2(out.data(), O_CLOEXEC) != 0 ||
      ::pipe2(err.data(), O_CLOEXEC) != 0)
    throw std::runtime_error("pipe2 failed");
  std::vector<char*> argv{const_cast<char*>(TM485_CLI_PATH)};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  pid_ = ::fork();
  if (pid_ < 0) throw std::runtime_error("fork failed");
  if (pid_ == 0) {
    ::dup2(in[0], STDIN_FILENO);
    ::dup2(out[1], STDOUT_FILENO);
    ::dup2(err[1], STDERR_FILENO);
    std::signal(SIGPIPE, SIG_DFL);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  ::close(in[0]);
  ::close(out[1]);
  ::close(err[1]);
  in_ = in[1];
  out_ = out[0];
  err_ = err[0];
  ::fcntl(in_, F_SETFL, O_NONBLOCK);
}

Process::~Process() {
  if (pid_ > 0) {
    ::kill(pid_, SIGKILL);
    ::waitpid(pid_, nullptr, 0);
  }
  close_end(in_);
  close_end(out_);
  close_end(err_);
}

/// Moves bytes both ways once. False when there is nothing left to move.
bool Process::pump(int timeout_ms) {
  std::array<pollfd, 3> ends{
      {{unsent_.empty() ? -1 : in_, POLLOUT, 0}, {out_, POLLIN, 0}, {err_, POLLIN, 0}}};
  if (ends[0].fd < 0 && out_ < 0 && err_ < 0) return false;
  if (::poll(ends.data(), ends.size(), timeout_ms) <= 0) return true;
  if (ends[0].revents != 0) {
    const ssize_t count = ::write(in_, unsent_.data(), unsent_.size());
    if (count > 0)
      unsent_.erase(0, static_cast<std::size_t>(count));
    else if (errno != EAGAIN && errno != EINTR)
      unsent_.clear();
    if (unsent_.empty()) close_end(in_);
  }
  if (ends[1].revents != 0) drain(out_, result_.out);
  if (ends[2].revents != 0) drain(err_, result_.err);
  return true;
}

void Process::feed(const std::string& input, std::chrono::milliseconds bound) {
  unsent_ = input;
  if (unsent_.empty()) close_end(in_);
  const auto end = Clock::now() + bound;
  while (!unsent_.empty() && remaining_ms(end) > 0) pump(remaining_ms(end));
}

std::string Process::read_line(std::chrono::milliseconds bound) {
  const auto end = Clock::now() + bound;
  while (true) {
    if (const auto at = result_.out.find('\n', consumed_); at != std::string::npos) {
      std::string line = result_.out.substr(consumed_, at - consumed_);
      consumed_ = at + 1;
      return line;
    }
    if (remaining_ms(end) == 0 || !pump(remaining_ms(end)) || out_ < 0) return {};
  }
}

void Process::close_output() { close_end(out_); }

void Process::send_signal(int number) const {
  if (pid_ > 0) ::kill(pid_, number);
}

Finished Process::wait(std::chrono::milliseconds bound) {
  const auto end = Clock::now() + bound;
  if (unsent_.empty()) close_end(in_);
  while (pump(std::min(remaining_ms(end), 100))) {
    if (remaining_ms(end) == 0) {
      result_.timed_out = true;
      send_signal(SIGKILL);
      break;
    }
  }
  // Both streams are closed, so the end is near; but a command can also hang after closing them.
  int status = 0;
  while (::waitpid(pid_, &status, WNOHANG) == 0) {
    if (remaining_ms(end) == 0) {
      result_.timed_out = true;
      send_signal(SIGKILL);
    }
    ::usleep(1000);
  }
  pid_ = -1;
  if (WIFEXITED(status))
    result_.exit_code = WEXITSTATUS(status);
  else
    result_.signal = WTERMSIG(status);
  return result_;
}

Finished run(const Process::Arguments& arguments, const std::string& input) {
  Process process(arguments);
  process.feed(input);
  return process.wait();
}

TemporaryFolder::TemporaryFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "tm485_cli_XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw std::runtime_error("mkdtemp failed");
  path_ = name;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::string TemporaryFolder::write(const std::string& name, const std::string& text) const {
  std::ofstream(path(name), std::ios::binary) << text;
  return path(name);
}

}  // namespace tm485::test
