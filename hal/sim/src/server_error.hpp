// How the server's parts report what failed.
#pragma once

#include <cerrno>
#include <expected>
#include <string>
#include <system_error>
#include <utility>

#include "tm485/sim/server.hpp"

namespace tm485::sim {

/// A system call failed: call it before anything else changes errno.
inline std::unexpected<ServerError> failed(std::string what, std::string remedy) {
  const int code = errno;
  return std::unexpected{
      ServerError{std::move(what), std::system_category().message(code), std::move(remedy), code}};
}

/// The server itself will not do it.
inline std::unexpected<ServerError> refused(std::string what, std::string reason, std::string remedy) {
  return std::unexpected{ServerError{std::move(what), std::move(reason), std::move(remedy), 0}};
}

}  // namespace tm485::sim
