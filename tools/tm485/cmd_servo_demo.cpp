// tm485 servo-demo: a servo loop on a simulated motor and encoder, with what it is worth to estimate.

#include <fmt/format.h>

#include <cmath>

#include "any_port.hpp"
#include "commands.hpp"
#include "output.hpp"
#include "profile_file.hpp"
#include "quantity.hpp"
#include "servo_demo.hpp"
#include "servo_report.hpp"
#include "stop_signal.hpp"
#include "tm485/design/estimator_design.hpp"

namespace tm485::cli {
namespace {

constexpr double kDefaultSwingHz = 2.0;
constexpr double kRestSeconds = 0.05;
constexpr double kFastestLoop = 1000.0;
constexpr Time kShortestRun = std::chrono::milliseconds(100);
constexpr Time kLongestRun = std::chrono::hours(1);
/// What a thread that spins on a quiet machine is late at most.
constexpr Time kHostJitter = std::chrono::microseconds(10);

/// Puts what a parser answers into `target`, or says which option is wrong.
template <class T, class Parser>
std::optional<Problem> take(std::string_view option, const std::string& text, std::string_view remedy,
                            const Parser& parser, T& target) {
  const auto value = parser(text);
  if (value) {
    target = static_cast<T>(*value);
    return std::nullopt;
  }
  return usage_problem("bad_value", fmt::format("{} {}: {}", option, text, value.error()),
                       std::string(remedy));
}

Problem out_of_range(std::string_view option, const std::string& text, std::string_view cause,
                     std::string_view remedy) {
  return usage_problem("bad_value", fmt::format("{} {}: {}", option, text, cause), std::string(remedy));
}

auto time_of(PlainNumber plain) {
  return [plain](std::string_view text) { return parse_time(text, plain); };
}

/// The simulated encoder. The motor turns its shaft, so a movement of its own is refused.
std::expected<sim::SimOptions, Problem> encoder_of(const std::string& port) {
  constexpr std::string_view kSim = "sim:";
  constexpr std::string_view kRemedy =
      "PORT is sim: with its keys except rpm, accel, cruise and motion, for example "
      "sim:profile=tm485_23,lost=0.001";
  const bool simulated = port == "sim" || port.starts_with(kSim);
  if (!simulated)
    return std::unexpected(usage_problem(
        "bad_port", fmt::format("'{}': the demonstration turns a simulated motor, so it needs sim:", port),
        std::string(kRemedy)));
  const auto options = sim::parse_sim_options(
      port.size() > kSim.size() ? std::string_view(port).substr(kSim.size()) : std::string_view{});
  if (!options)
    return std::unexpected(
        usage_problem("bad_port", fmt::format("'{}': {}", port, options.error()), std::string(kRemedy)));
  for (const Time at : {Time{1}, Time{100'000'000}, Time{1'234'567'890}})
    if (options->motion.revolutions(at) != options->motion.revolutions(Time{0}))
      return std::unexpected(usage_problem(
          "bad_port", fmt::format("'{}': the motor turns the shaft, so it has no movement of its own", port),
          std::string(kRemedy)));
  return *options;
}

struct Wishes {
  double amplitude_rev = 0.0;
  double frequency_hz = kDefaultSwingHz;
  double speed_rpm = 0.0;
  double bandwidth_hz = 0.0;
  double velocity_loop_hz = 0.0;
  double drift_ppm = 0.0;
};

std::optional<Problem> read_wishes(const ServoDemoOptions& options, Wishes& wishes, ServoSettings& settings) {
  constexpr std::string_view kTime = "write a time with its unit, such as 2.5s or 50ms";
  constexpr std::string_view kHertz = "write a frequency such as 2Hz or 1kHz";
  if (auto problem = take("--amplitude", options.amplitude, "write an angle such as 90deg or 0.25rev",
                          parse_angle, wishes.amplitude_rev))
    return problem;
  if (!options.frequency.empty())
    if (auto problem = take("--frequency", options.frequency, kHertz, parse_frequency, wishes.frequency_hz))
      return problem;
  if (!options.speed.empty())
    if (auto problem = take("--speed", options.speed, "write a speed such as 1500rpm or 25rev/s", parse_rpm,
                            wishes.speed_rpm))
      return problem;
  if (auto problem = take("--bandwidth", options.bandwidth, kHertz, parse_frequency, wishes.bandwidth_hz))
    return problem;
  if (auto problem =
          take("--velocity-loop", options.velocity_loop, kHertz, parse_frequency, wishes.velocity_loop_hz))
    return problem;
  if (auto problem =
          take("--drift", options.drift, "write a ratio such as 100ppm", parse_ppm, wishes.drift_ppm))
    return problem;
  if (auto problem =
          take("--load", options.load, "write a torque such as 0.3Nm", parse_torque, settings.load_newton_m))
    return problem;
  if (auto problem =
          take("--seconds", options.seconds, kTime, time_of(PlainNumber::seconds), settings.duration))
    return problem;
  if (auto problem = take("--hold", options.hold, kTime, time_of(PlainNumber::refused), settings.hold))
    return problem;
  if (!options.outage.empty())
    if (auto problem =
            take("--outage", options.outage, kTime, time_of(PlainNumber::refused), settings.outage))
      return problem;
  return std::nullopt;
}

/// What the numbers may be.
std::optional<Problem> check(const ServoDemoOptions& options, const Wishes& wishes,
                             const ServoSettings& settings) {
  if (settings.duration < kShortestRun || settings.duration > kLongestRun)
    return out_of_range("--seconds", options.seconds, "it is not within 100 ms and one hour",
                        "write a duration such as 2s");
  if (settings.outage > settings.duration / 4)
    return out_of_range("--outage", options.outage, "it is longer than a quarter of the run",
                        "write a shorter one, or a longer --seconds");
  if (!options.speed.empty() && wishes.speed_rpm <= 0.0)
    return out_of_range("--speed", options.speed, "it is not above 0",
                        "write a speed such as 1500rpm; --amplitude may be negative");
  if (wishes.amplitude_rev == 0.0)
    return out_of_range("--amplitude", options.amplitude, "the shaft would not move",
                        "write an angle such as 90deg");
  if (std::abs(wishes.drift_ppm) > 500.0)
    return out_of_range("--drift", options.drift, "it is beyond 500 ppm, which the bus follows",
                        "write a ratio such as 100ppm: a crystal has less");
  if (wishes.velocity_loop_hz > kFastestLoop)
    return out_of_range("--velocity-loop", options.velocity_loop,
                        "with a current loop of 2 kHz and the dead time of a period that is not stable",
                        "write a frequency up to 1kHz");
  // Found by trying: at 3.3 times the crossover the third state is unstable, at 2 times the second.
  const double least = (options.states == 3 ? 4.0 : 2.5) * wishes.velocity_loop_hz;
  if (options.feedback != "raw" && wishes.bandwidth_hz < least)
    return out_of_range("--bandwidth", options.bandwidth,
                        fmt::format("too slow for a velocity loop of {:g} Hz", wishes.velocity_loop_hz),
                        fmt::format("take at least {:g} Hz, a slower --velocity-loop, or --states 2", least));
  return std::nullopt;
}

/// The reference, and whether the motor can follow it.
std::expected<std::string, Problem> reference_of(const ServoDemoOptions& options, const Wishes& wishes,
                                                 ServoSettings& settings) {
  const double amplitude = std::abs(wishes.amplitude_rev);
  double needed = 0.0;  // rev/s²
  double top = 0.0;     // rev/s
  std::string words;
  if (options.speed.empty()) {
    constexpr double kTurn = 6.283185307179586;
    const double rate = kTurn * wishes.frequency_hz;
    settings.reference = servo::Swing(wishes.amplitude_rev, wishes.frequency_hz);
    needed = amplitude * rate * rate;
    top = amplitude * rate;
    words = fmt::format("swing of ±{:g} deg at {:g} Hz", amplitude * 360.0, wishes.frequency_hz);
  } else {
    top = wishes.speed_rpm / 60.0;
    settings.reference = servo::Moves(wishes.amplitude_rev, top, kRestSeconds);
    const double move = 1.875 * amplitude / top;
    needed = 5.7735 * amplitude / (move * move);
    words =
        fmt::format("moves of {:g} deg and back at {:g} rpm", wishes.amplitude_rev * 360.0, wishes.speed_rpm);
  }
  constexpr double kMostRevS = 100.0;
  const double current =
      needed * static_cast<double>(settings.cascade.acceleration_gain) +
      (std::abs(settings.load_newton_m) + settings.motor.coulomb_newton_m) / settings.motor.torque_constant;
  if (top <= kMostRevS && current <= 0.9 * settings.motor.current_limit_amperes) return words;
  return std::unexpected(usage_problem(
      "too_fast",
      top > kMostRevS ? fmt::format("{}: a top speed of {:.0f} rpm is above the 6000 rpm of this motor",
                                    words, top * 60.0)
                      : fmt::format("{}: that takes {:.1f} A of the motor's {:g} A", words, current,
                                    settings.motor.current_limit_amperes),
      "take a smaller --frequency, --speed or --load, or another --amplitude"));
}

/// Everything but the encoder and its profile, which are known.
std::expected<ServoHead, Problem> complete(const ServoDemoOptions& options, ServoSettings& settings) {
  Wishes wishes;
  if (auto problem = read_wishes(options, wishes, settings)) return std::unexpected(std::move(*problem));
  if (auto problem = check(options, wishes, settings)) return std::unexpected(std::move(*problem));
  settings.priority = options.priority;
  settings.motor.start_rev = settings.encoder.motion.revolutions(Time{0});
  settings.cascade = servo::CascadeConfig::rigid_axis(
      static_cast<float>(settings.motor.inertia_kg_m2), static_cast<float>(settings.motor.torque_constant),
      static_cast<float>(settings.motor.current_limit_amperes), static_cast<float>(wishes.velocity_loop_hz),
      static_cast<float>(kServoPeriod.count()) * 1e-9F);
  settings.servo_period =
      Time{std::llround(static_cast<double>(kServoPeriod.count()) * (1.0 + wishes.drift_ppm * 1e-6))};
  const auto design =
      design::solve_for_bandwidth({.order = options.states, .period = kServoPeriod}, wishes.bandwidth_hz);
  if (!design)
    return std::unexpected(out_of_range("--bandwidth", options.bandwidth, describe(design.error()),
                                        "write a frequency such as 1kHz"));
  settings.gains = design->gains;
  auto words = reference_of(options, wishes, settings);
  if (!words) return std::unexpected(std::move(words.error()));
  return ServoHead{options.port, std::move(*words), wishes.bandwidth_hz, wishes.velocity_loop_hz};
}

std::vector<Feedback> feedbacks(const std::string& text) {
  if (text == "raw") return {Feedback::raw};
  if (text == "estimator") return {Feedback::estimator};
  return {Feedback::raw, Feedback::estimator};
}

}  // namespace

int run_servo_demo(const ServoDemoOptions& options) {
  const auto encoder = encoder_of(options.port);
  if (!encoder) return report(encoder.error());
  const auto profile = load_profile(AnyPort::default_profile(options.port));
  if (!profile) return report(profile.error());
  ServoSettings settings{.encoder = *encoder,
                         .profile = *profile,
                         .id = static_cast<DataId>(options.id),
                         .virtual_time = options.virtual_time,
                         .duration = {},
                         .reference = servo::Swing(0.0, 1.0),
                         .cascade = {},
                         .motor = {},
                         .gains = {},
                         .hold = {}};
  if (!options.virtual_time)
    settings.encoder.port.jitter_margin = std::max(settings.encoder.port.jitter_margin, kHostJitter);
  const auto head = complete(options, settings);
  if (!head) return report(head.error());

  std::vector<ServoRun> runs;
  for (const Feedback feedback : feedbacks(options.feedback)) {
    if (stop_requested()) break;
    auto run = run_servo(settings, feedback);
    if (!run) return report(run.error());
    if (run->measured != Time{0}) runs.push_back(std::move(*run));  // 0: Ctrl-C before it was switched on
  }
  if (runs.empty()) return kExitGood;
  Output output;
  output.write(options.json ? servo_json(*head, settings, runs) : servo_text(*head, settings, runs));
  const int result = finish(output, kExitGood);
  for (const ServoRun& run : runs)
    if (run.t1_violations != 0)
      return report({"t1_violated", fmt::format("{} requests came too early", run.t1_violations),
                     "report this with the command that led to it", kExitFailure});
  return result;
}

}  // namespace tm485::cli
