#include "session.hpp"

#include <fmt/format.h>
#include <sched.h>

#include <algorithm>
#include <cmath>

#include "open_port.hpp"
#include "profile_file.hpp"
#include "quantity.hpp"
#include "stop_signal.hpp"

namespace tm485::cli {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;

/// A reply that takes longer than this comes from another process or is lost: leave it the processor.
constexpr Time kSpin = microseconds(200);
constexpr Time kYield = milliseconds(2);
constexpr Time kNap = microseconds(50);
/// Ctrl-C is noticed at least this often.
constexpr Time kLongestSleep = milliseconds(50);

Problem refusal_problem(const CycleRefusal& refusal, const Cycle& cycle, const CompiledProfile& profile,
                        const PortCapability& port) {
  Problem problem =
      problem_of(refusal.code, fmt::format("ID{} every {}", number(cycle.id), format_time(cycle.period)));
  problem.exit_code = kExitUsage;
  if (refusal.code == Errc::bad_argument) {
    problem.cause = fmt::format("a period of {} is not possible", format_time(cycle.period));
    problem.remedy = "use a period of at most one hour";
    return problem;
  }
  switch (refusal.code) {
    case Errc::period_below_t1:
      problem.cause += fmt::format(" (T1 is {})", format_time(profile.t1(cycle.id)));
      break;
    case Errc::period_below_port:
      problem.cause += fmt::format(" (this port: {})", format_time(port.shortest_exchange));
      break;
    default:
      problem.cause += " (in one period the shaft may turn by half a revolution)";
      break;
  }
  problem.remedy = fmt::format("the nearest possible period is {}: --period {}", format_time(refusal.nearest),
                               format_time(refusal.nearest));
  return problem;
}

/// A limit of the shaft as it was written: 1 or more, rounded up.
std::expected<std::int32_t, Problem> limit_of(const char* name, std::string_view option,
                                              const std::string& text,
                                              const std::expected<double, std::string>& value,
                                              std::string_view unit) {
  if (value && *value >= 1.0) return static_cast<std::int32_t>(std::ceil(*value));
  return std::unexpected(usage_problem(
      name,
      fmt::format("{} {}: {}", option, text, value ? fmt::format("it is below 1 {}", unit) : value.error()),
      fmt::format("write a number such as 6000 or 6000{}", unit)));
}

/// What the options of the port say about the shaft, in place of what stands in `options`.
std::expected<SessionOptions, Problem> with_shaft(SessionOptions options) {
  if (const std::string& text = options.port.max_speed; !text.empty()) {
    const auto rpm = limit_of("bad_speed", "--max-speed", text, parse_rpm(text), "rpm");
    if (!rpm) return std::unexpected(rpm.error());
    options.max_speed_rpm = *rpm;
  }
  if (const std::string& text = options.port.max_acceleration; !text.empty()) {
    const auto rpm_s = limit_of("bad_acceleration", "--max-accel", text, parse_acceleration(text), "rpm/s");
    if (!rpm_s) return std::unexpected(rpm_s.error());
    options.max_acceleration_rpm_s = *rpm_s;
  }
  return options;
}

std::expected<CompiledProfile, Problem> profile_for(const PortOptions& options) {
  auto profile =
      load_profile(options.profile.empty() ? AnyPort::default_profile(options.port) : options.profile);
  if (!profile || !options.echo) return profile;
  Profile with_echo = profile->profile();
  with_echo.echo = true;
  return CompiledProfile::compile(with_echo).value_or(*profile);
}

BusConfig bus_config(const SessionOptions& options, const AxisConfig& axis, Time period) {
  BusConfig config;
  config.cycle = std::nullopt;
  if (options.cyclic) config.cycle = Cycle{options.cycle.id, period};
  config.axis = axis;
  // A failed cycle shows the held sample until the encoder is given up, however long the time-outs are.
  config.max_hold = std::chrono::seconds(1);
  return config;
}

}  // namespace

Session::Session(AnyPort port, const CompiledProfile& profile, const SessionOptions& options)
    : port_(std::move(port)),
      capability_(port_.capability()),
      profile_(profile),
      virtual_time_(options.virtual_time) {
  axis_.units = options.units;
  axis_.max_speed_rpm = options.max_speed_rpm;
  axis_.max_acceleration_rpm_s = options.max_acceleration_rpm_s;
}

