// Bus: one encoder on one line, read every cycle. The only place that calls a port.
//
// The owner calls poll() whenever something may have happened (a timer, a received byte, or in a
// loop) and gets back when to call it at the latest. Everything else follows from that:
//
//   start-up -> cyclic reads -> (lost, or on_restart) -> start-up ...
//
// Samples go to one reader through LatestValue; background exchanges come in through offer().
// Context: every function but latest() belongs to the one context that owns the bus (a thread or an
// interrupt priority); latest() belongs to one reader context of any priority. docs/api-contexts.md
// has the table. Specification: sections 2 to 4.
#pragma once

#include <cstdint>
#include <expected>
#include <optional>

#include "tm485/bus/alarm_monitor.hpp"
#include "tm485/bus/background.hpp"
#include "tm485/bus/exchange.hpp"
#include "tm485/bus/link_health.hpp"
#include "tm485/bus/pattern.hpp"
#include "tm485/bus/port.hpp"
#include "tm485/bus/reset_outcome.hpp"
#include "tm485/bus/scheduler.hpp"
#include "tm485/bus/startup.hpp"
#include "tm485/bus/statistics.hpp"
#include "tm485/errc.hpp"
#include "tm485/motion/axis_config.hpp"
#include "tm485/motion/position_tracker.hpp"
#include "tm485/motion/sample.hpp"
#include "tm485/protocol/frame.hpp"
#include "tm485/protocol/profile.hpp"
#include "tm485/protocol/request.hpp"
#include "tm485/sync/latest_value.hpp"
#include "tm485/time.hpp"

namespace tm485 {

/// What a bus does. Copied at construction.
struct BusConfig {
  std::optional<Pattern> cycle = Pattern{};  ///< a Cycle or a Pattern; none: only background exchanges
  Phase phase;                               ///< when the pattern starts; locked to a servo clock, or not
  /// What happens to a background request that fits into no gap of the pattern. 0: it is refused (no_gap). N: it
  /// takes cyclic slots, one in N (two in 2 N if it needs two), while the sample is held; refused if it would take
  /// them for longer than max_hold. A request with a gap takes one too, if for 32 slots it has not fitted in time. No step
  /// of the pattern loses its slot to it twice before it was asked.
  std::uint16_t steal_every = 0;
  /// An EEPROM write that holds the bus (profile: 10 ms, 18 ms for a page) fits into no cycle. false: it is refused. true: it
  /// is sent, the cycle waits, and the sample is held for so long beyond max_hold. It waits until one sample has announced
  /// it (Sample::announced_hold).
  bool eeprom_may_hold = false;
  AxisConfig axis;
  /// A sample is invalid when its successor is overdue by this: at an age of one period and max_hold.
  Time max_hold = std::chrono::milliseconds(2);
  std::uint8_t startup_frames = 4;  ///< mutually consistent frames before anything is fresh
  /// Start-up begins again after three or more failed cycles in a row that last this long; 0: half of the
  /// profile's boot_time_min. In any case after failures that last as long as boot_time_min: a restart of the
  /// encoder must not go unnoticed behind them.
  Time lost_after{0};
  LinkLimits link;                  ///< what is called a good line, and a lost one
  std::uint8_t alarm_debounce = 2;  ///< replies in a row that must agree on a status bit (AlarmMonitor), 1..4

  /// False if a bus refuses to start with it: an axis or limits that are not valid, a debounce out of its range, a span below
  /// zero or above an hour, an epoch beyond kNever.
  [[nodiscard]] constexpr bool valid() const noexcept {
    constexpr Time kLongest = std::chrono::hours(1);
    return axis.valid() && link.valid() && alarm_debounce != 0 &&
           alarm_debounce <= AlarmMonitor::kMostDebounce && max_hold >= Time{0} && max_hold <= kLongest &&
           lost_after >= Time{0} && lost_after <= kLongest && phase.epoch >= -kNever && phase.epoch <= kNever;
  }
};

/// What may not go to the line meanwhile.
enum class LineHold : std::uint8_t {
  none,
  no_cycle,     ///< background exchanges only
  resets_only,  ///< a run of resets, nothing between them
};

/// The last exchange, for whoever records every cycle.
struct CycleRecord {
  enum class Kind : std::uint8_t { startup, cyclic, background };
  Kind kind = Kind::startup;
  DataId id = DataId::everything;
  Errc result = Errc::ok;
  Time slot{0};         ///< when a cyclic request was due
  Time start{0};        ///< when it started
  Time seen{0};         ///< when its verdict was known
  Time reply_delay{0};  ///< T2, or what the host has seen of it
  bool has_reply_delay = false;
};

template <Port P>
class Bus {
 public:
  /// `port` and `profile` must outlive the bus. Nothing is sent before start().
  Bus(P& port, const CompiledProfile& profile, const BusConfig& config) noexcept
      : port_(&port),
        profile_(&profile),
        config_(config),
        capability_(port.capability()),
        tracker_(profile, config.axis),
        startup_(profile, tracker_, config.startup_frames),
        link_(config.link),
        alarms_(profile.profile().alarms, config.alarm_debounce) {
    if (config_.lost_after == Time{0}) config_.lost_after = profile.profile().boot_time_min / 2;
  }

