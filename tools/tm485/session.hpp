// Session: a bus on an opened port, driven by the real clock or in virtual time. What `info`, `read`, `monitor` and
// `bench` have in common.
#pragma once

#include <expected>
#include <memory>
#include <optional>
#include <string>

#include "any_port.hpp"
#include "commands.hpp"
#include "problem.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/linux/clock.hpp"
#include "tm485/linux/reopener.hpp"
#include "tm485/sim/virtual_clock.hpp"

namespace tm485::cli {

struct SessionOptions {
  PortOptions port;
  Cycle cycle;  ///< a period of 0: the shortest possible
  std::optional<Time>
      wished_period;  ///< with a cycle period of 0: this one, or a longer one if the port needs it
  Units units = Units::counts;
  std::int32_t max_speed_rpm = AxisConfig{}.max_speed_rpm;  ///< replaced by that of `port`, if it names one
  std::int32_t max_acceleration_rpm_s = AxisConfig{}.max_acceleration_rpm_s;  ///< likewise
  bool virtual_time = false;
  bool cyclic = true;  ///< false: no cycle, the bus is there for background exchanges only
};

/// One owner, one thread. Not movable: the bus points at its neighbours.
class Session {
 public:
  /// Opens the port, loads the profile, starts the bus. Problems: those of load_profile and AnyPort::open,
  /// period_below_t1 or period_below_port with the nearest possible period.
  [[nodiscard]] static std::expected<std::unique_ptr<Session>, Problem> open(const SessionOptions& options);

  /// The same on a port that is open. Of `options.port` only the profile, the speed and the echo count.
  [[nodiscard]] static std::expected<std::unique_ptr<Session>, Problem> on(AnyPort port,
                                                                           const SessionOptions& options);

  Session(const Session&) = delete;
  Session& operator=(const Session&) = delete;

  /// Does what is due and answers true if the bus has a new record; otherwise waits until something can have
  /// happened, at most until `limit` and not longer than 50 ms of real time.
  bool step(Time limit = kNever);

  /// Steps until start-up is through. The problem names its stage and cause; also if the port has vanished, or
  /// if Ctrl-C came first (name "stopped", nothing to report).
  [[nodiscard]] std::expected<void, Problem> wait_for_startup();

  /// Brings a port back that was unplugged, and says so on standard error unless `quiet`: to be called between two steps. True while
  /// the port is gone, and from its return on until start-up is through: failure() is no news then.
  bool tend_port(bool quiet = false);
  /// How often the port has come back.
  [[nodiscard]] std::uint32_t port_returns() const noexcept { return reopener_.times(); }

  /// Start-up has failed since it was last through, or the port has vanished: what and why.
  [[nodiscard]] std::optional<Problem> failure() const;

  [[nodiscard]] Time now() const noexcept { return virtual_time_ ? virtual_clock_.now() : clock_.now(); }
  [[nodiscard]] bool virtual_time() const noexcept { return virtual_time_; }
  /// "real time" or "virtual time".
  [[nodiscard]] std::string_view clock_name() const noexcept {
    return virtual_time_ ? "virtual time" : "real time";
  }
  [[nodiscard]] Bus<AnyPort>& bus() noexcept { return *bus_; }
  [[nodiscard]] AnyPort& port() noexcept { return port_; }
  [[nodiscard]] const PortCapability& capability() const noexcept { return capability_; }
  [[nodiscard]] const CompiledProfile& profile() const noexcept { return profile_; }
  [[nodiscard]] const AxisConfig& axis() const noexcept { return axis_; }
  /// Id and period, as the scheduler holds them. Only with a cycle.
  [[nodiscard]] const Scheduler& scheduler() const noexcept { return *bus_->scheduler(); }
  /// Records that step() could not show, because two were made at once.
  [[nodiscard]] std::uint32_t unseen_records() const noexcept { return unseen_; }

 private:
  [[nodiscard]] static std::expected<std::unique_ptr<Session>, Problem> begin(AnyPort port,
                                                                              const CompiledProfile& profile,
                                                                              const SessionOptions& options);
  Session(AnyPort port, const CompiledProfile& profile, const SessionOptions& options);
  void wait(Time until, Time at);

  AnyPort port_;
  PortCapability capability_;
  CompiledProfile profile_;
  AxisConfig axis_;
  bool virtual_time_;
  bool in_flight_ = false;
  Time sent_at_{0};
  std::uint32_t unseen_ = 0;
  bool returning_ = false;
  linux_hal::Reopener reopener_;
  linux_hal::MonotonicClock clock_;
  sim::VirtualClock virtual_clock_;
  std::optional<Bus<AnyPort>> bus_;
};

}  // namespace tm485::cli
