// One reply of an encoder on a session that runs without a cycle.
#pragma once

#include <expected>

#include "problem.hpp"
#include "session.hpp"
#include "tm485/protocol/frame.hpp"

namespace tm485::cli {

/// Asks for a data ID 0..3 until a good reply comes, some ten times. Start-up is through. Problem: that of the last try,
/// of a vanished port, or "stopped" after Ctrl-C; exit code 1.
[[nodiscard]] std::expected<Reply, Problem> ask_encoder(Session& session, DataId id);

}  // namespace tm485::cli