  Bus(P& port, const CompiledProfile&& profile, const BusConfig& config) = delete;
  Bus(const Bus&) = delete;
  Bus& operator=(const Bus&) = delete;

  /// Can the pattern be kept with this profile and port? Its slack, or why not. Sends nothing, changes nothing.
  /// Without a pattern: all zero. Errors: see CycleRefusal; bad_argument also for a config or a port that is not valid().
  [[nodiscard]] std::expected<Feasibility, CycleRefusal> check() const noexcept;
  /// As check(), and begins start-up at `now`; a bus that runs begins anew. On a refusal nothing has changed.
  [[nodiscard]] std::expected<void, CycleRefusal> start(Time now) noexcept;
  /// Sends nothing more; an exchange under way is abandoned, its T1 still holds.
  void stop() noexcept;

  /// Does what is due at `now`; answers when to call again at the latest (kNever when stopped). Earlier
  /// is always allowed. Bounded: at most one request and one reply. `now` never goes back.
  Time poll(Time now) noexcept;

  /// The encoder was restarted (its power failed, or a tool says so): start-up begins again. What the bus sees itself it
  /// does itself: a silence as long as a restart, or turns that are back at their start value.
  void on_restart(Time now) noexcept;
  /// A run of resets was read back (drive() calls this): latched alarms are cleared, a moved zero is looked for.
  void on_reset(const ResetOutcome& outcome, Time now) noexcept;

  /// A tick of the servo clock (BusConfig::phase), stamped at `tick`; ignored without one, and before start(). Those that
  /// come during start-up let the pattern begin in phase.
  void on_servo_tick(Time tick) noexcept {
    if (state_ != BusState::stopped && scheduler_) scheduler_->on_servo_tick(tick, statistics_);
  }

  /// The cycle leaves the line alone until release_line(), or until `until`; its slots count as displaced, and the sample is
  /// held from the first exchange on. Again: replaces the hold before. Ends by itself with a start-up.
  void hold_line(Time until, LineHold hold) noexcept;
  void release_line(Time now) noexcept;
  [[nodiscard]] bool line_held() const noexcept { return hold_ != LineHold::none; }

  /// Asks for one background exchange: a reset request goes before the next cyclic one, everything else into the
  /// free time of the pattern (or see BusConfig::steal_every). One of each class (Priority) can wait. Errors:
  /// bad_state before start-up is through, busy while one of its class is pending or its completion was not
  /// taken, no_gap if the pattern has no room for it. An offer always ends in a completion: that of its exchange;
  /// no_gap if it waited in vain for 64 slots (with steal_every N: for 4 N, if that is more); bad_state if the bus left
  /// the running state before it was sent, abandoned if after. `ticket` is for the caller's own use.
  [[nodiscard]] std::expected<void, Errc> offer(const Request& request, std::uint32_t ticket = 0) noexcept;
  /// A completion, once; the most urgent class first. Not beside an Axis, whose commands wait for theirs.
  [[nodiscard]] std::optional<Completion> take_completion() noexcept { return background_.take(); }
  /// That of one class, if it was offered with this ticket.
  [[nodiscard]] std::optional<Completion> take_completion(Priority priority, std::uint32_t ticket) noexcept {
    return background_.take(priority, ticket);
  }

  /// The newest sample. The one function for the reader's context; wait-free.
  [[nodiscard]] const Sample& latest() noexcept { return latest_.get(); }

