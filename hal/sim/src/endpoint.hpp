// What a client connects to: the file descriptors and file names of a pseudo-terminal or a unix socket.
#pragma once

#include <sys/types.h>

#include <cstddef>
#include <cstdint>
#include <expected>
#include <memory>
#include <span>
#include <string>

#include "tm485/posix/file_descriptor.hpp"
#include "tm485/sim/server.hpp"

namespace tm485::sim {

/// Nothing here blocks, except as `wait` says.
class Endpoint {
 public:
  static std::expected<std::unique_ptr<Endpoint>, ServerError> open_pty(const std::string& link_path);
  static std::expected<std::unique_ptr<Endpoint>, ServerError> open_unix(const std::string& path);

  Endpoint(const Endpoint&) = delete;
  Endpoint& operator=(const Endpoint&) = delete;
  ~Endpoint();

  [[nodiscard]] const std::string& path() const noexcept { return path_; }

  /// Waits for bytes or for a client, at most `timeout_ms`, and reads what is there. 0: nothing came, or a
  /// client came or went. An error: this endpoint will never work again.
  [[nodiscard]] std::expected<std::size_t, ServerError> wait(std::span<std::uint8_t> buffer, int timeout_ms);

  /// Writes what fits and returns how much that was.
  std::size_t write(std::span<const std::uint8_t> bytes) noexcept;

  [[nodiscard]] std::uint64_t clients() const noexcept { return clients_; }

 private:
  Endpoint() noexcept = default;

  std::expected<void, ServerError> link_to_terminal(const std::string& link_path);
  [[nodiscard]] std::expected<std::size_t, ServerError> accept_client();
  std::expected<void, ServerError> bind_at(const std::string& path);

  std::string path_;
  std::string terminal_;    // name of the terminal's slave side
  bool owns_path_ = false;  // a link or a socket to remove at the end
  dev_t socket_device_ = 0;
  ino_t socket_inode_ = 0;
  posix::FileDescriptor
      terminal_fd_;  // our side; the other is kept open so that a client's close is no hang-up
  posix::FileDescriptor slave_fd_;
  posix::FileDescriptor listener_;
  posix::FileDescriptor client_;
  std::uint64_t clients_ = 0;
};

}  // namespace tm485::sim
