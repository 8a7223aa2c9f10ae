// What a bus hands back of a background exchange, made by hand.
#pragma once

#include "support/frames.hpp"
#include "tm485/bus/background.hpp"

namespace tm485::test {

/// Nothing that could be used.
inline Completion failed(const Request& request, Errc why = Errc::timeout) {
  return {request, std::unexpected(why), 0, std::nullopt};
}
/// A whole reply; `why` for one that says something else than was asked.
inline Completion heard(const Request& request, const Bytes& bytes, const CompiledProfile& profile,
                        Errc why = Errc::ok) {
  const auto reply = Reply::parse(bytes, request.id(), profile);
  if (!reply) return failed(request, reply.error());
  if (why != Errc::ok) return {request, std::unexpected(why), 0, *reply};
  return {request, *reply, 0, *reply};
}

}  // namespace tm485::test
