#include "servo_demo.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <fstream>
#include <memory>

#include "quantity.hpp"
#include "servo_control.hpp"
#include "stop_signal.hpp"
#include "tm485/bus/axis.hpp"
#include "tm485/linux/clock.hpp"
#include "tm485/linux/periodic_wait.hpp"

namespace tm485::cli {
namespace {

using std::chrono::milliseconds;

/// Start-up takes milliseconds, on a busy machine more; an axis that cannot be switched on by then never will.
constexpr Time kLongestStart = std::chrono::seconds(10);
/// From when the sample can be there at the latest until the servo loop takes it.
constexpr Time kMargin{5'000};

/// On an isolated core.
constexpr int kPriority = 80;

/// The port of the simulated encoder, with a plug that can be pulled: no reply reaches the host, requests go out.
class DemoPort {
 public:
  DemoPort(sim::SimPort& port, bool real_time) noexcept : port_(&port), real_time_(real_time) {}

  void pull_plug(Time from, Time span) noexcept {
    from_ = from;
    until_ = from + span;
  }

  [[nodiscard]] PortCapability capability() const noexcept {
    PortCapability capability = port_->capability();
    if (real_time_) capability.timing = TimingClass::soft;
    return capability;
  }
  [[nodiscard]] std::expected<Time, Errc> try_send(std::span<const std::uint8_t> request, Time now) noexcept {
    return port_->try_send(request, now);
  }
  [[nodiscard]] Transmission transmission(Time now) const noexcept { return port_->transmission(now); }
  [[nodiscard]] Reception try_receive(std::span<std::uint8_t> buffer, Time now) noexcept {
    Reception reception = port_->try_receive(buffer, now);
    if (now >= from_ && now < until_) reception.count = 0;
    return reception;
  }

 private:
  sim::SimPort* port_;
  bool real_time_;
  Time from_ = kNever;
  Time until_ = kNever;
};

Problem refusal_problem(const CycleRefusal& refusal, const ServoSettings& settings) {
  Problem problem =
      problem_of(refusal.code, fmt::format("ID{} every {}", number(settings.id), format_time(kServoPeriod)));
  problem.exit_code = kExitUsage;
  problem.remedy = "use --id 0, which takes 40 us at 2.5 Mbit/s, and no slower line than that";
  return problem;
}

/// Encoder, motor and axis, with the two sides of the servo loop.
class Rig {
 public:
  Rig(const ServoSettings& settings, Feedback feedback, Time lead)
      : settings_(&settings),
        encoder_(settings.encoder),
        port_(encoder_.port(), !settings.virtual_time),
        plant_(encoder_, ring_, settings.motor, settings.load_newton_m),
        axis_(port_, settings.profile, setup(lead)),
        control_(settings, feedback, axis_.client(), ring_) {}
  Rig(const Rig&) = delete;
  Rig& operator=(const Rig&) = delete;

  [[nodiscard]] std::expected<void, CycleRefusal> start(Time now) noexcept { return axis_.start(now); }
  [[nodiscard]] std::expected<Feasibility, CycleRefusal> check() const noexcept { return axis_.check(); }

  /// The bus's context. Answers when something can happen next.
  Time poll(Time now) noexcept {
    plant_.advance(now);
    if (settings_->outage > Time{0} && !plug_set_ && plant_.begun() != kNever) {
      plug_set_ = true;
      port_.pull_plug(plant_.begun() + settings_->duration / 2, settings_->outage);
    }
    const Time due = axis_.poll(now);
    // The encoder latches what the motor does now: works off a request that was just sent.
    const Time event = encoder_.line().next_event();
    return event > now ? std::min(due, event) : due;
  }

  /// The servo loop's context.
  [[nodiscard]] ServoControl& control() noexcept { return control_; }

  /// Why the axis is still not on.
  [[nodiscard]] Problem start_problem() {
    (void)axis_.client().latest();
    const AxisView& view = axis_.client().view();
    if (view.state == BusState::running)
      return {"axis_lost",
              "the encoder answers, but the axis was lost each time before the loop took hold of it",
              "the machine is too busy: tm485 rt-check says what to change; or use --virtual", kExitFailure};
    const Errc cause = view.startup_cause == Errc::ok ? Errc::timeout : view.startup_cause;
    Problem problem = problem_of(
        cause,
        fmt::format("the axis could not be switched on: start-up at stage '{}'", tm485::name(view.stage)));
    problem.exit_code = kExitFailure;
    return problem;
  }

  void collect(ServoRun& run, Time now) {
    plant_.advance(now);
    run.plant = plant_.findings();
    run.periods = control_.periods();
    run.torque_offs = control_.torque_offs();
    run.recoveries = control_.recoveries();
    run.statistics = axis_.bus().statistics();
    run.t1_violations = encoder_.model().t1().violations();
    run.smallest_t1_margin = encoder_.model().t1().smallest_margin();
    run.measured = control_.begun() == kNever ? Time{0} : now - control_.begun();
    run.overflows = control_.overflows();
  }

 private:
  AxisSetup setup(Time lead) noexcept {
    AxisSetup setup;
    setup.bus.cycle = Cycle{settings_->id, kServoPeriod};
    if (lead != Time{0}) setup.bus.phase = Phase::locked_to({.period = kServoPeriod, .lead = lead});
    setup.bus.max_hold = settings_->hold;
    setup.gains = &settings_->gains;
    setup.on_invalid = {[](void* context, Time now) { static_cast<Rig*>(context)->plant_.torque_off(now); },
                        this};
    return setup;
  }

  const ServoSettings* settings_;
  sim::SimulatedEncoder encoder_;
  DemoPort port_;
  ControlRing ring_;
  ServoPlant plant_;
  Axis<DemoPort> axis_;
  ServoControl control_;
  bool plug_set_ = false;
};

/// The run must go on: not finished, not stopped, and switched on in time.
bool goes_on(const ServoControl& control, Time begin, Time now) {
  if (stop_requested() || control.finished(now)) return false;
  return control.begun() != kNever || now - begin < kLongestStart;
}

/// One thread, one instant after the other.
Time run_in_virtual_time(const ServoSettings& settings, Rig& rig) {
  Time now{0};
  Time tick = settings.servo_period;
  while (goes_on(rig.control(), Time{0}, now)) {
    if (now >= tick) {
      rig.control().on_tick(tick, now);
      tick += settings.servo_period;
    }
    now = std::max(now, std::min(rig.poll(now), tick));
  }
  return now;
}

/// The first two cores that the kernel keeps free of other work.
std::vector<int> isolated_cpus() {
  std::ifstream file("/sys/devices/system/cpu/isolated");
  std::vector<int> cpus;
  int first = 0;
  while (cpus.size() < 2 && file >> first) {  // "2-3,6"
    int last = first;
    if (file.peek() == '-' && !(file.ignore() >> last)) break;
    for (int cpu = first; cpu <= last && cpus.size() < 2; ++cpu) cpus.push_back(cpu);
    file.ignore();
  }
  return cpus;
}

std::expected<Time, Problem> run_in_real_time(const ServoSettings& settings,
                                              const linux_hal::MonotonicClock& clock, Rig& rig,
                                              ServoRun& run) {
  using linux_hal::RealtimeThread;
  const auto no_thread = [](const linux_hal::OsError& error) {
    return std::unexpected(Problem{"no_thread", error.what, error.remedy, kExitFailure});
  };
  const std::vector<int> isolated = isolated_cpus();
  const auto options = [&](const char* name, std::size_t which) {
    const int cpu = which < isolated.size() ? isolated[which] : -1;
    return linux_hal::RealtimeOptions{
        .name = name, .priority = settings.priority.value_or(cpu < 0 ? 0 : kPriority), .cpu = cpu};
  };
  // The bus spins: 62.5 us leave no time to sleep and wake up.
  auto bus = RealtimeThread::start(options("tm485_bus", 0), [&](const std::atomic<bool>& stop) {
    while (!stop.load(std::memory_order_relaxed)) (void)rig.poll(clock.now());
  });
  if (!bus) return no_thread(bus.error());
  const Time begin = clock.now();
  auto loop = RealtimeThread::start(options("tm485_servo", 1), [&](const std::atomic<bool>& stop) {
    linux_hal::PeriodicWait wait(clock, {.period = settings.servo_period});
    while (!stop.load(std::memory_order_relaxed) && goes_on(rig.control(), begin, clock.now())) {
      const Time tick = wait.due();
      (void)wait.wait();
      rig.control().on_tick(tick, clock.now());
    }
    run.lateness = wait.lateness();
    run.skipped = wait.skipped();
  });
  if (!loop) return no_thread(loop.error());
  loop->join();
  bus->stop();
  bus->join();
  run.warnings = bus->warnings();
  for (const auto* thread : {&*bus, &*loop})
    if (!thread->failure().empty())
      return std::unexpected(Problem{"internal_error", thread->failure(), "report this", kExitFailure});
  return clock.now();
}

/// The latch comes so long before the control instant that the sample is there by then.
std::expected<Time, Problem> lead_of(const ServoSettings& settings) {
  const auto feasible = std::make_unique<Rig>(settings, Feedback::raw, Time{0})->check();
  if (!feasible) return std::unexpected(refusal_problem(feasible.error(), settings));
  return feasible->ready + settings.encoder.port.jitter_margin + kMargin;
}

}  // namespace

std::expected<ServoRun, Problem> run_servo(const ServoSettings& settings, Feedback feedback) {
  const auto lead = lead_of(settings);
  if (!lead) return std::unexpected(lead.error());
  const auto rig = std::make_unique<Rig>(settings, feedback, *lead);
  const linux_hal::MonotonicClock clock;
  if (const auto started = rig->start(settings.virtual_time ? Time{0} : clock.now()); !started)
    return std::unexpected(refusal_problem(started.error(), settings));
  ServoRun run;
  run.feedback = feedback;
  run.lead = *lead;
  Time end{0};
  if (settings.virtual_time) {
    end = run_in_virtual_time(settings, *rig);
  } else {
    const auto ended = run_in_real_time(settings, clock, *rig, run);
    if (!ended) return std::unexpected(ended.error());
    end = *ended;
  }
  rig->collect(run, end);
  if (run.measured == Time{0} && !stop_requested()) return std::unexpected(rig->start_problem());
  return run;
}

}  // namespace tm485::cli
