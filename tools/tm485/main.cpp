// The tm485 command: what can be typed, and what it says about itself.

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <optional>
#include <string>

#include "commands.hpp"
#include "problem.hpp"
#include "stop_signal.hpp"
#include "tm485/version.hpp"
#include "usage_campaign.hpp"
#include "usage_checks.hpp"
#include "usage_eeprom.hpp"
#include "usage_list.hpp"
#include "usage_loop.hpp"
#include "usage_port.hpp"

namespace {

using namespace tm485::cli;

constexpr const char* kPortHelp =
    "sim: (simulated, for example sim:rpm=3000,profile=tformat_17), a serial device, unix:PATH,\n"
    "or a memory-mapped UART: mmio:pl011@0x9000000,clock=48MHz";

constexpr const char* kMmioKeys =
    "Keys of mmio:pl011@ADDRESS and mmio:16550@ADDRESS: clock, uio, shift, width, direction (none, rts, "
    "rts_off), "
    "lead,\nrelease, allowance, memory; for example mmio:16550@0xfe215040,clock=500MHz,shift=2";

/// Everything that the options of all sub-commands are put into.
struct Commands {
  DecodeOptions decode;
  InfoOptions info;
  ReadOptions read;
  MonitorOptions monitor;
  BenchOptions bench;
  DoctorOptions doctor;
  SimCommandOptions sim;
  RtCheckOptions rt_check;
  ServoDemoOptions servo_demo;
  EepromOptions eeprom;
  ResetOptions reset;
  ListOptions list;
  CampaignCommandOptions campaign;
  bool profiles_json = false;
};

void add_port_options(CLI::App& app, PortOptions& options) {
  app.add_option("PORT", options.port, kPortHelp)->required();
  app.add_option("--profile", options.profile,
                 "NAME of a preset, FILE.toml, or list; default: tm485_17, for sim:profile=X that one");
  app.add_option("--max-speed", options.max_speed,
                 "Faster than the shaft can turn, in rpm (6000): a position beyond that is refused");
  app.add_option("--max-accel", options.max_acceleration,
                 "More than the shaft is ever accelerated (1000000rpm/s; also rad/s2): likewise. The nearer "
                 "to the truth, "
                 "the less of a wrong position can pass");
  app.add_option(
      "--latency", options.latency,
      "A reply that is on the line is handed out within this time: 100ms; default: what the port states");
  app.add_flag("--echo", options.echo, "The port receives its own requests (as echo = true in a profile)");
  app.add_option("--direction", options.direction,
                 "Who switches the RS-485 driver: auto (transceiver, adapter), kernel[:low][:mute], "
                 "gpio:CHIP:LINE[:low] or gpio:NAME[:low]")
      ->capture_default_str();
  app.add_flag("--any-chip", options.any_chip,
               "Open the port also if its chip is known not to make the bit rate");
  app.add_flag("--json", options.json, "One JSON object a line");
}

void add_id(CLI::App& app, unsigned& id) {
  app.add_option("--id", id, "Data ID of the cycle: 0 single-turn, 1 multi-turn, 2 encoder ID, 3 everything")
      ->check(CLI::Range(0, 3))
      ->capture_default_str();
}

void add_decode(CLI::App& root, Commands& commands) {
  CLI::App& app = *root.add_subcommand("decode", "Say what bytes mean, as requests or replies");
  DecodeOptions& options = commands.decode;
  app.add_option("HEX", options.frames,
                 "Frames, one an argument, or the bytes of one frame as single arguments; none: lines of "
                 "standard input");
  app.add_option("--profile", options.profile, "NAME of a preset, FILE.toml, or list")->capture_default_str();
  app.add_option("--as", options.as,
                 "request or reply; default: by length (a 4-byte ID6 with ADF.7 is a reply)")
      ->check(CLI::IsMember({"request", "reply"}));
  app.add_flag("--json", options.json, "One JSON object a frame");
  app.footer(
      "Blanks, commas, 0x and # comments are understood. Exit code 1 if any frame is bad.\n"
      "Examples:\n"
      "  tm485 decode \"1A 20 13 6E 01 11 05 00 00 40 12\"\n"
      "  tm485 decode --json --profile tformat_17 02 8A 92\n"
      "  tm485 decode --json < captured.txt");
}

void add_info(CLI::App& root, Commands& commands) {
  CLI::App& app =
      *root.add_subcommand("info", "One look at an encoder: identity, position, alarms, reply delay");
  add_port_options(app, commands.info.port);
  app.footer(std::string("Exit code 1 if the encoder does not answer or reports a fault.\nExamples:\n"
                         "  tm485 info /dev/ttyUSB0\n"
                         "  tm485 info mmio:pl011@0xfe201000,clock=48MHz\n"
                         "  tm485 info sim:almc=40,profile=tformat_17_battery --json\n") +
             kSimKeys + "\n" + kMmioKeys);
}

void add_read(CLI::App& root, Commands& commands) {
  CLI::App& app = *root.add_subcommand("read", "Read positions, every cycle one line");
  ReadOptions& options = commands.read;
  add_port_options(app, options.port);
  add_id(app, options.id);
  app.add_option("-n,--count", options.count, "Cycles; 0: until Ctrl-C")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app.add_option(
      "--period", options.period,
      "Time (62.5us) or rate (16kHz) of the cycle, or min; default 1ms, longer if the port needs it");
  app.add_option("--units", options.units, "Units of the position: counts, rev, deg")
      ->check(CLI::IsMember({"counts", "rev", "deg"}))
      ->capture_default_str();
  app.footer(
      "A failed cycle repeats the last position with quality \"held\"; the causes are counted on standard "
      "error.\n"
      "t_ns is when the position was latched, in nanoseconds since the start of the command.\n"
      "Examples:\n"
      "  tm485 read /dev/ttyUSB0 -n 5\n"
      "  tm485 read sim:rpm=3000 --id 0 --period 40us --units deg --json\n"
      "  tm485 read unix:/tmp/encoder -n 0 --profile my_encoder.toml");
}

void add_monitor(CLI::App& root, Commands& commands) {
  CLI::App& app = *root.add_subcommand("monitor", "Live view: position, speed, alarms, rate, T1, T2, errors");
  MonitorOptions& options = commands.monitor;
  add_port_options(app, options.port);
  add_id(app, options.id);
  app.add_option("--period", options.period,
                 "Time (62.5us) or rate (16kHz) of the cycle; default: the shortest possible");
  app.add_option("--seconds", options.seconds, "How long, in seconds or with a unit; default: until Ctrl-C");
  app.add_flag("--virtual", options.virtual_time, "Virtual time instead of the real clock (sim: only)");
  app.footer(
      "On a terminal drawn in place ten times a second, otherwise one line a second.\n"
      "Examples:\n"
      "  tm485 monitor sim:rpm=3000\n"
      "  tm485 monitor /dev/ttyUSB0 --period 1ms --seconds 60");
}

void add_bench(CLI::App& root, Commands& commands) {
  CLI::App& app =
      *root.add_subcommand("bench", "How well host and port hold the cycle: percentiles, errors, rate");
  BenchOptions& options = commands.bench;
  add_port_options(app, options.port);
  add_id(app, options.id);
  app.add_option("--period", options.period,
                 "Time (62.5us) or rate (16kHz) of the cycle; default: the shortest possible");
  app.add_option("--seconds", options.seconds, "How long, in seconds or with a unit")->capture_default_str();
  app.add_flag("--virtual", options.virtual_time, "Virtual time instead of the real clock (sim: only)");
  app.add_option("--plot", options.plot, "FILE.png or FILE.svg: draw the histograms");
  app.add_flag("--yes", options.yes, "Replace an old picture without asking");
  app.footer(
      "Up to a million values of each time are kept; of more, a random choice.\n"
      "Examples:\n"
      "  tm485 bench sim: --id 3 --period 62.5us --seconds 5\n"
      "  tm485 bench sim: --id 0 --period 40us --virtual --json\n"
      "  tm485 bench /dev/ttyUSB0 --period 1ms --seconds 60 --plot bench.png\n"
      "  tm485 bench /dev/ttyAMA0 --direction kernel\n"
      "  tm485 bench /dev/ttyAMA0 --direction gpio:gpiochip0:17");
}

void add_doctor(CLI::App& root, Commands& commands) {
  CLI::App& app = *root.add_subcommand("doctor", "What is wrong with a port, with cause and remedy");
  add_port_options(app, commands.doctor.port);
  app.footer(
      std::string(
          "Looks at port, host, line and encoder, in less than 10 s. Nothing is written to the encoder.\n"
          "A simulated encoder is examined in virtual time.\n"
          "Exit code 0 without a fault (warnings and notes allowed), 1 with one, 2 if it cannot begin.\n"
          "Examples:\n"
          "  tm485 doctor /dev/ttyUSB0 --profile tformat_23\n"
          "  tm485 doctor sim:release=4us\n") +
      kSimKeys);
}

void add_sim(CLI::App& root, Commands& commands) {
  CLI::App& app = *root.add_subcommand("sim", "Serve a simulated encoder in real time");
  SimCommandOptions& options = commands.sim;
  CLI::Option* pty = app.add_flag("--pty", options.pty, "Behind a pseudo-terminal (the default)");
  CLI::Option* unix_path = app.add_option("--unix", options.unix_path, "Behind a unix socket at this path")
                               ->check(not_empty)
                               ->excludes(pty);
  app.add_option("--link", options.link, "A symbolic link to make to the pseudo-terminal")
      ->check(not_empty)
      ->excludes(unix_path);
  app.add_option("--profile", options.profile, "NAME of the kind of encoder")->capture_default_str();
  app.add_option("--rpm", options.rpm, "Speed of the shaft: 3000, 3000rpm, 50rev/s");
  app.add_option("--seed", options.seed, "Seed of everything random")->check(seed_number);
  app.add_option("--almc", options.almc, "Alarm byte in hexadecimal; SF follows from it");
  app.add_flag("--echo", options.echo, "Send the requests back, as an adapter that hears itself");
  app.add_option("--ber", options.ber,
                 "Probability of a wrong bit, or two: of requests and of replies, 0:1e-4");
  app.add_option("--lost", options.lost, "Probability 0..1 of a reply that does not come");
  app.add_option("--plan", options.plan, "A fault plan, as text or FILE: 'lose replies=1 from=5s for=20ms'")
      ->check(not_empty);
  app.add_option("--boot", options.boot, "Silent for this long after the start: 300ms");
  app.add_option("--eeprom", options.eeprom,
                 "FILE that keeps the EEPROM, also when the simulator is killed; a new one is filled with FF")
      ->check(not_empty);
  app.add_option("--eeprom-pages", options.eeprom_pages, "Pages of 127 bytes, 1 to 7 (7)");
  app.add_option("--eeprom-write", options.eeprom_write,
                 "Busy after a write: 10ms, or a range 5ms..12ms (10ms)");
  app.add_option("--eeprom-page", options.eeprom_page,
                 "Busy after a page select (18ms; of the T-format profiles 0ms)");
  app.add_option("--eeprom-fail", options.eeprom_fail,
                 "Probability 0..1 of a write that leaves the old value");
  app.add_option("--eeprom-seed", options.eeprom_seed,
                 "Seed of busy times and failed writes; otherwise from --seed")
      ->check(seed_number);
  app.add_flag("--eeprom-deaf", options.eeprom_deaf,
               "No reply to position requests while the EEPROM is busy");
  app.footer(
      "Prints the path to connect to, then serves until Ctrl-C.\n"
      "The file of --eeprom is saved after each completed write; requests wait for the disk meanwhile. "
      "Killed in the\n"
      "middle of a write, it keeps the old byte.\n"
      "Examples:\n"
      "  tm485 sim --pty --link /tmp/encoder --rpm 3000      then: tm485 read /tmp/encoder\n"
      "  tm485 sim --unix /tmp/encoder.socket --almc 40      then: tm485 monitor unix:/tmp/encoder.socket\n"
      "  tm485 sim --pty --link /tmp/encoder --eeprom /tmp/encoder.bin --eeprom-write 5ms..12ms");
}

int run(const CLI::App& app, const Commands& commands) {
  const auto chosen = [&app](const char* name) { return app.got_subcommand(name); };
  for (const std::string* profile :
       {&commands.decode.profile, &commands.info.port.profile, &commands.read.port.profile,
        &commands.monitor.port.profile, &commands.bench.port.profile, &commands.doctor.port.profile,
        &commands.eeprom.port.profile, &commands.reset.port.profile, &commands.sim.profile}) {
    if (*profile == "list")
      return run_profiles(commands.decode.json || commands.info.port.json || commands.read.port.json ||
                          commands.monitor.port.json || commands.bench.port.json ||
                          commands.doctor.port.json || commands.eeprom.port.json || commands.reset.port.json);
  }
  if (chosen("decode")) return run_decode(commands.decode);
  if (chosen("info")) return run_info(commands.info);
  if (chosen("read")) return run_read(commands.read);
  if (chosen("monitor")) return run_monitor(commands.monitor);
  if (chosen("bench")) return run_bench(commands.bench);
  if (chosen("doctor")) return run_doctor(commands.doctor);
  if (chosen("sim")) return run_sim(commands.sim);
  if (chosen("rt-check")) return run_rt_check(commands.rt_check);
  if (chosen("servo-demo")) return run_servo_demo(commands.servo_demo);
  if (chosen("eeprom")) return run_eeprom(app, commands.eeprom);
  if (chosen("reset")) return run_reset(commands.reset);
  if (chosen("list")) return run_list(commands.list);
  if (chosen("campaign")) return run_campaign_command(commands.campaign);
  return run_profiles(commands.profiles_json);
}

/// Everything that can be typed.
void declare(CLI::App& app, Commands& commands) {
  app.set_version_flag("--version", "tm485 " + std::string(tm485::version().text));
  app.require_subcommand(1);
  app.footer(
      "Examples:\n"
      "  tm485 monitor sim:rpm=3000\n"
      "  tm485 read /dev/ttyUSB0 -n 5 --json\n"
      "  tm485 decode \"92 00 11 83\"\n"
      "Each sub-command has its own help and examples: tm485 read --help\n"
      "Exit codes: 0 good, 1 the device, the line or the protocol failed, 2 the command cannot be carried "
      "out.");
  add_decode(app, commands);
  add_info(app, commands);
  add_read(app, commands);
  add_monitor(app, commands);
  add_bench(app, commands);
  add_doctor(app, commands);
  add_sim(app, commands);
  add_rt_check(app, commands.rt_check);
  add_servo_demo(app, commands.servo_demo);
  add_eeprom(app, commands.eeprom, add_port_options);
  add_reset(app, commands.reset, add_port_options);
  add_list(app, commands.list);
  add_campaign(app, commands.campaign);
  CLI::App& profiles = *app.add_subcommand("profiles", "The preset profiles");
  profiles.add_flag("--json", commands.profiles_json, "One JSON object a profile, times in ns");
  profiles.footer("Example:\n  tm485 profiles --json");
}

constexpr const char* kAbout =
    "TM485 and T-format absolute encoders on RS-485: look at them, read them, simulate them.";

}  // namespace

