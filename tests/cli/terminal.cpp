#include "cli/terminal.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/ioctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <csignal>
#include <cstdlib>
#include <stdexcept>

namespace tm485::test {

Finished run_at_terminal(const Process::Arguments& arguments, const std::string& prompt,
                         const std::string& answer) {
  const int person = ::posix_openpt(O_RDWR | O_NOCTTY | O_CLOEXEC);
  std::array<char, 128> name{};
  if (person < 0 || ::grantpt(person) != 0 || ::unlockpt(person) != 0 ||
      ::ptsname_r(person, name.data(), name.size()) != 0)
    throw std::runtime_error("no pseudo-terminal");
  std::vector<char*> argv{const_cast<char*>(TM485_CLI_PATH)};
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  const pid_t pid = ::fork();
  if (pid < 0) throw std::runtime_error("fork failed");
  if (pid == 0) {
    ::setsid();
    const int terminal = ::open(name.data(), O_RDWR);
    ::dup2(terminal, STDIN_FILENO);
    ::dup2(terminal, STDOUT_FILENO);
    ::dup2(terminal, STDERR_FILENO);
    ::execv(argv[0], argv.data());
    ::_exit(127);
  }
  Finished finished;
  bool answered = false;
  constexpr int kBoundMs = 60'000;
  while (true) {
    pollfd waiting{person, POLLIN, 0};
    if (::poll(&waiting, 1, kBoundMs) <= 0) {
      finished.timed_out = true;
      ::kill(pid, SIGKILL);
      break;
    }
    std::array<char, 4096> chunk;
    const ssize_t count = ::read(person, chunk.data(), chunk.size());
    if (count <= 0) break;  // EIO: the command has closed the terminal
    finished.out.append(chunk.data(), static_cast<std::size_t>(count));
    if (!answered && finished.out.find(prompt) != std::string::npos) {
      answered = true;
      const std::string line = answer + "\n";
      if (::write(person, line.data(), line.size()) < 0) break;
    }
  }
  int status = 0;
  ::waitpid(pid, &status, 0);
  ::close(person);
  if (WIFEXITED(status))
    finished.exit_code = WEXITSTATUS(status);
  else
    finished.signal = WTERMSIG(status);
  return finished;
}

}  // namespace tm485::test
