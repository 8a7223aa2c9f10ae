#include "endpoint.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <termios.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <string_view>

#include "server_error.hpp"

namespace tm485::sim {
namespace {

constexpr std::string_view kTerminalDirectory = "/dev/pts/";
constexpr std::size_t kLongestName = 4096;

/// Where a symbolic link points; empty if it is none.
std::string target_of(const std::string& link) {
  std::array<char, kLongestName> target{};
  const ssize_t length = ::readlink(link.c_str(), target.data(), target.size());
  return length > 0 ? std::string{target.data(), static_cast<std::size_t>(length)} : std::string{};
}

std::expected<sockaddr_un, ServerError> address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.empty() || path.size() >= sizeof address.sun_path) {
    return refused("opening the socket '" + path + "'",
                   "the path must have 1 to " + std::to_string(sizeof address.sun_path - 1) + " bytes",
                   "choose a shorter path, for example in /run/user or /tmp");
  }
  std::memcpy(address.sun_path, path.data(), path.size());
  return address;
}

bool would_block(int code) noexcept { return code == EAGAIN || code == EWOULDBLOCK || code == EINTR; }

}  // namespace

std::expected<std::unique_ptr<Endpoint>, ServerError> Endpoint::open_pty(const std::string& link_path) {
  std::unique_ptr<Endpoint> endpoint{new Endpoint};
  endpoint->terminal_fd_ = posix::FileDescriptor(::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC));
  const int master = endpoint->terminal_fd_.get();
  std::array<char, kLongestName> name{};
  if (master < 0 || ::grantpt(master) != 0 || ::unlockpt(master) != 0) {
    return failed("creating a pseudo-terminal", "check that /dev/pts is mounted and not exhausted");
  }
  if (const int code = ::ptsname_r(master, name.data(), name.size()); code != 0) {
    errno = code;
    return failed("naming the pseudo-terminal", "check that /dev/pts is mounted");
  }
  endpoint->terminal_ = name.data();
  endpoint->slave_fd_ = posix::FileDescriptor(::open(name.data(), O_RDWR | O_NOCTTY | O_CLOEXEC));
  termios settings{};
  const int slave = endpoint->slave_fd_.get();
  if (slave < 0 || ::tcgetattr(slave, &settings) != 0) {
    return failed("opening " + endpoint->terminal_, "check the permissions of /dev/pts");
  }
  ::cfmakeraw(&settings);
  if (::tcsetattr(slave, TCSANOW, &settings) != 0) {
    return failed("setting raw mode on " + endpoint->terminal_, "check that it is a terminal");
  }
  endpoint->path_ = endpoint->terminal_;
  if (!link_path.empty()) {
    if (auto linked = endpoint->link_to_terminal(link_path); !linked) return std::unexpected{linked.error()};
  }
  return endpoint;
}

std::expected<void, ServerError> Endpoint::link_to_terminal(const std::string& link_path) {
  const std::string what = "linking '" + link_path + "' to " + terminal_;
  struct stat status{};
  if (::lstat(link_path.c_str(), &status) == 0) {
    if (!S_ISLNK(status.st_mode) || !target_of(link_path).starts_with(kTerminalDirectory)) {
      return refused(what, "something exists there that is no link to a pseudo-terminal",
                     "choose another path or remove it");
    }
    // A server that was killed leaves its link behind, but not its terminal; ours may have got the same number.
    const std::string old = target_of(link_path);
    if (old != terminal_ && ::access(old.c_str(), F_OK) == 0) {
      return refused(what, "it leads to " + old + ", which somebody uses",
                     "stop that process, choose another path, or remove the link");
    }
    if (::unlink(link_path.c_str()) != 0) return failed(what, "remove the old link");
  }
  if (::symlink(terminal_.c_str(), link_path.c_str()) != 0) {
    return failed(what, "choose a path in a directory that exists and that you may write");
  }
  path_ = link_path;
  owns_path_ = true;
  return {};
}

