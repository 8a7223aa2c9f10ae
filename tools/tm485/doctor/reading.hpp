// What the bytes after a request are: a reply, an echo, an inverted signal, a reply whose beginning is spoilt, or
// nothing that anyone could read. Specification: sections 2 and 3.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "doctor/raw_line.hpp"
#include "tm485/protocol/frame.hpp"

namespace tm485::cli::doctor {

enum class Kind : std::uint8_t {
  silence,       ///< no byte
  reply,         ///< a frame of the ID that was asked for
  echo,          ///< the request itself and nothing else
  inverted,      ///< the request or a reply, every level inverted
  spoilt_start,  ///< the end of a reply, with something else before it
  garbage,       ///< none of these
};

struct Reading {
  Kind kind = Kind::silence;
  bool echoed = false;         ///< the request came back before what is read here
  std::optional<Frame> frame;  ///< kind reply
  std::optional<Time> t2;      ///< kind reply, with wire timestamps
  Time seen_after{0};          ///< kind reply: request's end until the host had the first byte
  Errc error = Errc::ok;       ///< why it is no reply, by the stack's own names
};

/// Reads what was heard after `request`. `timestamps`: those in `heard` are those of the wire.
[[nodiscard]] Reading read(const Heard& heard, const Request& request, bool timestamps);
/// The same on a port that is known to hear itself: as many bytes as the request has are its echo, whatever they are.
[[nodiscard]] Reading read_after_echo(const Heard& heard, const Request& request, bool timestamps);

/// What a UART reads when every level of `bytes` is inverted and the driver is on `lead` quarters of a bit before the
/// first start bit: mark becomes space, so the lead is taken for a start bit. Without what the last stop bit makes.
[[nodiscard]] std::vector<std::uint8_t> inverted(std::span<const std::uint8_t> bytes, unsigned lead);

}  // namespace tm485::cli::doctor
