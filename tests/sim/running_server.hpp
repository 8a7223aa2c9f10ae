// A server that runs, its clients, and a folder for what it leaves: for the tests of the server.
#pragma once

#include <fcntl.h>
#include <gtest/gtest.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <thread>
#include <utility>

#include "ask.hpp"
#include "tm485/sim/server.hpp"

namespace tm485::sim {

namespace fs = std::filesystem;

inline constexpr int kPatienceMs = 5000;
inline constexpr int kSilenceMs = 100;
/// ID2 from an encoder at rest, CF SF ENID CRC.
inline const Bytes kId2Reply{0x92, 0x00, 0x11, 0x83};

class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string name = (fs::temp_directory_path() / "tm485-server-XXXXXX").string();
    path_ = ::mkdtemp(name.data());
  }
  ~TemporaryDirectory() { fs::remove_all(path_); }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  TemporaryDirectory& operator=(const TemporaryDirectory&) = delete;
  [[nodiscard]] std::string file(const char* name) const { return (path_ / name).string(); }

 private:
  fs::path path_;
};

/// Runs a server in a thread for as long as it lives.
class Running {
 public:
  explicit Running(Server server) : server_{std::move(server)} {
    thread_ = std::thread{[this] { EXPECT_TRUE(server_.serve(stop_).has_value()); }};
  }
  ~Running() { join(); }
  Running(const Running&) = delete;
  Running& operator=(const Running&) = delete;

  [[nodiscard]] const std::string& path() const { return server_.path(); }
  Server& join() {
    stop_ = true;
    if (thread_.joinable()) thread_.join();
    return server_;
  }

 private:
  Server server_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

class Client {
 public:
  explicit Client(int fd) : fd_{fd} { EXPECT_GE(fd, 0) << std::strerror(errno); }
  ~Client() { ::close(fd_); }
  Client(const Client&) = delete;
  Client& operator=(const Client&) = delete;

  static int terminal(const std::string& path) { return ::open(path.c_str(), O_RDWR | O_NOCTTY | O_CLOEXEC); }
  static int connected(const std::string& path) {
    const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    std::memcpy(address.sun_path, path.data(), path.size());
    if (::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0) return fd;
    ::close(fd);
    return -1;
  }

  void send(const Bytes& bytes) const {
    EXPECT_EQ(::write(fd_, bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  }

  /// Up to `count` bytes; fewer if none comes for `patience_ms`.
  [[nodiscard]] Bytes receive(std::size_t count, int patience_ms = kPatienceMs) const {
    Bytes bytes;
    while (bytes.size() < count) {
      pollfd waiting{.fd = fd_, .events = POLLIN, .revents = 0};
      if (::poll(&waiting, 1, patience_ms) <= 0) break;
      std::array<std::uint8_t, 64> part{};
      const ssize_t got = ::read(fd_, part.data(), std::min(part.size(), count - bytes.size()));
      if (got <= 0) break;
      bytes.insert(bytes.end(), part.begin(), part.begin() + got);
    }
    return bytes;
  }

 private:
  int fd_;
};

inline Server pty_server(const char* options = "", const std::string& link = {}) {
  auto server = Server::open_pty(parse_sim_options(options).value(), link);
  EXPECT_TRUE(server.has_value());
  return std::move(server.value());
}

inline Server unix_server(const std::string& path, const char* options = "") {
  auto server = Server::open_unix(parse_sim_options(options).value(), path);
  EXPECT_TRUE(server.has_value()) << server.error().what << server.error().reason;
  return std::move(server.value());
}

}  // namespace tm485::sim
