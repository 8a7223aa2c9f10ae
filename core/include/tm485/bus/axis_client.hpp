// AxisClient: what a servo loop touches. Everything here is wait-free, allocates nothing and calls no bus.
//
//   const LoopState now = client.read(t);      // validity, sample
//   const Estimate shaft = client.estimate_at(t);
//   const auto ticket = client.post(Command::exchange(request));
//   while (const auto result = client.poll_completion()) ...
//
// One context owns a client: the servo loop's thread, or its interrupt. statistics() is the exception.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>

#include "tm485/bus/axis_link.hpp"
#include "tm485/errc.hpp"
#include "tm485/motion/estimator.hpp"
#include "tm485/motion/sample.hpp"
#include "tm485/motion/validity.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// What the loop is told.
struct LoopState {
  SampleValidity validity = SampleValidity::invalid;
  const Sample* sample = nullptr;  ///< never null; good until the next read()

  [[nodiscard]] bool usable() const noexcept { return validity != SampleValidity::invalid; }
};

/// One owner. Every function: constant time.
///
/// Validity can be lost before the loop reads for the first time, on a machine that stalls: a loop that starts looks at
/// view().latched, and posts resume if it means to go on.
class AxisClient {
 public:
  /// `link` must outlive the client and have no other.
  explicit AxisClient(AxisLink& link) noexcept
      : link_(&link), commands_(link.commands), results_(link.results), view_(&link.view.get()) {}
  AxisClient(const AxisClient&) = delete;
  AxisClient& operator=(const AxisClient&) = delete;

  /// The newest sample, and whether it may be used at `now`. Judged here as well as in the bus's context, so a bus
  /// that has stopped being polled makes the data invalid too; this is latched here, until a resume command.
  LoopState read(Time now) noexcept;

  /// The newest sample as it is. Does not judge.
  const Sample& latest() noexcept {
    view_ = &link_->view.get();
    return view_->sample;
  }

  /// What the shaft does at `time`, from the samples up to the last read() or latest(). state `empty` if the axis
  /// has no estimator or there was no sample.
  [[nodiscard]] Estimate estimate_at(Time time) const noexcept {
    if (view_->estimator) return view_->estimator->at(time);
    Estimate none;
    none.time = time;
    return none;
  }

  /// The view that the last read() or latest() took: bus state, start-up stage, latch.
  [[nodiscard]] const AxisView& view() const noexcept { return *view_; }

  /// Sends a command to the bus. Answers its ticket; busy if kAxisCommands are under way (take completions first).
  [[nodiscard]] std::expected<std::uint32_t, Errc> post(const Command& command) noexcept;

  /// The result of a command, once; each ticket comes back exactly once, not always in the order of posting.
  [[nodiscard]] std::optional<CommandResult> poll_completion() noexcept;

  /// Commands whose result was not taken yet.
  [[nodiscard]] std::uint32_t under_way() const noexcept { return under_way_; }

  /// The servo clock ticked at `tick` (BusConfig::phase). Only the newest tick counts.
  void servo_tick(Time tick) noexcept { link_->tick.put({tick, ++ticks_, 0}); }

  /// Statistics as of the last publication (AxisSetup::statistics_every). Any thread. False if the bus was writing
  /// them each time that they were looked at: ask again later.
  [[nodiscard]] bool statistics(Statistics& statistics) const noexcept {
    return link_->statistics.try_get(statistics);
  }

 private:
  AxisLink* link_;
  SpscRing<AxisLink::Posted, kAxisCommands>::Producer commands_;
  SpscRing<CommandResult, kAxisCommands>::Consumer results_;
  const AxisView* view_;
  std::uint32_t next_ticket_ = 1;
  std::uint32_t under_way_ = 0;
  std::uint32_t ticks_ = 0;
  std::uint32_t silent_since_resume_ = 0;  ///< AxisView::resumed when the bus was found silent
  bool silent_ = false;
  bool was_valid_ = false;
};

}  // namespace tm485
