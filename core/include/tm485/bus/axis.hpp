// Axis: a bus with all that a servo loop needs around it: estimator, validity, commands by ring.
//
// Two contexts. The bus's context (a real-time thread, a timer interrupt) owns the Axis and calls poll(); the servo
// loop's context owns client() and never waits for the other. Specification: sections 2 to 4.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdint>
#include <expected>
#include <optional>

#include "tm485/bus/axis_client.hpp"
#include "tm485/bus/axis_link.hpp"
#include "tm485/bus/bus.hpp"
#include "tm485/motion/estimator.hpp"
#include "tm485/motion/validity.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// What an axis does. Copied at construction.
struct AxisSetup {
  BusConfig bus;
  const EstimatorGains* gains = nullptr;  ///< must outlive the axis; null: no estimator
  InvalidCallback on_invalid;             ///< torque off; called in the bus's context
  Time statistics_every =
      std::chrono::milliseconds(1);  ///< how old statistics in other threads may be, up to an hour
};

template <Port P>
class Axis {
 public:
  /// `port` and `profile` must outlive the axis. Nothing is sent before start().
  Axis(P& port, const CompiledProfile& profile, const AxisSetup& setup) noexcept
      : bus_(port, profile, setup.bus),
        validity_(setup.on_invalid),
        statistics_every_(std::clamp(setup.statistics_every, Time{0}, Time{std::chrono::hours(1)})),
        max_hold_(setup.bus.max_hold),
        after_restart_(setup.bus.axis.after_restart),
        commands_(link_.commands),
        results_(link_.results),
        client_(link_) {
    if (setup.gains != nullptr) estimator_.emplace(*setup.gains);
  }
  Axis(P& port, const CompiledProfile&& profile, const AxisSetup& setup) = delete;
  Axis(const Axis&) = delete;
  Axis& operator=(const Axis&) = delete;

  /// As Bus::check and Bus::start.
  [[nodiscard]] std::expected<Feasibility, CycleRefusal> check() const noexcept { return bus_.check(); }
  [[nodiscard]] std::expected<void, CycleRefusal> start(Time now) noexcept;
  /// Sends nothing more; what the loop reads becomes invalid, commands end with bad_state.
  void stop(Time now) noexcept;

  /// Does what is due at `now`, takes commands and tells the loop; answers when to call again at the latest.
  /// Commands and ticks are seen whenever it is called, so a caller that sleeps should not sleep longer than they may
  /// wait. Bounded as Bus::poll, and by kAxisCommands.
  Time poll(Time now) noexcept;

  /// As Bus::reply_expected, for whoever polls many.
  [[nodiscard]] Time reply_expected() const noexcept { return bus_.reply_expected(); }

  /// The loop's side. Its context alone may use it.
  [[nodiscard]] AxisClient& client() noexcept { return client_; }
  [[nodiscard]] const AxisClient& client() const noexcept { return client_; }
  /// For the bus's own context: managers that offer exchanges, recorders. Its samples are the axis's.
  [[nodiscard]] Bus<P>& bus() noexcept { return bus_; }
  [[nodiscard]] const Bus<P>& bus() const noexcept { return bus_; }

 private:
  [[nodiscard]] bool take_commands(Time now) noexcept;
  void execute(const AxisLink::Posted& posted, Time now) noexcept;
  void offer_waiting() noexcept;
  void take_completions() noexcept;
  void answer(const AxisLink::Posted& posted, Errc error, const std::optional<Reply>& reply) noexcept;
  [[nodiscard]] Errc resume(Time now) noexcept;
  void see_sample(Time now) noexcept;
  void on_jump(const Sample& sample, Time now) noexcept;
  void on_sample(const Sample& sample, Time now) noexcept;
  void publish_changes(Time now) noexcept;

  Bus<P> bus_;
  AxisLink link_;
  std::optional<Estimator> estimator_;
  ValidityLatch validity_;
  Time statistics_every_;
  Time statistics_at_{0};
  Time max_hold_;
  Continuity after_restart_;
  std::uint32_t startups_ = 0;         ///< that have been seen
  std::uint32_t discontinuities_ = 0;  ///< likewise
  bool jumped_ = false;                ///< at one of them, and nobody has resumed since
  Time fresh_until_{0};
  Time valid_until_{0};
  std::uint32_t ticks_ = 0;
  std::uint32_t resumed_ = 0;
  std::uint32_t sequence_ = 0;  ///< of the sample that was seen last
  BusState state_ = BusState::stopped;
  bool newest_ = false;   ///< the newest position that the pattern should have brought is here
  bool changed_ = false;  ///< something but the sample
  SpscRing<AxisLink::Posted, kAxisCommands>::Consumer commands_;
  SpscRing<CommandResult, kAxisCommands>::Producer results_;
  std::array<AxisLink::Posted, kAxisCommands>
      waiting_;  ///< exchanges that the bus has not taken yet, oldest first
  std::uint32_t waiting_count_ = 0;
  std::array<std::optional<AxisLink::Posted>, kPriorities> offered_;  ///< what the bus has, by class
  std::uint32_t offered_count_ = 0;
  AxisClient client_;
};

}  // namespace tm485

#include "tm485/bus/axis_poll.hpp"  // IWYU pragma: export