std::expected<std::unique_ptr<Session>, Problem> Session::open(const SessionOptions& options) {
  const auto profile = profile_for(options.port);
  if (!profile) return std::unexpected(profile.error());
  auto port = open_port(options.port, profile->profile().bit_rate, options.virtual_time);
  if (!port) return std::unexpected(std::move(port.error()));
  for (const Problem& warning : port->warnings()) report(warning);
  return begin(std::move(*port), *profile, options);
}

std::expected<std::unique_ptr<Session>, Problem> Session::on(AnyPort port, const SessionOptions& options) {
  const auto profile = profile_for(options.port);
  if (!profile) return std::unexpected(profile.error());
  return begin(std::move(port), *profile, options);
}

std::expected<std::unique_ptr<Session>, Problem> Session::begin(AnyPort port, const CompiledProfile& profile,
                                                                const SessionOptions& options) {
  const auto with_limits = with_shaft(options);
  if (!with_limits) return std::unexpected(with_limits.error());
  std::unique_ptr<Session> session(new Session(std::move(port), profile, *with_limits));
  Time period = options.cycle.period;
  if (period == Time{0} && options.wished_period)
    period = std::max(
        {*options.wished_period, profile.t1(options.cycle.id), session->capability_.shortest_exchange});
  session->bus_.emplace(session->port_, session->profile_, bus_config(options, session->axis_, period));
  if (const auto started = session->bus_->start(session->now()); !started)
    return std::unexpected(
        refusal_problem(started.error(), Cycle{options.cycle.id, period}, profile, session->capability_));
  return session;
}

bool Session::step(Time limit) {
  const Time at = now();
  const std::uint32_t records = bus_->record_count();
  const std::uint64_t sends = port_.sends();
  const Time due = bus_->poll(at);
  const std::uint32_t added = bus_->record_count() - records;
  if (added > 1) unseen_ += added - 1;
  if (port_.sends() != sends) {
    in_flight_ = true;
    sent_at_ = at;
  } else if (added != 0) {
    in_flight_ = false;
  }
  if (added != 0) return true;
  wait(std::min(due, limit), at);
  return false;
}

void Session::wait(Time until, Time at) {
  if (virtual_time_) {
    if (in_flight_) {
      if (const Time event = port_.next_event(); event > at) until = std::min(until, event);
    }
    virtual_clock_.advance_to(until);
    return;
  }
  if (!in_flight_) {
    (void)clock_.wait_until(std::min(until, at + kLongestSleep));
    return;
  }
  const Time waited = at - sent_at_;
  if (waited < kSpin || until - at < kSpin) return;
  if (waited < kYield) {
    (void)::sched_yield();
    return;
  }
  (void)clock_.wait_until(std::min(until, at + kNap + linux_hal::MonotonicClock::kSpinMargin));
}

bool Session::tend_port(bool quiet) {
  using Event = linux_hal::Reopener::Event;
  switch (reopener_.tend(port_, *bus_, now())) {
    case Event::gone:
      returning_ = true;
      if (quiet) break;
      report({"port_gone", fmt::format("{} has vanished; waiting for it", port_.text()),
              "plug the adapter in again", kExitGood});
      break;
    case Event::back:
      if (quiet) break;
      report({"port_back", fmt::format("{} is there again; starting up", port_.text()), {}, kExitGood});
      break;
    case Event::none:
      break;
  }
  if (!port_.gone() && bus_->state() == BusState::running) returning_ = false;
  return returning_;
}

std::optional<Problem> Session::failure() const {
  if (port_.gone()) return problem_of(Errc::port_gone, port_.text());
  if (bus_->state() != BusState::startup || !bus_->startup_error()) return std::nullopt;
  const StartupError& error = *bus_->startup_error();
  Problem problem = problem_of(
      error.cause, fmt::format("{}: start-up failed at stage '{}'", port_.text(), name(error.stage)));
  problem.exit_code = kExitFailure;
  return problem;
}

std::expected<void, Problem> Session::wait_for_startup() {
  while (bus_->state() == BusState::startup) {
    if (stop_requested())
      return std::unexpected(Problem{"stopped", "stopped before start-up was through", {}, kExitGood});
    if (auto problem = failure()) return std::unexpected(std::move(*problem));
    (void)step();
  }
  return {};
}

}  // namespace tm485::cli