std::expected<std::unique_ptr<Endpoint>, ServerError> Endpoint::open_unix(const std::string& path) {
  const auto address = address_of(path);
  if (!address) return std::unexpected{address.error()};
  const std::string what = "opening the socket '" + path + "'";
  struct stat status{};
  if (::lstat(path.c_str(), &status) == 0) {
    if (!S_ISSOCK(status.st_mode)) {
      return refused(what, "something exists there that is not a socket", "choose another path or remove it");
    }
    const posix::FileDescriptor probe{::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0)};
    if (::connect(probe.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) == 0 ||
        errno != ECONNREFUSED) {
      return refused(what, "another process serves it", "stop that process or choose another path");
    }
    if (::unlink(path.c_str()) != 0) return failed(what, "remove the old socket");
  }
  std::unique_ptr<Endpoint> endpoint{new Endpoint};
  if (auto bound = endpoint->bind_at(path); !bound) return std::unexpected{bound.error()};
  return endpoint;
}

std::expected<void, ServerError> Endpoint::bind_at(const std::string& path) {
  const std::string what = "opening the socket '" + path + "'";
  constexpr mode_t kOwnerOnly = S_IRUSR | S_IWUSR;
  constexpr int kBacklog = 4;
  const auto address = address_of(path);
  if (!address) return std::unexpected{address.error()};
  listener_ = posix::FileDescriptor(::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  // The mode of the unbound socket is that of the file from its first moment on (Linux); the second call,
  // on the file, is for systems that do not know that.
  if (!listener_.valid() || ::fchmod(listener_.get(), kOwnerOnly) != 0 ||
      ::bind(listener_.get(), reinterpret_cast<const sockaddr*>(&*address), sizeof *address) != 0) {
    return failed(what, "choose a path in a directory that exists and that you may write");
  }
  path_ = path;
  owns_path_ = true;
  struct stat status{};
  if (::lstat(path.c_str(), &status) == 0) {
    socket_device_ = status.st_dev;
    socket_inode_ = status.st_ino;
  }
  if (::chmod(path.c_str(), kOwnerOnly) != 0 || ::listen(listener_.get(), kBacklog) != 0) {
    return failed(what, "check the file system of the path");
  }
  return {};
}

Endpoint::~Endpoint() {
  if (!owns_path_) return;
  // Only what is still ours: another server may have taken the name meanwhile.
  if (!terminal_.empty()) {
    if (target_of(path_) == terminal_) ::unlink(path_.c_str());
    return;
  }
  struct stat status{};
  if (::lstat(path_.c_str(), &status) == 0 && status.st_dev == socket_device_ &&
      status.st_ino == socket_inode_) {
    ::unlink(path_.c_str());
  }
}

std::expected<std::size_t, ServerError> Endpoint::wait(std::span<std::uint8_t> buffer, int timeout_ms) {
  const bool is_socket = listener_.valid();
  const bool accepting = is_socket && !client_.valid();
  const int fd = accepting ? listener_.get() : is_socket ? client_.get() : terminal_fd_.get();
  pollfd waiting{.fd = fd, .events = POLLIN, .revents = 0};
  const int ready = ::poll(&waiting, 1, timeout_ms);
  if (ready == 0 || (ready < 0 && would_block(errno))) return std::size_t{0};
  if (ready < 0) return failed("waiting on " + path_, "restart the server");
  if (accepting) return accept_client();

  const ssize_t count = ::read(fd, buffer.data(), buffer.size());
  if (count > 0) return static_cast<std::size_t>(count);
  if (count < 0 && would_block(errno)) return std::size_t{0};
  if (is_socket) {
    client_.close();  // gone, in order or not: the next one is welcome
    return std::size_t{0};
  }
  if (count == 0) errno = EIO;
  return failed("reading " + path_, "restart the server");
}

std::expected<std::size_t, ServerError> Endpoint::accept_client() {
  client_ = posix::FileDescriptor(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK));
  if (client_.valid()) {
    ++clients_;
  } else if (!would_block(errno) && errno != ECONNABORTED && errno != EPROTO) {
    return failed("accepting a client on " + path_, "raise the limit of open files, or restart the server");
  }
  return std::size_t{0};
}

std::size_t Endpoint::write(std::span<const std::uint8_t> bytes) noexcept {
  std::size_t done = 0;
  while (done < bytes.size()) {
    const auto rest = bytes.subspan(done);
    const ssize_t count = listener_.valid()
                              ? ::send(client_.get(), rest.data(), rest.size(), MSG_NOSIGNAL | MSG_DONTWAIT)
                              : ::write(terminal_fd_.get(), rest.data(), rest.size());
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) break;
    done += static_cast<std::size_t>(count);
  }
  return done;
}

}  // namespace tm485::sim
