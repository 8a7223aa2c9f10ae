// What `monitor` shows: one moment of a session, compared with the one before.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "session.hpp"
#include "tm485/motion/sample.hpp"

namespace tm485::cli {

/// What is true at one moment. Rate and speed are those since the moment before.
struct Moment {
  Time now{0};
  BusState state = BusState::startup;
  std::optional<Sample> sample;     ///< the newest one that is not invalid
  std::optional<double> speed_rpm;  ///< of the motor; needs two positions
  double rate_hz = 0.0;             ///< good cycles
  std::optional<Problem> failure;   ///< why there is no encoder
  Statistics statistics;
};

class MomentMaker {
 public:
  /// Looks at the session. One owner: that of the session.
  [[nodiscard]] Moment make(Session& session);

 private:
  struct Position {
    std::int64_t counts;
    Time latch;
  };
  std::optional<Position> last_position_;
  std::uint32_t last_good_ = 0;
  Time last_time_{0};
};

/// A block of lines for a terminal.
[[nodiscard]] std::vector<std::string> monitor_block(Session& session, const Moment& moment);
/// One line, without its end.
[[nodiscard]] std::string monitor_line(Session& session, const Moment& moment);
[[nodiscard]] std::string monitor_json(Session& session, const Moment& moment);

}  // namespace tm485::cli
