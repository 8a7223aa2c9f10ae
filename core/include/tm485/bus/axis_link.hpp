// AxisLink: what lies between the bus's context and the servo loop's, and nothing else.
//
// The bus side writes a view of the axis (sample, validity, estimator) and completions; the loop's side posts
// commands and servo ticks. Wait-free in both directions, no lock, no heap. docs/concurrency.md has the parts.
#pragma once

#include <cstdint>
#include <optional>

#include "tm485/bus/link_health.hpp"
#include "tm485/bus/startup.hpp"
#include "tm485/bus/statistics.hpp"
#include "tm485/errc.hpp"
#include "tm485/motion/estimator.hpp"
#include "tm485/motion/sample.hpp"
#include "tm485/motion/validity.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/request.hpp"
#include "tm485/protocol/status.hpp"
#include "tm485/sync/latest_value.hpp"
#include "tm485/sync/shared_latest.hpp"
#include "tm485/sync/spsc_ring.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// What the loop can ask of the bus.
struct Command {
  enum class Kind : std::uint8_t {
    exchange,        ///< `request`, in the background of the cycle
    resume,          ///< leave the latched invalid state; bad_state while no good sample comes
    set_referenced,  ///< the axis was homed; bad_state during start-up
    unreference,     ///< the axis is no longer homed; bad_state during start-up
    restart,         ///< the encoder was restarted: begin with start-up again
  };
  Kind kind = Kind::exchange;
  Request request = *Request::make(DataId::encoder_id);

  [[nodiscard]] static constexpr Command exchange(const Request& request) noexcept {
    return {Kind::exchange, request};
  }
  [[nodiscard]] static constexpr Command of(Kind kind) noexcept {
    return {kind, *Request::make(DataId::encoder_id)};
  }
};

/// How a command ended. Each posted command has exactly one.
struct CommandResult {
  std::uint32_t ticket = 0;  ///< as answered by post()
  Command command;
  Errc error = Errc::ok;
  std::optional<Reply> reply;  ///< of an exchange that went well
};

/// The axis as the bus's context last saw it. One copy crosses at a time.
struct AxisView {
  Sample sample;
  std::optional<Estimator> estimator;  ///< none: AxisConfig without gains
  Time fresh_until{0};                 ///< later the next sample is overdue
  Time valid_until{0};                 ///< later even the extrapolated one is too old
  std::uint32_t resumed = 0;           ///< counts resume commands
  bool newest = false;                 ///< the newest position that the pattern should have brought is here
  bool valid = false;                  ///< false: no sample yet, or invalid is latched
  bool latched = false;
  BusState state = BusState::stopped;
  StartupStage stage = StartupStage::quiet;
  LinkState link = LinkState::lost;     ///< how good the line is
  AlarmLevel alarm = AlarmLevel::none;  ///< of `alarms`, by the profile's policy
  StatusSet alarms;                     ///< status bits since the last verified reset (AlarmMonitor::latched)
  Errc startup_cause = Errc::ok;        ///< why the last start-up sequence failed
};

/// How many commands may be under way.
inline constexpr std::uint32_t kAxisCommands = 8;

/// The storage that both sides share.
struct AxisLink {
  struct Posted {
    std::uint32_t ticket = 0;
    Command command;
  };
  struct Tick {
    Time at{0};
    std::uint32_t count = 0;
    std::uint32_t spare = 0;
  };

  LatestValue<AxisView> view;
  LatestValue<Tick> tick;
  SpscRing<Posted, kAxisCommands> commands;
  SpscRing<CommandResult, kAxisCommands> results;
  SharedLatest<Statistics> statistics;
};

}  // namespace tm485
