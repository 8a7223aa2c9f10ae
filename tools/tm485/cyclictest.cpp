#include "cyclictest.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <charconv>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <system_error>

#include "stop_signal.hpp"
#include "tm485/linux/clock.hpp"
#include "tm485/posix/file_descriptor.hpp"

namespace tm485::cli {
namespace {

constexpr std::int64_t kHistogramUs = 20'000;
constexpr const char* kRemedy =
    "it needs the right to real-time priorities (see rtprio); by hand: sudo cyclictest -m -p80 -i1000 -D2 -q";

Problem failed(std::string cause) { return {"cyclictest_failed", std::move(cause), kRemedy, kExitFailure}; }

/// The beginning of what it said.
std::string one_line(std::string_view text) {
  constexpr std::size_t kMost = 300;
  std::string line(text.substr(0, kMost));
  std::replace(line.begin(), line.end(), '\n', ' ');
  line.erase(line.find_last_not_of(' ') + 1);
  return line;
}

/// Numbers at the front of a text, with blanks between them.
std::vector<std::uint64_t> numbers(std::string_view text, std::size_t most) {
  std::vector<std::uint64_t> result;
  while (result.size() < most) {
    text.remove_prefix(std::min(text.find_first_not_of(" \t"), text.size()));
    std::uint64_t value = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{}) break;
    result.push_back(value);
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  }
  return result;
}

/// Both its outputs come through `pipe`; it gets no signal mask of ours.
std::expected<pid_t, Problem> spawn(const std::string& path, const std::vector<std::string>& arguments,
                                    int pipe) {
  std::vector<char*> argv;
  argv.reserve(arguments.size() + 1);
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, pipe, STDOUT_FILENO);
  posix_spawn_file_actions_adddup2(&actions, pipe, STDERR_FILENO);
  pid_t child = -1;
  const int error = posix_spawn(&child, path.c_str(), &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return std::unexpected(failed(path + ": " + std::generic_category().message(error)));
  return child;
}

/// Reads until the other end is closed, the time is over or the user stops. True in the first case.
bool read_all(int fd, Time bound, std::string& text) {
  const linux_hal::MonotonicClock clock;
  std::array<char, 4096> buffer{};
  while (!stop_requested() && clock.now() < bound) {
    pollfd waiting{fd, POLLIN, 0};
    constexpr int kLookMs = 100;
    if (poll(&waiting, 1, kLookMs) <= 0) continue;
    const ssize_t got = read(fd, buffer.data(), buffer.size());
    if (got == 0) return true;
    if (got > 0)
      text.append(buffer.data(), static_cast<std::size_t>(got));
    else if (errno != EINTR)
      return false;
  }
  return false;
}

}  // namespace

void CyclictestResult::add(std::uint64_t us, std::uint64_t count) {
  if (count == 0) return;
  bins_.push_back({us, count});
  count_ += count;
}

Time CyclictestResult::minimum() const noexcept {
  return bins_.empty() ? maximum() : Time{static_cast<std::int64_t>(bins_.front().us) * 1'000};
}

Time CyclictestResult::percentile(double fraction) const noexcept {
  const auto rank = static_cast<std::uint64_t>(fraction * static_cast<double>(count()));
  std::uint64_t below = 0;
  for (const Bin& bin : bins_) {
    below += bin.count;
    if (below > rank) return Time{static_cast<std::int64_t>(bin.us) * 1'000};
  }
  return maximum();
}

std::expected<CyclictestResult, Problem> parse_cyclictest(std::string_view text) {
  CyclictestResult result;
  const std::string_view all = text;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(line.size() + 1, text.size()));
    constexpr std::string_view kMaximum = "# Max Latencies:";
    constexpr std::string_view kOverflows = "# Histogram Overflows:";
    if (line.starts_with(kMaximum)) {
      if (const auto found = numbers(line.substr(kMaximum.size()), 1); !found.empty())
        result.set_maximum(found[0]);
    } else if (line.starts_with(kOverflows)) {
      if (const auto found = numbers(line.substr(kOverflows.size()), 1); !found.empty())
        result.set_overflows(found[0]);
    } else if (const auto bin = numbers(line, 2); bin.size() == 2) {
      result.add(bin[0], bin[1]);
    }
  }
  if (result.count() == 0) return std::unexpected(failed("it printed no histogram: " + one_line(all)));
  return result;
}

std::string find_cyclictest() {
  const char* const path = std::getenv("PATH");
  std::string_view rest = path == nullptr ? "" : path;
  while (!rest.empty()) {
    const std::string_view folder = rest.substr(0, rest.find(':'));
    rest.remove_prefix(std::min(folder.size() + 1, rest.size()));
    if (folder.empty()) continue;
    const std::string candidate = std::string(folder) + "/cyclictest";
    if (access(candidate.c_str(), X_OK) == 0) return candidate;
  }
  return {};
}

std::expected<CyclictestResult, Problem> run_cyclictest(const std::string& path,
                                                        const CyclictestOptions& options) {
  using std::chrono::seconds;
  const std::int64_t whole_seconds =
      std::max<std::int64_t>(1, std::chrono::ceil<seconds>(options.duration).count());
  const std::int64_t us = std::max<std::int64_t>(1, options.period.count() / 1'000);
  std::vector<std::string> arguments{path,
                                     "-q",
                                     "-m",
                                     "-t1",
                                     fmt::format("-h{}", kHistogramUs),
                                     fmt::format("-i{}", us),
                                     fmt::format("-D{}", whole_seconds)};
  if (options.priority > 0) arguments.push_back(fmt::format("-p{}", options.priority));
  if (options.cpu >= 0) arguments.push_back(fmt::format("-a{}", options.cpu));

  std::array<int, 2> ends{-1, -1};
  if (pipe2(ends.data(), O_CLOEXEC) != 0)
    return std::unexpected(failed("no pipe: " + std::generic_category().message(errno)));
  const posix::FileDescriptor reading(ends[0]);
  posix::FileDescriptor writing(ends[1]);
  const auto child = spawn(path, arguments, writing.get());
  if (!child) return std::unexpected(child.error());
  writing.close();
  std::string text;
  const bool ended = read_all(reading.get(), seconds(whole_seconds + 10), text);
  if (!ended) kill(*child, SIGKILL);
  int status = 0;
  while (waitpid(*child, &status, 0) < 0 && errno == EINTR) {
  }
  if (!ended) return std::unexpected(failed(stop_requested() ? "it was stopped" : "it did not end in time"));
  if (!WIFEXITED(status) || WEXITSTATUS(status) != 0)
    return std::unexpected(failed("it failed: " + one_line(text)));
  return parse_cyclictest(text);
}

}  // namespace tm485::cli