#ifdef TM485_COMMAND_LINE_ONLY

// For tests/fuzz, whose programs have a main() of their own.
namespace tm485::cli {
bool command_line_is_good(int argc, char** argv);
bool command_line_is_good(int argc, char** argv) {
  // Declared once for many lines: that takes ten times as long as to parse one. What the last line has set stays, and matters
  // to no parser; but an App keeps the order of all options that it has ever parsed.
  constexpr int kLines = 1'000;
  static std::optional<Commands> commands;
  static std::optional<CLI::App> app;
  static int left = 0;
  if (left == 0) {
    declare(app.emplace(kAbout, "tm485"), commands.emplace());
    left = kLines;
  }
  --left;
  (void)&run;
  try {
    app->parse(argc, argv);
  } catch (const CLI::ParseError&) {
    return false;
  }
  return true;
}
}  // namespace tm485::cli

#else

int main(int argc, char** argv) {
  install_stop_signal();
  Commands commands;
  CLI::App app(kAbout, "tm485");
  declare(app, commands);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const auto is_typed = [&](const CLI::App* command) { return command->check_name(argv[1]); };
    if (argc > 1 && argv[1][0] != '-' && app.get_subcommands(is_typed).empty())
      return report(usage_problem("no_command", fmt::format("there is no command '{}'", argv[1]),
                                  "tm485 --help lists them"));
    return app.exit(error) == 0 ? kExitGood : kExitUsage;
  }
  try {
    return run(app, commands);
  } catch (const std::exception& error) {
    return report(
        {"internal_error", error.what(), "report this with the command that led to it", kExitFailure});
  }
}

#endif
