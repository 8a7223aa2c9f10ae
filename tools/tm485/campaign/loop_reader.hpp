// LoopReader: the servo loop of a run with an axis: it reads once a period, lets go, takes hold again by command, asks for
// exchanges, and judges what it is told. docs/servo-loop.md is what it holds the axis to.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>

#include "campaign/dice.hpp"
#include "campaign/judge.hpp"
#include "campaign/run_setup.hpp"
#include "campaign/servo_watch.hpp"
#include "tm485/bus/axis.hpp"
#include "tm485/sim/simulated_encoder.hpp"

namespace tm485::cli::campaign {

/// One owner. Nothing allocates.
class LoopReader {
 public:
  LoopReader(const RunSetup& setup, sim::SimulatedEncoder& encoder, Time max_hold) noexcept
      : encoder_(&encoder),
        dice_(setup.seed + setup.run + 17),
        after_restart_(setup.after_restart),
        longest_write_(setup.writes_hold_the_line() ? kLongestWrite : Time{0}),
        alone_(setup.background == Background::none && setup.latency == Time{0} && setup.keeps_every_slot()),
        period_(setup.servo ? setup.servo->clock.period : setup.cycle_time()),
        ticks_(setup),
        estimates_(setup, encoder),
        fresh_bound_(setup.time_of_positions(1) + kLongestExchange + setup.latency),
        in_flight_(kLongestExchange + setup.latency),
        max_hold_(max_hold),
        next_(period_),
        power_ups_(encoder.model().statistics().power_ups) {}

  /// What the axis calls when the drive has to let go; `context` is a LoopReader.
  static void torque_off(void* context, Time /*now*/) noexcept {
    ++static_cast<LoopReader*>(context)->told_to_let_go_;
  }

  /// When it reads next.
  [[nodiscard]] Time due() const noexcept { return next_; }

  /// After a poll of the axis at `now`, which is not before due(). False: a rule is broken.
  template <class A>
  [[nodiscard]] bool on_tick(A& axis, Judge& judge, Time now) noexcept {
    next_ = ticks_.after(now);
    ticks_.tick(axis, now);
    AxisClient& client = axis.client();
    const Sample& newest = axis.bus().latest();
    note(newest, now);
    if (!take_results(client, judge, now)) return false;
    if (newest.quality() == Quality::invalid) homed_ = false;
    const LoopState state = client.read(now);
    ++judge.totals().loop_reads;
    const std::uint32_t losses = axis.bus().statistics().startups + axis.bus().statistics().invalidated;
    const bool ok =
        state.usable() ? on_usable(state, newest, judge, now) : on_invalid(newest, losses, judge, now);
    if (!ok) return false;
    if (state.usable() && !estimates_.on_usable(axis, newest, judge, now)) return false;
    if (newest.quality() == Quality::fresh && !ticks_.on_fresh(axis, newest, judge, now)) return false;
    steps_seen_ = newest.discontinuities();
    losses_seen_ = losses;
    return ask(client, newest, judge, now);
  }

  /// After the axis was stopped: every command has ended.
  template <class A>
  [[nodiscard]] bool at_end(A& axis, Judge& judge, Time now) noexcept {
    if (!take_results(axis.client(), judge, now)) return false;
    const auto open = std::ranges::count_if(open_, [](const Open& o) { return o.ticket != 0; });
    return open == 0 || judge.fail(Rule::command, now, open, 0, "commands have never ended");
  }