  /// When the successor of the newest fresh sample is overdue: by the age of its data, or by when it was seen, whichever
  /// comes first.
  [[nodiscard]] Time fresh_until() const noexcept { return fresh_until_; }

  /// Until when the newest sample may be used, extrapolated; an announced hold that has begun is in it. kNever: nothing
  /// more to lose, there is none.
  [[nodiscard]] Time valid_until() const noexcept { return stale_at_; }

  /// The axis was homed: samples are referenced from the next one on.
  void set_referenced(bool referenced) noexcept { tracker_.set_referenced(referenced); }

  /// As given to the constructor; for any context.
  [[nodiscard]] const CompiledProfile& profile() const noexcept { return *profile_; }
  [[nodiscard]] BusState state() const noexcept { return state_; }
  [[nodiscard]] StartupStage startup_stage() const noexcept { return startup_.stage(); }
  /// The last failed start-up sequence, if any has failed since the last good one.
  [[nodiscard]] const std::optional<StartupError>& startup_error() const noexcept { return startup_error_; }
  [[nodiscard]] const Statistics& statistics() const noexcept { return statistics_; }
  [[nodiscard]] const CycleRecord& last_record() const noexcept { return record_; }
  /// How good the line is. `lost` after LinkLimits::lost_after failed cycles, long before the encoder is given up.
  [[nodiscard]] const LinkHealth& link() const noexcept { return link_; }
  /// Status bits, live and latched.
  [[nodiscard]] const AlarmMonitor& alarms() const noexcept { return alarms_; }
  /// Counts records, so that a recorder knows whether last_record() is new.
  [[nodiscard]] std::uint32_t record_count() const noexcept { return record_count_; }
  /// The cyclic grid, if there is one.
  [[nodiscard]] const std::optional<Scheduler>& scheduler() const noexcept { return scheduler_; }
  /// While an exchange is under way: when its reply can be complete at the earliest. Otherwise kNever.
  [[nodiscard]] Time reply_expected() const noexcept {
    return in_flight() ? exchange_.start() + profile_->exchange_min(exchange_.id()) : kNever;
  }
  /// From the start of a request to the encoder's latch.
  [[nodiscard]] Time latch_after(DataId id) const noexcept {
    return profile_->request_time(id) + profile_->profile().latch_offset;
  }

 private:
  using Kind = CycleRecord::Kind;

  // What to do next, and when.
  [[nodiscard]] bool in_flight() const noexcept {
    return exchange_.state() == Exchange::State::waiting || arrived_;
  }
  [[nodiscard]] Time wake_up(Time due) const noexcept { return due < stale_at_ ? due : stale_at_; }
  [[nodiscard]] Time next_due(Time now) const noexcept;
  [[nodiscard]] Time span_of(const Request& request) const noexcept;
  [[nodiscard]] bool fits(const Request& request, Time start) const noexcept;
  [[nodiscard]] bool may_steal(const Request& request, Time now) const noexcept;
  [[nodiscard]] bool holds_bus(const Request& request) const noexcept;
  [[nodiscard]] const Request* candidate(Time start) const noexcept;
  void begin_background(const Request& request, Time now) noexcept;
  void slot_passed() noexcept;
  [[nodiscard]] std::expected<Scheduler, CycleRefusal> make_scheduler() const noexcept;
  void begin_due(Time now) noexcept;
  [[nodiscard]] bool begin_before_cycle(Time now) noexcept;
  [[nodiscard]] bool send(const Request& request, Kind kind, Time now) noexcept;
  [[nodiscard]] Errc check_line(Time now) noexcept;
  [[nodiscard]] bool still_leaving(Time now) noexcept;
  [[nodiscard]] Errc check_quiet(Time now) noexcept;

  // The exchange under way.
  void receive(Time now) noexcept;
  [[nodiscard]] Errc silence_cause(Time now) noexcept;
  void finish(Time now) noexcept;
  [[nodiscard]] Errc finish_cyclic(Time now) noexcept;
  [[nodiscard]] Errc note(const Reply& reply, Time latch, Time now) noexcept;
  void cycle_good(const Reply& reply, AlarmLevel alarm, Time now) noexcept;
  void finish_startup(Time now) noexcept;
  void finish_background(Time now) noexcept;
  void record(Errc result, Time now) noexcept;
  [[nodiscard]] Errc line_cause(Errc result) noexcept;

