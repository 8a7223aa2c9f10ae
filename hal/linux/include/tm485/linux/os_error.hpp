// OsError: why a port could not be opened, with the system's own error number and what to do about it.
//
// Set-up only: it holds strings. A port in use reports an Errc and keeps its last errno.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "tm485/errc.hpp"

namespace tm485::linux_hal {

/// What was to be opened; the same errno has another remedy for each.
enum class Resource : std::uint8_t { serial_port, unix_socket, mapped_uart, gpio_line, rs485_mode };

struct OsError {
  Errc code = Errc::ok;  ///< port_gone: no such device or server; bad_argument: it cannot be used like this
  int error_number = 0;  ///< errno; 0 if the system reported none (a refused rate)
  std::string what;      ///< path, operation and the system's text
  std::string remedy;    ///< plain words
  std::string_view name =
      {};  ///< rate_refused, chip_unfit, another_device; empty: the errno says it. Static storage

  /// One line for people: what, then the remedy.
  [[nodiscard]] std::string message() const { return what + "; " + remedy; }
};

/// What to do about an errno. Never empty; static storage. Any thread.
[[nodiscard]] std::string_view remedy_for(Resource resource, int error_number) noexcept;

/// The error of `operation` on `path`. ENOENT, ENODEV and ENXIO are port_gone, anything else bad_argument.
/// Any thread; allocates.
[[nodiscard]] OsError make_os_error(Resource resource, std::string_view path, std::string_view operation,
                                    int error_number);

}  // namespace tm485::linux_hal