 private:
  static constexpr Time kLongestExchange{60'000};
  static constexpr Time kLongestWrite{18'000'000};
  struct Open {
    std::uint32_t ticket = 0;  // 0: free
    Command command;
    Time posted{0};
    bool referenced = false;  // the sample was, when it was posted
  };

  /// What has become of encoder and bus since the last tick.
  void note(const Sample& newest, Time now) noexcept {
    if (const std::uint64_t ups = encoder_->model().statistics().power_ups; ups != power_ups_) {
      power_ups_ = ups;
      powered_at_ = now;
    }
    referenced_ = newest.referenced();
    homed_ = homed_ || referenced_;
    if (newest.quality() != Quality::fresh) {
      fresh_since_ = kNever;
    } else if (fresh_since_ == kNever) {
      fresh_since_ = now;
    }
  }

  [[nodiscard]] bool on_usable(const LoopState& state, const Sample& newest, Judge& judge,
                               Time now) noexcept {
    const Sample& sample = *state.sample;
    if (sample.quality() == Quality::invalid || !sample.has_position())
      return judge.fail(Rule::axis, now, 0, 1, "usable without a position");
    const Time age = sample.age(now);
    const bool fresh = state.validity == SampleValidity::fresh;
    // A hold that was announced does not count, however the exchanges behind it end.
    if (sample.latch_time() != latch_) announced_ = Time{0};
    latch_ = sample.latch_time();
    announced_ = std::max(announced_, sample.announced_hold());
    const Time bound = fresh_bound_ + (fresh ? Time{0} : max_hold_ + announced_);
    if (age > bound)
      return judge.fail(Rule::axis, now, age.count(), bound.count(), "usable, and older than allowed");
    // What the judge knows of the bus's sample holds for this one: it is the same.
    if (sample.sequence() != newest.sequence() || sample.position() != newest.position() ||
        sample.latch_time() != newest.latch_time())
      return judge.fail(Rule::axis, now, sample.sequence(), newest.sequence(),
                        "another sample than the bus's");
    const bool carries = after_restart_ == Continuity::re_reference;
    if (!holds_) {
      if (was_held_ && !resumed_ && !(carries && restarted_since_let_go(sample)))
        return judge.fail(Rule::axis, now, 1, 0, "usable again without a command");
      take_hold(sample, judge);
    }
    if (sample.discontinuities() != steps_)
      return judge.fail(Rule::axis, now, sample.discontinuities(), steps_, "held on through a discontinuity");
    if (power_ups_ != held_power_ups_ && sample.latch_time() > powered_at_) {
      if (!carries)
        return judge.fail(Rule::axis, now, static_cast<std::int64_t>(power_ups_),
                          static_cast<std::int64_t>(held_power_ups_), "held on through a restart");
      held_power_ups_ = power_ups_;
    }
    // A start-up can be over between two ticks. Where it resumes by itself the loop has then seen nothing of it.
    if (carries && told_to_let_go_ > let_go_) take_hold(sample, judge);
    if (told_to_let_go_ > let_go_)
      return judge.fail(Rule::axis, now, told_to_let_go_, let_go_, "usable after the torque was taken away");
    return true;
  }

  [[nodiscard]] bool restarted_since_let_go(const Sample& sample) const noexcept {
    return sample.latch_time() > let_go_at_ - in_flight_;  // it may have been under way then
  }

  void take_hold(const Sample& sample, Judge& judge) noexcept {
    if (was_held_) ++judge.totals().resumed;
    holds_ = was_held_ = true;
    resumed_ = false;
    steps_ = sample.discontinuities();
    held_power_ups_ = power_ups_;
    let_go_ = told_to_let_go_;
  }

  [[nodiscard]] bool on_invalid(const Sample& newest, std::uint32_t losses, Judge& judge, Time now) noexcept {
    // A start-up may have come behind it, or samples too old, and gone again, or a step.
    const bool again = newest.quality() == Quality::invalid || losses != losses_seen_ ||
                       newest.discontinuities() != steps_seen_;
    if (resumed_ && resumed_at_ == now && !again)
      return judge.fail(Rule::axis, now, 0, 1, "not usable although it was resumed");
    if (!holds_) return true;
    holds_ = false;
    resumed_ = false;
    let_go_at_ = now;
    ++judge.totals().let_go;
    return told_to_let_go_ > let_go_ || judge.fail(Rule::axis, now, told_to_let_go_, let_go_ + 1,
                                                   "invalid, and nobody took the torque away");
  }

  /// Now and then a command: hold again, home, or an exchange.
  [[nodiscard]] bool ask(AxisClient& client, const Sample& newest, Judge& judge, Time now) noexcept {
    if (dice_.below(kSeldom) != 0) return true;
    if (!holds_ && was_held_) {
      const bool home =
          after_restart_ != Continuity::until_resumed && !newest.referenced() && dice_.once_in(2);
      return post(client, Command::of(home ? Command::Kind::set_referenced : Command::Kind::resume), judge,
                  now);
    }
    if (!dice_.once_in(4)) return true;
    if (dice_.once_in(50)) return post(client, Command::of(Command::Kind::restart), judge, now);
    return post(client, Command::exchange(*Request::make(DataId::encoder_id)), judge, now);
  }

  [[nodiscard]] bool post(AxisClient& client, const Command& command, Judge& judge, Time now) noexcept {
    const auto place = std::ranges::find_if(open_, [](const Open& o) { return o.ticket == 0; });
    const auto ticket = client.post(command);
    if (!ticket)
      return place == open_.end() ||
             judge.fail(Rule::command, now, 1, 0, "a command was refused though there is room");
    if (place == open_.end())
      return judge.fail(Rule::command, now, kAxisCommands + 1, kAxisCommands,
                        "more commands than there is room for");
    *place = {*ticket, command, now, referenced_};
    if (command.kind == Command::Kind::set_referenced) {
      homed_ = true;
      judge.on_homed();
    }
    ++judge.totals().commands;
    return true;
  }

  [[nodiscard]] bool take_results(AxisClient& client, Judge& judge, Time now) noexcept {
    while (const auto result = client.poll_completion()) {
      const auto place =
          std::ranges::find_if(open_, [&](const Open& o) { return o.ticket == result->ticket; });
      if (place == open_.end())
        return judge.fail(Rule::command, now, result->ticket, 0, "an answer to a command that is not open");
      const Open open = *place;
      place->ticket = 0;
      if (!on_result(*result, open, judge, now)) return false;
    }
    return true;
  }

  [[nodiscard]] bool on_result(const CommandResult& result, const Open& open, Judge& judge,
                               Time now) noexcept {
    const bool good = result.error == Errc::ok;
    if (open.command.kind == Command::Kind::exchange) {
      if (result.reply.has_value() != good)
        return judge.fail(Rule::command, now, 0, 1, "success without a reply, or a reply without success");
      if (!good) return true;
      const bool own = result.reply->frame().id() == open.command.request.id();
      const bool changed = judge.effects().last_change >= open.posted;
      if (own && (changed || result.reply->frame().enid() == encoder_->model().config().enid)) return true;
      return judge.fail(Rule::command, now, result.reply->frame().enid(), encoder_->model().config().enid,
                        "the reply is not that of the request");
    }
    // A write that it cut off keeps its T1, whether the encoder has heard it or not.
    if (open.command.kind == Command::Kind::restart) judge.pause(now + longest_write_);
    if (open.command.kind != Command::Kind::resume) return true;
    if (good) {
      resumed_ = true;
      resumed_at_ = now;
      return after_restart_ != Continuity::until_homed || homed_ ||
             judge.fail(Rule::axis, now, 0, 1, "taken hold before it was homed");
    }
    // A good line since it was asked, and nothing that takes slots between two ticks, stands against it. What a fault does to
    // one cycle shows until the reply of the next.
    const bool may = after_restart_ != Continuity::until_homed || open.referenced;
    return !may || !alone_ || fresh_since_ > open.posted ||
           judge.effects().last + period_ + in_flight_ >= open.posted ||
           judge.fail(Rule::axis, now, 0, 1, "resume was refused although samples are fresh");
  }

  static constexpr std::int64_t kSeldom = 16;

  sim::SimulatedEncoder* encoder_;
  Dice dice_;
  Continuity after_restart_;
  Time longest_write_;
  bool alone_;  // nothing in the background or in the port delays a cycle that has no fault
  Time period_;
  ServoTicks ticks_;
  EstimateWatch estimates_;
  Time fresh_bound_;
  Time in_flight_;
  Time max_hold_;
  Time next_;
  std::array<Open, kAxisCommands> open_{};
  std::uint64_t power_ups_;
  std::uint64_t held_power_ups_ = 0;  // when it took hold
  Time powered_at_{0};                // the last time that the encoder was
  Time fresh_since_ = kNever;         // the bus's samples
  Time latch_{0};                     // of the sample that was read last
  Time announced_{0};                 // the hold that was announced since
  Time let_go_at_{0};
  Time resumed_at_ = -kNever;
  std::uint32_t steps_ = 0;        // discontinuities, as of when it took hold
  std::uint32_t steps_seen_ = 0;   // likewise, at the last tick
  std::uint32_t losses_seen_ = 0;  // likewise
  std::uint32_t told_to_let_go_ = 0;
  std::uint32_t let_go_ = 0;
  bool referenced_ = false;
  bool homed_ = false;  // was referenced, or asked to be, before the last tick that saw nothing valid
  bool holds_ = false;
  bool was_held_ = false;
  bool resumed_ = false;  // and has not held since
};

}  // namespace tm485::cli::campaign