  // States.
  void begin_startup(Time now) noexcept;
  void poll_quiet(Time now) noexcept;
  void after_startup_step(Time now) noexcept;
  void shape_histograms() noexcept;
  void abandon() noexcept;
  void go_stale(Time now) noexcept;
  void settle(Time now) noexcept;
  [[nodiscard]] bool cycle_failed(Errc cause, Time now) noexcept;
  void publish(const Sample& sample) noexcept {
    latest_.put(sample);
    announced_ = true;
  }
  [[nodiscard]] bool will_hold(const Request& request) const noexcept {
    return config_.eeprom_may_hold && holds_bus(request);
  }

  [[nodiscard]] Time sample_gap() const noexcept { return scheduler_ ? scheduler_->sample_gap() : Time{0}; }
  /// How old a held sample may be at most.
  [[nodiscard]] Time valid_for() const noexcept { return config_.max_hold + sample_gap() + held_for_; }
  [[nodiscard]] bool may_take_slots(const Request& request) const noexcept;
  /// The encoder was not heard for so long, until `now`, that it can have restarted.
  [[nodiscard]] bool was_silent(Time now) const noexcept {
    return now - last_heard_ >= (failed_in_a_row_ != 0 ? profile_->profile().boot_time_min : silence_);
  }
  [[nodiscard]] Time longest_silence() const noexcept;
  [[nodiscard]] Time latch_uncertainty(Time seen) const noexcept;
  [[nodiscard]] Time latch_time() const noexcept {
    return exchange_.request_end() + profile_->profile().latch_offset;
  }

  P* port_;
  const CompiledProfile* profile_;
  BusConfig config_;
  PortCapability capability_;
  PositionTracker tracker_;
  Startup startup_;
  std::optional<Scheduler> scheduler_;
  RequestSpacing spacing_;
  Exchange exchange_;
  Request cyclic_request_ = *Request::make(DataId::everything);
  BackgroundQueue background_;
  LinkHealth link_;
  AlarmMonitor alarms_;
  std::optional<StartupError> startup_error_;
  BusState state_ = BusState::stopped;
  bool settling_ = false;   ///< the last exchange failed: late bytes of it may still come
  bool arrived_ = false;    ///< the exchange is done, and waits for a clock that was read after it
  bool unsent_ = false;     ///< the exchange failed before anything went out, and poll() has not seen it yet
  bool leaving_ = false;    ///< and when last looked at, its request had not left
  bool announced_ = false;  ///< a sample was published since the request that waits was offered
  Time held_for_{0};        ///< by which an announced hold has stretched the newest fresh sample
  Time sent_span_{0};       ///< while settling_: span_of() the last request that the port took
  Kind kind_ = Kind::startup;
  std::uint8_t failed_in_a_row_ = 0;
  Time slot_{0};                      ///< of the cyclic exchange under way
  std::optional<Time> cyclic_start_;  ///< of the last cyclic request
  Time fresh_for_{0};                 ///< at this age of its data a sample's successor is overdue
  Time seen_fresh_for_{0};            ///< and so long after it was seen, whichever comes first
  Time seen_valid_for_{0};            ///< likewise, until the sample is invalid
  Time fresh_until_{0};
  Time stale_at_ = kNever;  ///< when the published sample becomes invalid
  LineHold hold_ = LineHold::none;
  Time hold_until_{0};
  std::uint8_t resets_in_a_row_ = 0;   ///< without a cyclic request between them
  std::uint32_t patience_ = 0;         ///< slots that what is waiting may wait
  std::uint32_t to_steal_ = 0;         ///< cyclic slots until one may be stolen again
  Time last_good_{0};                  ///< when the last good cycle, or frame of start-up, was latched
  Time last_heard_{0};                 ///< likewise, background requests included
  Time silence_{0};                    ///< in so long the encoder can have restarted, though no cycle failed
  std::uint32_t discontinuities_ = 0;  ///< that statistics_ has counted
  Statistics statistics_;
  CycleRecord record_;
  std::uint32_t record_count_ = 0;
  LatestValue<Sample> latest_;
};

}  // namespace tm485

#include "tm485/bus/bus_poll.hpp"    // IWYU pragma: export
#include "tm485/bus/bus_reply.hpp"   // IWYU pragma: export
#include "tm485/bus/bus_states.hpp"  // IWYU pragma: export
