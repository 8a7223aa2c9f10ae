#include "usage_loop.hpp"

#include <string>

#include "usage_port.hpp"

namespace tm485::cli {

void add_rt_check(CLI::App& root, RtCheckOptions& options) {
  CLI::App& app =
      *root.add_subcommand("rt-check", "What this machine allows a real-time thread, and how late one is");
  app.add_option("--period", options.period, "Time (62.5us) or rate (16kHz) of the wake-ups")
      ->capture_default_str();
  app.add_option("--seconds", options.seconds, "How long each measure takes, in seconds or with a unit")
      ->capture_default_str();
  app.add_flag("--strict", options.strict, "Exit code 1 if a setting is bad");
  app.add_flag("--json", options.json, "One JSON object");
  app.footer(
      "Needs no privileges; what is refused is said, with what to change. With rt-tests installed, "
      "cyclictest runs at\n"
      "the same period. A measure that spins takes a whole core while it runs.\n"
      "Examples:\n"
      "  tm485 rt-check\n"
      "  tm485 rt-check --period 62.5us --seconds 10 --json\n"
      "  tm485 rt-check --strict || echo 'not fit for a servo loop'");
}

void add_servo_demo(CLI::App& root, ServoDemoOptions& options) {
  CLI::App& app = *root.add_subcommand(
      "servo-demo", "Close a 16 kHz position loop on a simulated motor: what the estimator is worth");
  app.add_option("PORT,--port", options.port, "sim: with its keys, but without a movement; default: sim:");
  app.add_flag("--virtual", options.virtual_time, "Virtual time, repeatable, instead of the real clock");
  app.add_option("--seconds,--duration", options.seconds, "How long, in seconds or with a unit")
      ->capture_default_str();
  app.add_option("--feedback", options.feedback, "What closes the loop: raw, estimator, or both, one by one")
      ->check(CLI::IsMember({"raw", "estimator", "both"}))
      ->capture_default_str();
  app.add_option("--id", options.id, "Data ID of the cycle: 0 single-turn, 3 everything")
      ->check(CLI::IsMember({0, 3}))
      ->capture_default_str();
  app.add_option("--amplitude", options.amplitude,
                 "Of the swing; with --speed: the way from point to point. 90deg, 0.25rev, 1.5rad")
      ->capture_default_str();
  CLI::Option* frequency =
      app.add_option("--frequency", options.frequency, "Of the swing (2Hz): 5, 5Hz, 0.1kHz");
  app.add_option("--speed", options.speed,
                 "Moves from point to point with this top speed instead of a swing: 1500rpm, 25rev/s")
      ->excludes(frequency);
  app.add_option("--load", options.load, "A weight on the shaft: a torque such as 0.3Nm")
      ->capture_default_str();
  app.add_option("--velocity-loop", options.velocity_loop,
                 "Crossover of the velocity loop; that of the position loop is a fifth")
      ->capture_default_str();
  app.add_option("--bandwidth", options.bandwidth, "Of the estimator")->capture_default_str();
  app.add_option("--states", options.states, "Of the estimator: 2 (constant speed) or 3 (and acceleration)")
      ->check(CLI::IsMember({2, 3}))
      ->capture_default_str();
  app.add_option("--drift", options.drift, "Of the servo clock against that of the bus: 100ppm")
      ->capture_default_str();
  app.add_option("--hold", options.hold, "How long the axis goes on without a sample; then its torque is off")
      ->capture_default_str();
  app.add_option(
         "--priority", options.priority,
         "Of both threads in real time: SCHED_FIFO 1 to 99, or 0; default: 80 on isolated cores, else 0")
      ->check(CLI::Range(0, 99));
  app.add_option("--outage", options.outage,
                 "No reply for this long, in the middle of the run: 0.5ms is bridged, 50ms is a torque-off");
  app.add_flag("--json", options.json, "One JSON object");
  app.footer(std::string("Position, velocity and current loop on a 400 W motor that turns the simulated "
                         "encoder; faults by the keys ber\nand lost. In real time bus and servo loop are two "
                         "real-time threads, and the bus takes a whole core.\n"
                         "Exit code 1 if the encoder saw T1 undercut, or the axis could not be switched on.\n"
                         "Examples:\n"
                         "  tm485 servo-demo\n"
                         "  tm485 servo-demo sim:profile=tm485_23,lost=0.01 --virtual --json\n"
                         "  tm485 servo-demo --speed 3000rpm --amplitude 5rev --load 0.5Nm --seconds 5\n"
                         "  tm485 servo-demo --virtual --outage 50ms --drift 100ppm\n") +
             kSimKeys);
}

}  // namespace tm485::cli
